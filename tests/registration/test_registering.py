"""A scan registered from nothing but its points, and scans in files as jobs."""

import os
import pickle
import signal
from pathlib import Path

import numpy as np
import pytest

from tests.registration.clouds import TURN, cloud, from_one_side, person, write_scan
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, UnknownName
from workbench.fitting import BadScan
from workbench.registration import (
    FailedScan,
    FitStage,
    ModelFit,
    Progress,
    Reading,
    Recipe,
    RegisteredScan,
    Registration,
    ScanJob,
    Support,
    facing,
    jobs_of,
    model_alone,
    register,
    registered,
    support,
)

FIT_STAGES = (FitStage(200, 0.05, 0.10, 8, 15), FitStage(600, 0.005, 0.03, 2, 40, 0.001))
QUICK = Recipe(FIT_STAGES, model_alone)


@pytest.fixture(scope="module")
def body() -> SkinnedBody:
    return load_body("small")


@pytest.fixture(scope="module")
def truth(body: SkinnedBody) -> Array:
    return person(body)


@pytest.fixture(scope="module")
def whole(body: SkinnedBody, truth: Array) -> Registration:
    return register(body, cloud(body, truth), recipe=Recipe(FIT_STAGES))


def test_person_is_registered(body: SkinnedBody, truth: Array, whole: Registration) -> None:
    assert np.linalg.norm(whole.vertices - truth, axis=1).mean() < 0.01  # m
    assert whole.facing == pytest.approx(TURN, abs=0.05)
    assert [stage.name for stage in whole.stages] == ["model", "free"]
    assert whole.stages[0].unknowns == 3 * body.n_joints + body.n_betas + 3
    assert whole.stages[-1].unknowns == whole.stages[0].unknowns + 3 * body.n_vertices
    assert whole.median == np.median(np.abs(whole.distances[whole.touching]))
    assert whole.median < 0.003
    assert whole.size.name == "height"
    assert whole.size.metres == pytest.approx(np.ptp(body.template[:, 1]), rel=0.02)
    assert not whole.doubts


def test_every_stage_lowers_the_median_distance(whole: Registration) -> None:
    medians = [stage.median for stage in whole.stages]
    assert medians == sorted(medians, reverse=True)


@pytest.mark.thorough
def test_model_alone_is_the_body_of_the_values(body: SkinnedBody, truth: Array) -> None:
    found = register(body, cloud(body, truth), recipe=QUICK)
    assert [stage.name for stage in found.stages] == ["model"]
    np.testing.assert_array_equal(found.vertices, found.model)
    np.testing.assert_allclose(found.model, body.vertices(**found.values), atol=1e-15)


@pytest.mark.thorough
def test_triangle_bodies_are_registered() -> None:
    scape = load_body("small-scape")
    scan = cloud(load_body("small"), load_body("small").vertices())
    found = register(scape, scan, recipe=Recipe((FitStage(200, 0.02, 0.1, 1, 5),)))
    assert [stage.name for stage in found.stages] == ["model"]
    assert found.vertices.shape == (scape.n_vertices, 3)


@pytest.mark.thorough
def test_hidden_side_is_less_certain(body: SkinnedBody, truth: Array) -> None:
    half = from_one_side(cloud(body, truth, 2000), np.array([0.0, 0.0, 1.0]))
    found = register(body, half, recipe=QUICK)
    assert 0.2 < found.seen.mean() < 0.8
    assert found.sd[~found.seen].mean() > found.sd[found.seen].mean()


@pytest.mark.thorough
def test_boundary_points_are_left_out(body: SkinnedBody, truth: Array) -> None:
    half = from_one_side(cloud(body, truth, 2000), np.array([0.0, 0.0, 1.0]))
    found = register(body, half, recipe=Recipe(FIT_STAGES, model_alone, boundary=0.01))
    assert found.left_out > 0
    assert found.scan.n_points + found.left_out == half.n_points
    with pytest.raises(BadScan, match="leave a narrower boundary out"):
        register(body, half, recipe=Recipe(FIT_STAGES, boundary=10.0))
    with pytest.raises(BadArgument, match="0 m or more, not -1"):
        Recipe(boundary=-1.0)


def test_interrupt_ends_a_registration(body: SkinnedBody, truth: Array) -> None:
    def press(at: Progress) -> None:
        if at.start == 2:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            register(body, cloud(body, truth), recipe=QUICK, progress=press)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.thorough
def test_registration_can_be_pickled(whole: Registration) -> None:
    again = pickle.loads(pickle.dumps(whole))
    np.testing.assert_array_equal(again.vertices, whole.vertices)
    assert again.stages == whole.stages


@pytest.mark.thorough
def test_scan_file_is_registered(body: SkinnedBody, truth: Array, tmp_path: Path) -> None:
    write_scan(str(tmp_path / "scan.xyz"))
    found = registered(body, QUICK, Reading(), ScanJob("scan", tmp_path / "scan.xyz"))
    assert isinstance(found, RegisteredScan)
    assert np.linalg.norm(found.registration.vertices - truth, axis=1).mean() < 0.02
    assert any("taken to be m" in note for note in found.notes)


def test_failure_of_one_scan_is_its_answer(
    body: SkinnedBody, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0 0\n")
    found = registered(body, QUICK, Reading(), ScanJob("bad", tmp_path / "bad.obj"))
    assert isinstance(found, FailedScan)
    assert "a scan has at least 100" in found.reason

    def fails(*_: object, **__: object) -> None:
        raise ZeroDivisionError("of ours")

    def pressed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    write_scan(str(tmp_path / "scan.xyz"))
    job = ScanJob("scan", tmp_path / "scan.xyz")
    monkeypatch.setattr("workbench.registration.scan_jobs.register", fails)
    found = registered(body, QUICK, Reading(), job)
    assert isinstance(found, FailedScan)
    assert found.reason == "an unforeseen error, ZeroDivisionError: of ours"
    monkeypatch.setattr("workbench.registration.scan_jobs.register", pressed)
    with pytest.raises(KeyboardInterrupt):
        registered(body, QUICK, Reading(), job)


def test_facing_follows_the_root() -> None:
    about_y = np.array([0.0, 0.5, 0.0])
    np.testing.assert_allclose(facing(about_y, np.zeros(3)), [np.sin(0.5), 0, np.cos(0.5)])
    np.testing.assert_allclose(facing(about_y, about_y), [0, 0, 1], atol=1e-15)
    bent = facing(np.array([0.4, 0.0, 0.0]), np.zeros(3))  # forwards
    np.testing.assert_allclose(bent, [0, 0, 1], atol=1e-15)


def test_names_of_jobs_differ() -> None:
    files = [Path("a/one.ply"), Path("a/two.ply"), Path("a/two.obj")]
    assert [job.name for job in jobs_of(files)] == ["one", "two-ply", "two-obj"]
    with pytest.raises(BadArgument, match=r"a/one\.ply and b/one\.ply have the same name"):
        jobs_of([Path("a/one.ply"), Path("b/one.ply")])


def test_names_of_jobs_are_names_of_folders() -> None:
    files = [Path(name) for name in ("One.ply", "one.obj", "a#1.ply", " b.ply", "start.npz.obj")]
    names = [job.name for job in jobs_of(files)]
    assert names == ["One-ply", "one-obj", "a-1", "b", "start-npz-obj"]
    (of_array, other) = jobs_of([Path("people.npz"), Path("one.ply")], "of/anna")
    assert (of_array.name, other.name) == ("people-of-anna", "one")


def test_reading_is_checked_before_files() -> None:
    with pytest.raises(UnknownName, match="no unit is called 'ft'"):
        Reading(unit="ft")
    with pytest.raises(UnknownName, match="no axis is called 'w'"):
        Reading(up="w")
    with pytest.raises(BadArgument, match="at least 1,000 points"):
        Reading(most=10)


@pytest.mark.thorough
def test_interrupt_while_judging_is_not_lost(
    body: SkinnedBody, truth: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    import workbench.registration.registering as module

    def pressed(fit: ModelFit, *, near: float) -> Support:
        os.kill(os.getpid(), signal.SIGINT)
        return support(fit, near=near)

    monkeypatch.setattr(module, "support", pressed)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            register(body, cloud(body, truth), recipe=QUICK)
    finally:
        signal.signal(signal.SIGINT, before)


def test_scan_without_contact_is_not_registered(body: SkinnedBody, tmp_path: Path) -> None:
    write_scan(str(tmp_path / "scan.xyz"))
    numbers = np.loadtxt(tmp_path / "scan.xyz")
    numbers[:, 3:] *= -1  # normals that point inwards
    np.savetxt(tmp_path / "scan.xyz", numbers)
    stages = (FitStage(200, 0.001, 1e-6, 1, 1),)
    found = registered(
        body, Recipe(stages, model_alone), Reading(), ScanJob("scan", tmp_path / "scan.xyz")
    )
    assert isinstance(found, FailedScan)
    assert "touches the surface" in found.reason
