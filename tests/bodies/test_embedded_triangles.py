"""The embedded SCAPE and BlendSCAPE bodies: what they learned, and that they go everywhere."""

from importlib.resources import files
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.catalogue import EmbeddedTriangles, load_body
from workbench.bodies.files.embedded_triangles import UNTRAINED, read_embedded_triangles
from workbench.bodies.triangles import TriangleBody, scape
from workbench.errors import BadFile
from workbench.experiments import find, run
from workbench.priors.poses import draw_poses, shipped_gaussian

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


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"nothing\.npz is no embedded body"):
        read_embedded_triangles(tmp_path / "nothing.npz", "small", scape)
    np.savez(tmp_path / "other.npz", near=np.zeros((734, 2), dtype=np.uint8))
    with pytest.raises(BadFile, match="card, posedirs, posedirs_step missing"):
        read_embedded_triangles(tmp_path / "other.npz", "small", scape)


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
