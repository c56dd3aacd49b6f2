"""The embedded SCAPE and BlendSCAPE bodies: what they learned, and that they go everywhere."""

import re
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from workbench.bodies.catalogue import EmbeddedTriangles, load_body
from workbench.bodies.files.embedded_triangles import UNTRAINED, read_embedded_triangles
from workbench.bodies.triangles import TriangleBody, scape
from workbench.cli.app import app
from workbench.errors import BadArgument, BadBody, BadFile
from workbench.experiments import EXPERIMENTS, SUITES, find, run
from workbench.experiments.arguments import parameters
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.studies.triangles.people import TrianglePlan

FOLDER = Path(str(files("workbench"))) / "data" / "bodies"
EACH = pytest.mark.parametrize("name", get_args(EmbeddedTriangles))


def loaded(name: str) -> TriangleBody:
    body = load_body(name)
    assert isinstance(body, TriangleBody)
    return body


@EACH
def test_only_posedirs_are_their_own(name: str) -> None:
    body, (mesh, model) = loaded(name), UNTRAINED[name]
    untrained = model(wb.load_body(mesh))
    for part in ("template", "faces", "shapedirs", "near"):
        np.testing.assert_array_equal(getattr(body, part), getattr(untrained, part))
    for part in ("weights", "J_regressor"):
        assert (getattr(body, part) != getattr(untrained, part)).nnz == 0
    assert body.name == name
    assert body.posedirs.any()
    assert (FOLDER / f"{name}.npz").stat().st_size < 0.3e6


@EACH
def test_posedirs_help_on_people_from_whom_nothing_was_learned(name: str) -> None:
    body, (mesh, model) = loaded(name), UNTRAINED[name]
    skinned, rng = wb.load_body(mesh), np.random.default_rng(99)
    poses = draw_poses(shipped_gaussian(), 20, rng)
    betas = rng.standard_normal((20, body.n_betas))
    wanted = centred(skinned.vertices(poses, betas))
    off, before = (
        np.sqrt(((centred(one.vertices(poses, betas)) - wanted) ** 2).sum(axis=2).mean())
        for one in (body, model(skinned))
    )
    assert off < 0.4 * before
    held_out = body.card["held_out"]
    assert held_out["rms_mm"] < 0.35 * held_out["rms_without_posedirs_mm"]


def centred(surfaces: np.ndarray) -> np.ndarray:
    return surfaces - surfaces.mean(axis=1, keepdims=True)


@EACH
def test_the_card_says_what_was_learned_and_from_whom(name: str) -> None:
    card = loaded(name).card
    mesh, _ = UNTRAINED[name]
    assert "no scan was seen" in card["learned"]
    assert f"body {mesh!r}" in card["learned"]
    assert card["synthetic"]
    assert "Apache-2.0" in card["licence"]
    assert card["skinned_body"]["name"] == mesh
    errors, ridges = card["builder"]["validation_rms_mm"], card["builder"]["ridges_m2"]
    allowed = [
        ridge for ridge, error in zip(ridges, errors, strict=True) if error <= 1.1 * min(errors)
    ]
    assert card["builder"]["ridge_m2"] == max(allowed)


@EACH
def test_the_table_of_their_provenance_says_what_the_cards_say(name: str) -> None:
    said = (FOLDER / "PROVENANCE.md").read_text(encoding="utf-8")
    card = loaded(name).card
    held_out, builder = card["held_out"], card["builder"]
    row = f"| `{name}` | {held_out['rms_mm']:.1f} | {held_out['rms_without_posedirs_mm']:.1f} |"
    assert said.count(row) == 1
    assert (
        f"mm, {held_out['people']} held-out people and poses | as shipped | without posed" in said
    )
    assert f"    {builder['command']}\n" in said
    text = " ".join(said.split())
    assert f"{builder['people']} of its people, each in one pose" in text
    assert f"turned further at random by {builder['turned_rad']} rad on every axis" in text
    assert len(builder["ridges_m2"]) == 4
    assert (
        "the largest of four values for which the error on 100 further people is within 10 %"
        in text
    )


def test_the_table_of_provenance_has_no_other_rows() -> None:
    said = (FOLDER / "PROVENANCE.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w-]*scape)` \|", said, re.MULTILINE)
    assert rows == list(get_args(EmbeddedTriangles))


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"there is no file .*nothing\.npz"):
        read_embedded_triangles(tmp_path / "nothing.npz", "small", scape)
    np.savez(tmp_path / "other.npz", near=np.zeros((734, 2), dtype=np.uint8))
    with pytest.raises(BadFile, match="card, posedirs, posedirs_step missing"):
        read_embedded_triangles(tmp_path / "other.npz", "small", scape)


NEEDS_SKINNED = (
    r"a SkinnedBody is needed here, but body 'small-scape' is a TriangleBody; the skinned bodies "
    r"are default, .*, small, or give a file of another kind"
)
FITS = (
    "known-correspondences",
    "balance",
    "balance-monocular",
    "landmarks",
    "registration",
    "body-vertices",
    "body-joints",
    "body-video",
    "body-outliers",
)


OWN = tuple(f"body-points-{model}" for model in ("lbs", "smpl", "scape", "blend-scape"))
SKINNED = ("markers", "self-contact")  # of offsets and capsules, which only skinned bodies have
CHOOSING = tuple(  # the experiments that let their body be chosen
    one.name
    for one in (*EXPERIMENTS.values(), *chain.from_iterable(SUITES.values()))
    if "body" in parameters(one.build)
)


def test_the_fits_and_those_that_make_their_own_bodies_let_the_body_be_chosen() -> None:
    assert set(FITS) < set(CHOOSING)
    assert set(OWN) < set(CHOOSING)
    assert len(CHOOSING) > len(FITS) + len(OWN)


@pytest.mark.parametrize(
    "experiment", [name for name in CHOOSING if name not in (*FITS, *OWN, *SKINNED)]
)
def test_every_other_problem_that_lets_its_body_be_chosen_takes_one(experiment: str) -> None:
    setup = find(experiment, {"body": "small-scape"}).setup()
    assert isinstance(setup.body or (setup.moving and setup.moving.body), TriangleBody)
    assert setup.problem.free.size > 3
    assert np.isfinite(setup.problem.linearize(setup.start).cost)


@pytest.mark.parametrize("experiment", SKINNED)
def test_experiments_of_skinned_bodies_refuse_a_triangle_body(experiment: str) -> None:
    with pytest.raises(BadArgument, match="small-scape"):
        find(experiment, {"body": "small-scape"}).setup()


@pytest.mark.parametrize("experiment", OWN)
def test_experiments_that_make_their_own_triangle_bodies_refuse_one(experiment: str) -> None:
    with pytest.raises(BadBody, match=NEEDS_SKINNED):
        find(experiment, {"body": "small-scape"}).setup()


@pytest.mark.parametrize(
    "command",
    [("blendshapes", "--body", "small-scape"), ("train", ".", "--start", "small-scape")],
    ids=lambda command: command[0],
)
def test_commands_that_start_from_skinned_bodies_refuse_a_triangle_body(
    command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, command)
    assert isinstance(done.exception, BadBody)
    assert re.search(NEEDS_SKINNED, str(done.exception))


def test_the_study_of_triangles_refuses_a_triangle_body() -> None:
    with pytest.raises(BadArgument, match="no body 'small-scape'; there are default, small, full"):
        TrianglePlan(body="small-scape")


@pytest.mark.parametrize("experiment", FITS)
def test_every_fit_takes_scape_in_the_place_of_smpl(experiment: str) -> None:
    outcome = run(find(experiment, {"body": "small-scape"}), compare=False)
    assert outcome.solution.converged
    assert outcome.solution.cost < outcome.setup.problem.linearize(outcome.setup.start).cost
    assert outcome.diagnosis.rank == outcome.setup.problem.free.size
    if experiment != "body-video":  # in which there are eight bodies, and none is drawn
        assert isinstance(outcome.setup.body, TriangleBody)
        assert outcome.surface is not None
    assert all(np.isfinite(overlay.projected).all() for overlay in outcome.overlays)
