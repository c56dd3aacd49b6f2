"""Scans registered from their points: persons, hands, clothing, files."""

import json
import os
import pickle
import signal
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import workbench as wb
from tests.registration.clouds import TURN, cloud, from_one_side, person, write_scan
from tests.tiers import few
from workbench import load_body
from workbench.bodies import pose_space
from workbench.bodies.catalogue import load_skinned
from workbench.cli.app import app
from workbench.errors import BadArgument, UnknownName
from workbench.fitting import BadScan
from workbench.fitting.hands import mean_hand, points_of
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    HAND_RECIPE,
    PERSON_RECIPE,
    FailedScan,
    FitStage,
    ModelFit,
    Reading,
    Recipe,
    RegisteredScan,
    ScanJob,
    Support,
    body_size,
    hand_starts,
    jobs_of,
    register,
    registered,
    support,
    usual_recipe,
    with_skeleton,
)
from workbench.synthetic import Noise, SimulatedScan, scan, scanners

FIT_STAGES = (FitStage(200, 0.05, 0.10, 8, 15), FitStage(600, 0.005, 0.03, 2, 40, 0.001))
QUICK = Recipe(FIT_STAGES, ())


BODY = load_body("small")
TRUTH = person(BODY)
SCAN = cloud(BODY, TRUTH)
HALF = from_one_side(cloud(BODY, TRUTH, 2000), np.array([0.0, 0.0, 1.0]))


def test_person_is_registered() -> None:
    body, whole = BODY, register(BODY, SCAN, recipe=Recipe(FIT_STAGES))
    assert np.linalg.norm(whole.vertices - TRUTH, axis=1).mean() < 0.01  # m
    assert whole.facing == pytest.approx(TURN, abs=0.05)
    assert [stage.name for stage in whole.stages] == ["model", "free", "relaxed"]
    assert whole.stages[0].unknowns == 3 * body.n_joints + body.n_betas + 3
    assert whole.stages[-1].unknowns == whole.stages[0].unknowns + 3 * body.n_vertices
    assert whole.median == np.median(np.abs(whole.distances[whole.touching]))
    assert whole.median < 0.003
    assert whole.size.name == "height"
    assert whole.size.metres == pytest.approx(np.ptp(body.template[:, 1]), rel=0.02)
    assert not whole.doubts
    stature = whole.measurements[0]
    assert stature.name == "stature"
    assert stature.value == pytest.approx(whole.size.metres, abs=1e-9)
    assert 0.0005 < stature.sd < 0.01  # m
    assert stature.contraction > 0.9
    medians = [stage.median for stage in whole.stages]
    assert medians == sorted(medians, reverse=True)
    again = pickle.loads(pickle.dumps(whole))
    np.testing.assert_array_equal(again.vertices, whole.vertices)
    assert again.stages == whole.stages


@pytest.mark.thorough
def test_triangle_bodies_are_registered() -> None:
    scape, scan = load_body("small-scape"), cloud(BODY, BODY.vertices())
    registration = register(scape, scan, recipe=Recipe((FitStage(200, 0.02, 0.1, 1, 5),)))
    assert [stage.name for stage in registration.stages] == ["model"]
    assert registration.vertices.shape == (scape.n_vertices, 3)


@pytest.mark.thorough
def test_boundary_points_are_left_out() -> None:
    registration = register(BODY, HALF, recipe=Recipe(FIT_STAGES, (), boundary=0.01))
    assert registration.left_out > 0
    assert registration.scan.n_points + registration.left_out == HALF.n_points
    with pytest.raises(BadScan, match="this one is empty"):
        register(BODY, HALF, recipe=Recipe(FIT_STAGES, boundary=10.0))
    with pytest.raises(BadArgument, match="boundary of a recipe"):
        Recipe(boundary=-1.0)


def press(*_: object, **__: object) -> None:
    """Ctrl-C, which arrives between two instructions."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("when", few(["fitting", "judging"], 1))
def test_interrupt_ends_a_registration(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(fit: ModelFit, *, near: float) -> Support:
        press()
        return support(fit, near=near)

    if when == "judging":
        monkeypatch.setattr("workbench.registration.registering.support", pressed)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            register(BODY, SCAN, recipe=QUICK, progress=press if when == "fitting" else None)
    finally:
        signal.signal(signal.SIGINT, before)


def test_failure_of_one_scan_is_its_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0 0\n")
    write_scan(str(tmp_path / "scan.xyz"))
    numbers = np.loadtxt(tmp_path / "scan.xyz") * [1, 1, 1, -1, -1, -1]
    np.savetxt(tmp_path / "inwards.xyz", numbers)
    untouched = Recipe((FitStage(200, 0.001, 1e-6, 1, 1),), ())
    for file, recipe, why in [
        ("bad.obj", QUICK, "a scan has at least 100"),
        ("inwards.xyz", untouched, "touches the surface"),
    ]:
        failed = registered(BODY, recipe, Reading(), ScanJob("one", tmp_path / file))
        assert isinstance(failed, FailedScan)
        assert why in failed.reason

    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("workbench.registration.scan_jobs.register", fails)
    job = ScanJob("scan", tmp_path / "scan.xyz")
    error: BaseException = ZeroDivisionError("of ours")
    failed = registered(BODY, QUICK, Reading(), job)
    assert isinstance(failed, FailedScan)
    assert failed.reason == "an unforeseen error, ZeroDivisionError: of ours"
    error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        registered(BODY, QUICK, Reading(), job)


def test_names_of_jobs_are_names_of_folders() -> None:
    files = [Path(name) for name in ("One.ply", "one.obj", "a#1.ply", " b.ply", "start.npz.obj")]
    names = [job.name for job in jobs_of(files)]
    assert names == ["One-ply", "one-obj", "a-1", "b", "start-npz-obj"]
    with pytest.raises(BadArgument, match=r"a/one\.ply and b/one\.ply have the same name"):
        jobs_of([Path("a/one.ply"), Path("b/one.ply")])
    (of_array, other) = jobs_of([Path("people.npz"), Path("one.ply")], "of/anna")
    assert (of_array.name, other.name) == ("people-of-anna", "one")


def test_reading_is_checked_before_files() -> None:
    with pytest.raises(UnknownName, match="no unit is called 'ft'"):
        Reading(unit="ft")
    with pytest.raises(UnknownName, match="no axis is called 'w'"):
        Reading(up="w")
    with pytest.raises(BadArgument, match="at least 1,000 points"):
        Reading(most=10)


HAND = load_skinned("hand")
FEW = (
    FitStage(150, 0.012, 0.030, 48, 8, 0.03),
    FitStage(600, 0.005, 0.015, 2, 20, 0.003),
    FitStage(1000, 0.003, 0.009, 1, 20, 0.002),
)


@lru_cache
def made() -> tuple[wb.Values, SimulatedScan]:
    """A hand in a pose of the pose space, turned at random, scanned from four sides."""
    rng = np.random.default_rng(21)
    space = pose_space(HAND)
    pose = space.poses(HAND, space.deviations * rng.standard_normal(45))
    pose[0] = Rotation.random(random_state=rng).as_rotvec()
    values = {"pose": pose, "betas": rng.standard_normal(10), "trans": rng.standard_normal(3)}
    vertices = HAND.vertices(**values)
    around = scanners(4, distance=0.4, target=vertices.mean(axis=0))
    return values, scan(vertices, HAND.faces, around, seed=1, noise=Noise(0.0, 0.0005, 0.0))


def errors(values: wb.Values) -> np.ndarray:
    truth = HAND.vertices(**made()[0])
    vertices = HAND.vertices(*(values[name] for name in ("pose", "betas", "trans")))
    return 1e3 * np.linalg.norm(vertices - truth, axis=1)


@pytest.mark.thorough
def test_a_hand_turned_any_way_is_found_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points, normals = made()[1].scan.points, made()[1].scan.normals
    assert normals is not None
    fitted = np.random.default_rng(0).random(len(points)) < 0.5
    file = tmp_path / "scan.xyz"
    np.savetxt(file, np.column_stack([points, normals])[fitted], fmt="%.7f")
    quick = replace(HAND_RECIPE, fit_stages=FEW)
    monkeypatch.setattr("workbench.cli.register.usual_recipe", lambda body: quick)
    options = ["--body", "hand", "--unit", "m", "--up", "y", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["register", str(file), *options])
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "register-scan" / "registration.npz") as arrays:
        vertices, values = arrays["vertices"], {n: arrays[n] for n in ("pose", "betas", "trans")}
    assert errors(values).mean() < 3
    size = body_size(HAND, values["betas"])
    assert "length at rest" in (tmp_path / "register-scan" / "index.html").read_text()
    summary = json.loads((tmp_path / "register-scan" / "summary.json").read_text())
    assert summary["length_m"] == pytest.approx(size.metres)
    off = 1e3 * np.linalg.norm(vertices - HAND.vertices(**made()[0]), axis=1)
    assert off.mean() < 1.5
    away = SurfaceTree(vertices, HAND.faces).closest(points[~fitted]).distances
    assert 1e3 * np.median(np.abs(away)) < 1


@pytest.mark.thorough
def test_a_skeleton_starts_the_fit_and_counts_in_it() -> None:
    truth, simulated = made()
    rng = np.random.default_rng(2)
    points = points_of(HAND, truth) + 0.002 * rng.standard_normal((21, 3))
    recipe = with_skeleton(replace(HAND_RECIPE, fit_stages=FEW), HAND, points)
    fit = recipe.fit(HAND, simulated.scan)
    assert [residual.name for residual in fit.problem.residuals] == [
        *("scan", "pose prior", "shape prior", "hand limits", "hand points"),
    ]
    assert len(fit.hypotheses) == 1
    assert errors(fit.values).mean() < 1.5


def test_a_skeleton_is_read_in_the_unit_and_the_axes_of_the_scan(tmp_path: Path) -> None:
    truth, simulated = made()
    turned = 1e3 * simulated.scan.points[:, [0, 2, 1]] * [1, -1, 1]  # z up, in mm
    np.save(tmp_path / "scan.npy", turned)
    known = points_of(HAND, truth)
    known[4] = np.nan  # which was not seen
    np.savez(tmp_path / "skeleton.npz", joints=1e3 * known[:, [0, 2, 1]] * [1, -1, 1])
    one = (FitStage(600, 0.003, 0.009, 1, 8),)
    recipe = replace(HAND_RECIPE, fit_stages=one, vertex_stages=())
    reading = Reading("mm", "z", skeleton=tmp_path / "skeleton.npz")
    done = registered(HAND, recipe, reading, ScanJob("scan", tmp_path / "scan.npy"))
    assert isinstance(done, RegisteredScan), done
    assert errors(done.registration.values).mean() < 1.5
    (tmp_path / "skeleton.npz").unlink()
    missing = registered(HAND, recipe, reading, ScanJob("scan", tmp_path / "scan.npy"))
    assert isinstance(missing, FailedScan)
    assert "skeleton.npz" in missing.reason
    reading = Reading("mm", "z", skeleton=tmp_path / "scan.npy")
    other = registered(HAND, recipe, reading, ScanJob("scan", tmp_path / "scan.npy"))
    assert isinstance(other, FailedScan)
    assert "points of a hand have the shape (21, 3)" in other.reason


def test_starts_are_all_turns_of_a_cube_about_the_middle() -> None:
    cloud = made()[1].scan
    starts = hand_starts(HAND, cloud)
    assert len(starts) == 48
    middles = [HAND.vertices(**start).mean(axis=0) for start in starts]
    np.testing.assert_allclose(middles, np.tile(cloud.points.mean(axis=0), (48, 1)), atol=1e-9)
    turns = [Rotation.from_rotvec(start["pose"][0]) for start in starts[:24]]
    apart = [(turns[0].inv() * turn).magnitude() for turn in turns[1:]]
    assert min(apart) > np.radians(89)
    np.testing.assert_allclose(starts[0]["pose"][1:], mean_hand(HAND)["pose"][1:])
    assert len(hand_starts(replace(HAND, extras={}), cloud)) == 24


def test_the_recipe_is_that_of_what_the_body_is() -> None:
    assert usual_recipe(HAND) is HAND_RECIPE
    assert usual_recipe(load_skinned("small")) is PERSON_RECIPE
    assert len(HAND_RECIPE.stages_of_vertices(HAND)) == 1
    with pytest.raises(BadArgument, match="within of a recipe"):
        Recipe(vertex_stages=(), within=0.0)
