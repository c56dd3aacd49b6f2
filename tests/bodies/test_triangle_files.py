"""Triangle bodies in files, those that are shipped, and where they take the place of SMPL."""

from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import workbench as wb
from tests.bodies.laws import some_arguments
from tests.bodies.test_triangles import MADE, made
from tests.bodies_made_up import tube_body
from tests.tiers import few
from workbench.bodies.catalogue import EmbeddedTriangles, load_body, load_skinned
from workbench.bodies.files.embedded import UNTRAINED, read_embedded_triangles
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument, BadBody, BadFile
from workbench.experiments import find, run
from workbench.priors.poses import draw_poses, shipped_gaussian

EXTRAS = {"joint_limits": np.arange(6.0).reshape(3, 2), "gender": np.array("neutral")}
CARD = {"source": "made up", "numbers": [1, 0.1, None], "nested": {"é": "ü"}}
ARRAYS = ("template", "faces", "shapedirs", "posedirs", "near")


def whole(body: TriangleBody) -> TriangleBody:
    """The body with everything that its file can hold."""
    return replace(body, name="somebody", card=CARD, extras=EXTRAS)


def assert_same(one: TriangleBody, other: TriangleBody) -> None:
    assert type(one) is type(other) is TriangleBody
    for name in ARRAYS:
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b, err_msg=name)
    pairs = [(one.weights, other.weights), (one.J_regressor, other.J_regressor)]
    assert one.landmarks.keys() == other.landmarks.keys()
    for name, marks in one.landmarks.items():
        assert marks.names == other.landmarks[name].names
        pairs.append((marks.regressor, other.landmarks[name].regressor))
    for a, b in pairs:
        assert a.shape == b.shape
        for part in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(a, part), getattr(b, part))
    assert (one.parents, one.joint_names, one.name) == (
        other.parents,
        other.joint_names,
        other.name,
    )
    assert dict(one.card) == dict(other.card)
    assert one.extras.keys() == other.extras.keys()
    for key, value in one.extras.items():
        np.testing.assert_array_equal(value, other.extras[key])


@pytest.mark.parametrize("name", few(MADE, ("SCAPE", "BlendSCAPE", "no betas", "no twists")))
def test_saved_body_comes_back(name: str, tmp_path: Path) -> None:
    given = whole(made(name))
    wb.save_body(given, tmp_path / "body.npz")
    found = wb.load_body(tmp_path / "body.npz")
    assert isinstance(found, TriangleBody)
    assert_same(given, found)
    arguments = some_arguments(given)
    np.testing.assert_array_equal(found.vertices(*arguments), given.vertices(*arguments))


def test_file_says_which_kind_it_holds(tmp_path: Path) -> None:
    skinned = tube_body()
    wb.save_body(skinned, tmp_path / "skinned.npz")
    wb.save_body(blend_scape(skinned), tmp_path / "triangles.npz")
    assert isinstance(load_skinned(tmp_path / "skinned.npz"), wb.SkinnedBody)
    with pytest.raises(BadBody, match="a SkinnedBody is needed here"):
        load_skinned(tmp_path / "triangles.npz")
    with pytest.raises(BadFile, match="which the package smplx does not know"):
        wb.save_body(blend_scape(skinned), tmp_path / "body.pkl")
    assert not (tmp_path / "body.pkl").exists()


def without(*keys: str) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda arrays: {k: v for k, v in arrays.items() if k not in keys}


def put(**changed: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda arrays: arrays | {k.replace("__", "/"): v for k, v in changed.items()}


DAMAGES = [
    (without("card", "f"), BadFile, "has no f, card"),
    (put(bs_style=np.array("chain")), BadFile, "bs_style 'chain'"),
    (put(near=np.zeros((40, 3), int)), BadFile, "posedirs has shape"),
    (put(near=np.full((40, 2), 0.5)), BadFile, "near must hold whole numbers"),
    (put(f=np.zeros((40, 4), int)), BadFile, "f has shape"),
    (put(f=np.full((40, 3), 99)), BadBody, "there are 22"),
    (put(shapedirs=np.full((40, 3, 3, 2), np.inf)), BadBody, "not finite"),
    (put(v_template=np.array("tall")), BadFile, "must hold numbers"),
    (put(v_template=1e200 * np.eye(22, 3)), BadBody, "beyond 1,000 m"),
    (put(v_template=np.zeros((22, 3))), BadBody, "no area"),
    (put(weights__indices=np.full(40, 99)), BadFile, "weights is no sparse matrix"),
    (put(weights__data=np.full(40, 2.0)), BadBody, "sum to 2"),
    (put(weights__shape=np.array([2**40, 3])), BadFile, "weights is no sparse matrix"),
    (put(J_regressor__shape=np.array([3, 2**40])), BadBody, "J_regressor has shape"),
    (put(kintree_table=np.array([[9, 2, 1], [0, 1, 2]])), BadBody, "joint 1 has parent 2"),
    (put(card=np.array("{")), BadFile, "its card is no JSON"),
]


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    wb.save_body(made("SCAPE"), tmp_path / "body.npz")
    with np.load(tmp_path / "body.npz") as archive:
        arrays = dict(archive)
    for damage, error, text in DAMAGES:
        np.savez(tmp_path / "damaged.npz", **damage(arrays))
        with pytest.raises(error, match=text):
            wb.load_body(tmp_path / "damaged.npz")
    np.savez(tmp_path / "more.npz", **arrays, thing=np.array([{}], dtype=object))
    (said,) = wb.load_body(tmp_path / "more.npz").card["left_out"]
    assert said.startswith("thing, which is an array of Python objects")


def test_extras_cannot_replace_the_body_s_arrays() -> None:
    for key in ("near", "weights/data", "bs_style", "landmarks/x/names"):
        with pytest.raises(BadBody, match=f"extras must not be called .*: {key}"):
            replace(made("SCAPE"), extras={key: np.zeros(3)})


# Those that are shipped.

FOLDER = Path(str(files("workbench"))) / "data" / "bodies"
SHIPPED = pytest.mark.parametrize("name", few(get_args(EmbeddedTriangles), ("small-scape",)))


@SHIPPED
def test_shipped_bodies_have_only_posedirs_of_their_own(name: str) -> None:
    body, (mesh, model) = load_body(name), UNTRAINED[name]
    untrained = model(wb.load_body(mesh))
    for part in ("template", "faces", "shapedirs", "near"):
        np.testing.assert_array_equal(getattr(body, part), getattr(untrained, part))
    for part in ("weights", "J_regressor"):
        assert (getattr(body, part) != getattr(untrained, part)).nnz == 0
    assert body.posedirs.any()
    assert (FOLDER / f"{name}.npz").stat().st_size < 0.3e6


@SHIPPED
def test_posedirs_help_on_people_not_learned_from(name: str) -> None:
    body, (mesh, model) = load_body(name), UNTRAINED[name]
    skinned, rng = wb.load_body(mesh), np.random.default_rng(99)
    poses = draw_poses(shipped_gaussian(), 20, rng)
    betas = rng.standard_normal((20, body.n_betas))
    wanted = skinned.vertices(poses, betas)
    off, before = (
        np.sqrt(((centred(one.vertices(poses, betas)) - centred(wanted)) ** 2).sum(axis=2).mean())
        for one in (body, model(skinned))
    )
    assert off < 0.4 * before
    held_out = body.card["held_out"]
    assert held_out["rms_mm"] < 0.35 * held_out["rms_without_posedirs_mm"]


def centred(surfaces: np.ndarray) -> np.ndarray:
    return surfaces - surfaces.mean(axis=1, keepdims=True)


def test_damaged_shipped_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"there is no file .*nothing\.npz"):
        read_embedded_triangles(tmp_path / "nothing.npz", "small", scape)
    np.savez(tmp_path / "other.npz", near=np.zeros((734, 2), dtype=np.uint8))
    with pytest.raises(BadFile, match="card, posedirs, posedirs_step missing"):
        read_embedded_triangles(tmp_path / "other.npz", "small", scape)


# In the place of SMPL.


@pytest.mark.parametrize(
    "experiment", few(["landmarks", "registration", "body-joints", "body-video"], 1)
)
def test_fits_take_scape_in_the_place_of_smpl(experiment: str) -> None:
    outcome = run(find(experiment, {"body": "small-scape"}), compare=False)
    assert outcome.solution.converged
    assert outcome.solution.cost < outcome.setup.problem.linearize(outcome.setup.start).cost
    assert outcome.diagnosis.rank == outcome.setup.problem.free.size
    if experiment != "body-video":  # in which there are eight bodies, and none is drawn
        assert isinstance(outcome.setup.body, TriangleBody)
        assert outcome.surface is not None


@pytest.mark.parametrize("experiment", few(["self-contact", "markers", "body-points-lbs"], 1))
def test_experiments_of_skinned_bodies_refuse_a_triangle_body(experiment: str) -> None:
    with pytest.raises((BadArgument, BadBody), match="small-scape"):
        find(experiment, {"body": "small-scape"}).setup()
