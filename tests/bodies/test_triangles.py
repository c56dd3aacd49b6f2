"""SCAPE and BlendSCAPE: against their formula face by face, and the laws of every body."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, get_args

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_chain_rule_is_graph,
    assert_root_turns_everything_about_pelvis,
    some_arguments,
)
from tests.bodies.random_bodies import same
from tests.bodies_made_up import tube_body
from tests.tiers import few
from workbench.bodies.body import Body
from workbench.bodies.catalogue import (
    UNTRAINED,
    EmbeddedTriangles,
    load_body,
    load_skinned,
)
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadBody, BadFile
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.triangles import edges


def bent(body: TriangleBody, seed: int = 0) -> TriangleBody:
    """The same with random posedirs."""
    posedirs = np.random.default_rng(seed).normal(scale=0.1, size=body.posedirs.shape)
    return replace(body, posedirs=posedirs)


def with_nose(body: TriangleBody) -> TriangleBody:
    nose = wb.Landmarks(("nose", "chin"), csr_array(np.eye(2, body.n_vertices)))
    return replace(body, landmarks={"face": nose})


MADE = {
    "SCAPE": lambda: with_nose(bent(scape(tube_body()))),
    "BlendSCAPE": lambda: with_nose(bent(blend_scape(tube_body()))),
    "no betas": lambda: with_nose(bent(scape(tube_body(n_betas=0)))),
    "no twists": lambda: with_nose(blend_scape(tube_body(), n_near=0)),
    "small SCAPE": lambda: bent(scape(wb.load_body("small"))),
    "small BlendSCAPE": lambda: bent(blend_scape(wb.load_body("small"))),
}
EACH = pytest.mark.parametrize("name", few(MADE, ("SCAPE", "BlendSCAPE")))
EACH_TUBE = pytest.mark.parametrize("name", few([n for n in MADE if "small" not in n], 1))
SKINNED = pytest.mark.parametrize("name", few(["tube", "small"], 1))


@cache
def made(name: str) -> TriangleBody:
    return MADE[name]()


def skinned(name: str) -> wb.SkinnedBody:
    body = tube_body() if name == "tube" else wb.load_body(name)
    assert isinstance(body, wb.SkinnedBody)
    return body


def world_rotations(body: TriangleBody, pose: np.ndarray) -> list[np.ndarray]:
    found: list[np.ndarray] = []
    for w, parent in zip(pose, body.parents, strict=True):
        R = matrix_from_vector(w)
        found.append(R if parent < 0 else found[parent] @ R)
    return found


# Against the formula.


@EACH
def test_triangles_deform_by_the_formula(name: str) -> None:
    """And vertices are stitched from their edges by least squares, the pelvis at its place."""
    body = made(name)
    pose, betas, trans = some_arguments(body)
    R, W = world_rotations(body, pose), body.weights.toarray()
    X = body.deformations(pose, betas)
    for f in range(0, body.n_faces, 7):
        B = sum(W[f, k] * R[k] for k in range(body.n_joints))
        twists = np.concatenate([np.zeros(0), *(pose[k] for k in body.near[f])])
        D = np.eye(3) + body.shapedirs[f] @ betas
        Q = np.eye(3) + body.posedirs[f] @ twists
        np.testing.assert_allclose(X[f], B @ D @ Q, atol=1e-13)
    e = edges(body.template, body.faces)
    wanted = np.einsum("fab,fib->fia", X, e).reshape(-1, 3)
    V = np.linalg.lstsq(body.stitching.A.toarray(), wanted)[0]
    root = body.J_regressor[[0]]
    V = V - root @ V + root @ body.template + trans
    np.testing.assert_allclose(body.vertices(pose, betas, trans), V, atol=1e-12)


@EACH
def test_triangle_bodies_keep_the_laws_of_bodies(name: str) -> None:
    assert_bind_pose_leaves_template(made(name))
    assert_root_turns_everything_about_pelvis(made(name))
    pose, betas, _ = some_arguments(made(name))
    pelvis = made(name).joints()[0]  # where it is, whatever the pose and the shape
    np.testing.assert_allclose(made(name).joints(pose, betas)[0], pelvis, atol=1e-12)


@SKINNED
def test_unposed_people_are_those_of_the_skinned_body(name: str) -> None:
    of = skinned(name)
    betas = some_arguments(of)[1]
    expected = of.vertices(betas=betas)
    expected += of.joints()[0] - of.joints(betas=betas)[0]  # the pelvis stays
    for body in (scape(of), blend_scape(of)):
        np.testing.assert_allclose(body.vertices(betas=betas), expected, atol=1e-12)


# Derivatives, and the two ways to the same numbers.


def symbols(body: Body) -> tuple[cs.MX, cs.MX, cs.MX]:
    pose, betas, trans = (block.symbol for block in body.blocks())
    return pose, betas, trans


def read_by(body: Body) -> list[str]:
    return [block.name for block in body.blocks() if block.size]


@cache
def whole_problem(name: str) -> wb.Problem:
    body = made(name)
    rng, at = np.random.default_rng(1), symbols(body)
    return wb.Problem(
        [
            wb.residuals.vertices(
                body.points(*at), rng.normal(size=(body.n_vertices, 3)), sigma=2.0
            ),
            wb.residuals.vertices(
                body.points(*at, vertices=[4, 2]), rng.normal(size=(2, 3)), sigma=2.0, name="some"
            ),
            wb.residuals.landmarks(
                body.joint_points(*at), rng.normal(size=(body.n_joints, 3)), sigma=2.0
            ),
        ],
        read_by(body),
    )


PLACES = {"at zero": 0.0, "near zero": 1e-9, "somewhere": 1.0, "at pi": np.pi}


def place(body: TriangleBody, size: float) -> np.ndarray:
    pose, betas, trans = some_arguments(body, 3)
    pose /= np.linalg.norm(pose, axis=1, keepdims=True)
    return np.concatenate([size * pose.ravel(), np.sign(size) * betas, trans])


@pytest.mark.parametrize("name", few(["BlendSCAPE", *MADE], 1))
def test_arithmetic_and_graph_agree(name: str) -> None:
    problem = whole_problem(name)
    assert all(p.source.numeric is not None for r in problem.residuals for p in r.points)
    for size in PLACES.values():
        values = problem.free.unpack(place(made(name), size))
        assert_chain_rule_is_graph(problem, values)


# Points.


@EACH_TUBE
@pytest.mark.parametrize("count", few([37, 0, 1, 16], 1))
def test_batches_are_the_poses_one_by_one(name: str, count: int) -> None:
    """In pieces of 16, of which the last is not whole; twists of more than a turn among them."""
    body, rng = made(name), np.random.default_rng(count)
    pose = rng.normal(size=(count, body.n_joints, 3)) * rng.choice([0.0, 0.3, 4.0], (count, 1, 1))
    betas, trans = rng.normal(size=(count, body.n_betas)), rng.normal(size=(count, 3))
    found = body.vertices(pose, betas, trans)
    assert found.shape == (count, body.n_vertices, 3)
    assert body.joints(pose[None], betas[None], trans[None]).shape == (1, count, body.n_joints, 3)
    for i in range(count):
        alone = body.vertices(pose[i], betas[i], trans[i])
        # sums of the same hundreds of products in another order, through a mesh's stiffness
        np.testing.assert_allclose(found[i], alone, rtol=0, atol=1e-11 * (1 + abs(alone).max()))


def test_arrays_that_do_not_fit_are_refused() -> None:
    for wrong, text in (
        ({"shapedirs": np.zeros((40, 3, 2))}, "shapedirs has shape"),
        ({"near": np.zeros((40, 2), dtype=int)}, "face 0 is near the joints"),
        ({"weights": np.ones((40, 3))}, "weights of face 0 sum to 3"),
        ({"template": np.full((22, 3), np.nan)}, "not finite"),
        ({"template": np.ones((22, 3))}, "has no area"),
        ({"template": np.full((22, 3), 1e10)}, "template of vertex 0 has an entry of 1e.10 m"),
        ({"faces": np.full((40, 3), 22)}, "there are 22 vertices"),
        ({"parents": (-1, 2, 1)}, "joint 1 has parent 2"),
    ):
        with pytest.raises(BadBody, match=text):
            replace(made("SCAPE"), **wrong)


# Fitting and diagnosis.


EXTRAS = {"joint_limits": np.arange(6.0).reshape(3, 2), "gender": np.array("neutral")}
CARD = {"source": "made up", "numbers": [1, 0.1, None], "nested": {"é": "ü"}}


def whole(body: TriangleBody) -> TriangleBody:
    """The body with everything that its file can hold."""
    return replace(body, name="somebody", card=CARD, extras=EXTRAS)


@pytest.mark.parametrize("name", few(MADE, ("SCAPE", "BlendSCAPE", "no betas", "no twists")))
def test_saved_body_comes_back(name: str, tmp_path: Path) -> None:
    given = whole(made(name))
    wb.save_body(given, tmp_path / "body.npz")
    found = wb.load_body(tmp_path / "body.npz")
    same(given, found)
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
    (put(near=np.zeros((40, 3), int)), BadBody, "posedirs has shape"),
    (put(f=np.zeros((40, 4), int)), BadBody, "faces has shape"),
    (put(f=np.full((40, 3), 99)), BadBody, "there are 22"),
    (put(shapedirs=np.full((40, 3, 3, 2), np.inf)), BadBody, "not finite"),
    (put(v_template=1e200 * np.eye(22, 3)), BadBody, "beyond 1,000 m"),
    (put(weights__indices=np.full(40, 99)), BadFile, "weights is no sparse matrix"),
    (put(weights__data=np.full(40, 2.0)), BadBody, "sum to 2"),
    (put(J_regressor__shape=np.array([3, 2**40])), BadBody, "J_regressor has shape"),
    (put(kintree_table=np.array([[9, 2, 1], [0, 1, 2]])), BadBody, "joint 1 has parent 2"),
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
