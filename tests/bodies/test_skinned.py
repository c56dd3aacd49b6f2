"""A skinned body against the paper's equations, the laws that it keeps, and what it refuses."""

import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_chain_rule_is_graph,
    assert_root_turns_everything_about_pelvis,
    in_symbols,
    said,
    some_arguments,
)
from tests.bodies.paper import smpl
from tests.bodies_made_up import random_body, smpl_like_body
from tests.tiers import few
from workbench import Landmarks, SkinnedBody
from workbench.bodies import skin
from workbench.bodies.files.saving import save_body
from workbench.bodies.forward.few_points import LandmarkPoints
from workbench.bodies.forward.kinematics import Skeleton, binding_motions, pose_features
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.triangles.body import blend_scape
from workbench.errors import BadBody, BadFile, UnknownName, WorkbenchError
from workbench.geometry.rotation import rodrigues

BODIES = {
    "small": wb.load_body("small"),
    "a few joints": random_body(0),
    "bound in another pose": random_body(1, n_joints=6, bound=True),
    "one joint": random_body(3, n_joints=1),
    "SMPL's tree": smpl_like_body(),
    "no betas": random_body(2, n_betas=0),
    "one vertex": random_body(4, n_vertices=1, n_joints=3),
    "52 joints": random_body(5, n_joints=52, n_betas=16, n_vertices=40),
}
EACH_BODY = pytest.mark.parametrize(
    "body", few([pytest.param(body, id=name) for name, body in BODIES.items()], 6)
)


# Against the paper, and the graph.


@EACH_BODY
def test_vertices_and_joints_are_those_of_the_paper(body: SkinnedBody) -> None:
    pose, betas, trans = some_arguments(body)
    vertices, joints = smpl(body, pose, betas, trans)
    np.testing.assert_allclose(body.vertices(pose, betas, trans), vertices, rtol=0, atol=1e-12)
    np.testing.assert_allclose(body.joints(pose, betas, trans), joints, rtol=0, atol=1e-12)
    assert_bind_pose_leaves_template(body)
    assert_root_turns_everything_about_pelvis(body)
    shaped = body.template + body.shapedirs @ betas
    np.testing.assert_allclose(body.vertices(body.bind_pose, betas), shaped, atol=1e-13)
    np.testing.assert_allclose(body.joints(betas=betas), body.J_regressor @ shaped, atol=1e-13)


@pytest.mark.parametrize("bound", [False, True])
def test_motions_and_their_derivatives_are_those_of_the_graph(bound: bool) -> None:
    """At zero, near zero, anywhere, at pi and beyond a full turn, for each pose and for all."""
    body, rng = random_body(0, n_joints=5, n_betas=2), np.random.default_rng(0)
    K, B, bind = 5, 2, bound * 0.4 * rng.standard_normal((5, 3))
    skeleton, axes = Skeleton.of(body), rng.standard_normal((5, K, 3))
    kinematics = Kinematics(skeleton, bind, body.parents)
    pose, betas = cs.SX.sym("pose", 3, K), cs.SX.sym("betas", B)
    R, R_0 = rodrigues(pose), rodrigues(cs.SX(cs.DM(bind.T)))
    motions, joints = binding_motions(R, R_0, skeleton.joints(betas), body.parents)
    outputs = [cs.vertcat(*[cs.vec(G.T) for G in motions]), pose_features(R, R_0), cs.vec(joints)]
    by = [cs.jacobian(part, cs.vec(pose)) for part in outputs] + [cs.jacobian(outputs[0], betas)]
    graph = cs.Function("motion", [pose, betas], [*outputs, *by])
    sizes = np.array([0.0, 1e-9, 0.7, np.pi, 40.0])[:, None, None]
    poses = sizes * axes / np.linalg.norm(axes, axis=2, keepdims=True)
    people = rng.standard_normal((5, B))
    many = kinematics.motion(poses, people)
    for i, motion in enumerate(
        [kinematics.motion(*one) for one in zip(poses, people, strict=True)]
    ):
        G, f, t, dG, df, dt, dG_db = (np.asarray(a) for a in graph(poses[i].T, people[i]))
        on_G, on_f = rng.standard_normal((K, 3, 4)), rng.standard_normal(9 * (K - 1))
        changes = motion.derivatives
        joints_at = LandmarkPoints.of_joints(skeleton, kinematics.ancestors).at(motion, people[i])
        d_features = np.asarray(df).reshape(K - 1, 9, K, 3)
        for found, expected in (
            (motion.G, G),
            (motion.features, f),
            (motion.joints, t),
            (joints_at.derivative(changes, "pose").T, dt),
            (changes.d_features[1:], d_features[np.arange(K - 1), :, np.arange(1, K)]),
            (changes.d_shift.transpose(1, 2, 0), dG_db.reshape(K, 3, 4, B)[:, :, 3]),
            (motion.vjp(on_G, on_f)[0], on_G.ravel() @ dG + on_f @ df),
            (motion.vjp(on_G, on_f)[1], on_G.ravel() @ dG_db),
            (many.numbers[i], motion.numbers),
            (many.derivatives.numbers[i], changes.numbers),
        ):
            np.testing.assert_allclose(found.ravel(), np.ravel(expected), rtol=0, atol=1e-13)


# Batches and arguments.


SHAPES: list[tuple[Any, Any, Any, Any]] = [
    ((), (), (4,), (4,)),
    ((4,), (), (4,), (4,)),
    ((1,), (4,), (), (4,)),
    ((2, 1), (1, 4), (4,), (2, 4)),
    ((2, 4), (2, 1), (), (2, 4)),
    ((0,), (), (1,), (0,)),
    ((), (), (2, 0), (2, 0)),
    ((4,), (2, 1), (2, 4), (2, 4)),
]


def test_batches_broadcast() -> None:
    body, rng = with_landmarks(BODIES["a few joints"]), np.random.default_rng(0)
    for of_pose, of_betas, of_trans, batch in SHAPES:
        pose, betas = rng.normal(size=(*of_pose, 5, 3)), rng.normal(size=(*of_betas, 3))
        trans = rng.normal(size=(*of_trans, 3))
        vertices, joints = body.vertices(pose, betas, trans), body.joints(pose, betas, trans)
        face = body.landmark("face", pose, betas, trans)
        assert (vertices.shape, joints.shape) == ((*batch, 30, 3), (*batch, 5, 3))
        assert face.shape == (*batch, 3, 3)
        for i in np.ndindex(batch):
            one = (
                np.broadcast_to(pose, (*batch, 5, 3))[i],
                np.broadcast_to(betas, (*batch, 3))[i],
                np.broadcast_to(trans, (*batch, 3))[i],
            )
            np.testing.assert_allclose(vertices[i], body.vertices(*one), atol=1e-14)
            np.testing.assert_allclose(joints[i], body.joints(*one), atol=1e-14)
            np.testing.assert_allclose(face[i], body.landmark("face", *one), atol=1e-14)


def test_pose_may_be_flat_and_betas_fewer() -> None:
    body = smpl_like_body()
    theta = np.random.default_rng(0).normal(scale=0.5, size=(2, 72))
    together = body.vertices(theta)
    np.testing.assert_allclose(together, body.vertices(theta.reshape(2, 24, 3)), atol=1e-14)
    np.testing.assert_allclose(body.vertices(theta[1]), together[1], atol=1e-14)
    shaped = body.vertices(betas=[1.0, -2.0])
    np.testing.assert_allclose(shaped, body.vertices(betas=[1.0, -2.0, 0, 0]), atol=1e-15)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"pose": np.zeros((23, 3))}, "24 joints"),
    ({"pose": np.zeros(69)}, "72"),
    ({"betas": np.zeros(5)}, "up to 4 betas"),
    ({"trans": np.zeros(2)}, "trans"),
    ({"pose": [[0.0], [1.0, 2.0]]}, "different lengths"),
    ({"pose": np.zeros((4, 24, 3)), "trans": np.zeros((3, 3))}, "do not fit each other"),
]


def test_wrong_arguments_are_refused() -> None:
    for arguments, words in WRONG:
        found = said(WorkbenchError, smpl_like_body().vertices, **arguments)
        assert re.search(words, found), found


# Symbols and numbers.


def with_landmarks(body: SkinnedBody) -> SkinnedBody:
    regressor = np.zeros((3, body.n_vertices))
    regressor[0, 3], regressor[1, [0, 7]], regressor[2, [1, 3, 9]] = 1, (0.25, 0.75), 1 / 3
    return replace(
        body, landmarks={"face": Landmarks(("nose", "eye", "ear"), csr_array(regressor))}
    )


@pytest.mark.parametrize(
    "free", [(), ("template", "shapedirs", "posedirs", "J_regressor", "weights")]
)
def test_symbols_and_numbers_agree(free: tuple[str, ...]) -> None:
    body = with_landmarks(random_body(1, n_joints=6, bound=True)).freed(*free)
    arguments = some_arguments(body)
    values = {b.name: v for b, v in zip(body.blocks(), arguments, strict=True)}
    values |= {block.name: body.array(name) for name, block in body.free.items()}
    symbols = [block.symbol for block in body.blocks()]
    vertices, joints = smpl(body, *arguments)
    face = body.landmarks["face"].regressor @ vertices
    for points, numbers, expected in (
        (body.points(*symbols), body.vertices(*arguments), vertices),
        (body.joint_points(*symbols), body.joints(*arguments), joints),
        (body.landmark_points("face", *symbols), body.landmark("face", *arguments), face),
    ):
        np.testing.assert_allclose(in_symbols(points, values), expected, atol=1e-12)
        np.testing.assert_allclose(numbers, expected, atol=1e-12)
    some = in_symbols(body.points(*symbols, vertices=[5, 0, 17]), values)
    np.testing.assert_allclose(some, vertices[[5, 0, 17]], atol=1e-12)
    names = {block.name for block in body.points(*symbols).source.blocks}
    assert names == {"pose", "betas", "trans", *free}


def test_landmark_sets_have_names_and_joints_are_one() -> None:
    body = with_landmarks(random_body())
    pose = some_arguments(body)[0]
    np.testing.assert_array_equal(body.landmark("joints", pose), body.joints(pose))
    assert body.landmark_names("face") == ("nose", "eye", "ear")
    with pytest.raises(UnknownName, match="'fase'; there are face, joints"):
        body.landmark("fase")


# Linearity: SMPL is linear in all but its pose, in each array alone.


def is_linear(*names: str) -> bool:
    """In these symbols together, by the expanded graph: its structure is exact by entries."""
    arrays = [name for name in names if name not in ("pose", "betas", "trans")]
    body = random_body(n_vertices=6, n_joints=3, n_betas=2).freed(*arrays)
    blocks = [*body.blocks(), *body.free.values()]
    surface = cs.vec(body.points(*(b.symbol for b in body.blocks())).source.expression)
    inputs = [cs.SX.sym(b.name, *b.symbol.shape) for b in blocks]
    expanded = cs.Function("f", [b.symbol for b in blocks], [surface]).expand()(*inputs)
    chosen = [cs.vec(x) for b, x in zip(blocks, inputs, strict=True) if b.name in names]
    return bool(cs.is_linear(expanded, cs.vertcat(*chosen)))


def test_surface_is_linear_in_each_array_but_pose() -> None:
    arrays = ("template", "shapedirs", "posedirs", "weights", "J_regressor", "betas", "trans")
    assert [name for name in arrays if not is_linear(name)] == []
    assert not is_linear("pose")
    assert is_linear("template", "posedirs")
    for product in (("weights", "posedirs"), ("weights", "template"), ("shapedirs", "betas")):
        assert not is_linear(*product), product
    for product in (("J_regressor", "template"), ("weights", "J_regressor")):
        assert not is_linear(*product), product


# Arrays that do not fit together.


def broken(name: str, index: Any, value: Any) -> dict[str, Any]:
    array = getattr(random_body(), name)
    dense = array.toarray() if isinstance(array, csr_array) else array.copy()
    dense[index] = value
    return {name: csr_array(dense) if isinstance(array, csr_array) else dense}


BROKEN = [
    ({"template": np.zeros((30, 2))}, r"template .*\(N, 3\)"),
    ({"template": np.zeros((0, 3))}, "template has no vertices"),
    ({"shapedirs": np.zeros((29, 3, 2))}, r"shapedirs .*\(30, 3, B\)"),
    ({"posedirs": np.zeros((30, 3, 45))}, r"posedirs .*\(30, 3, 36\)"),
    ({"J_regressor": csr_array((4, 30))}, r"J_regressor .*\(5, 30\)"),
    ({"weights": np.ones((30, 4)) / 4}, r"weights .*\(30, 5\)"),
    ({"faces": np.zeros((4, 4), dtype=int)}, r"faces .*\(F, 3\)"),
    ({"faces": np.ones((2, 3))}, "faces .*whole numbers"),
    (broken("template", (4, 1), np.nan), r"template\[4, 1\] is not finite"),
    *(
        (broken(name, (7, 1), -1e10), rf"{name} of vertex 7 has an entry of 1e\+10 m.*body check")
        for name in ("template", "shapedirs", "posedirs")
    ),
    (broken("J_regressor", (2, 2), np.nan), "J_regressor .*not finite"),
    (broken("weights", 7, 0.0), "weights of vertex 7 sum to 0"),
    (broken("weights", 7, (2, -1, 0, 0, 0)), r"weights\[7, 1\] is negative"),
    (broken("J_regressor", 3, 0.0), "J_regressor of joint 3 sum to 0"),
    (broken("faces", (5, 1), 30), r"face 5 is \[.*30"),
    ({"parents": (0, 0, 0, 0, 0)}, "joint 0 must be the root"),
    ({"parents": (-1, 0, 3, 0, 0)}, "joint 2 has parent 3"),
    ({"mirror": np.roll(np.arange(30), 1)}, "mirror must swap"),
    ({"bound_in": np.full((5, 3), np.nan)}, "bound_in must be finite"),
    ({"rest_joints": np.full((5, 3), 1800.0)}, "within 1,000 m, not .* up to 1.8e"),
    ({"landmarks": {"face": Landmarks(("nose",), csr_array((2, 30)))}}, "'face'"),
    (
        {"landmarks": {"face": Landmarks(("nose",), 2 * np.eye(1, 30))}},
        "weights in landmarks 'face' of point 0 sum to 2, but must sum to 1",
    ),
]


def test_broken_arrays_are_named() -> None:
    for wrong, words in BROKEN:
        found = said(BadBody, replace, random_body(), **wrong)
        assert re.search(f"body 'made-up': .*{words}", found), found


BODY = random_body(5, n_vertices=20, n_joints=4, n_betas=2)
THETA, BETAS, PLACES = (np.random.default_rng(0).normal(size=s) for s in ((4, 3), 2, (4, 3)))
AT_REST = (
    BODY.template
    + BODY.shapedirs @ BETAS
    + BODY.posedirs @ BODY.kinematics.motion(THETA, BETAS).features
)
REGRESSED = BODY.J_regressor @ (BODY.template + BODY.shapedirs @ BETAS)
NUMBERS = AT_REST.T, REGRESSED.T, BODY.weights, THETA.T
GIVEN = replace(BODY, rest_joints=PLACES, name="given")
SYMBOLS = [block.symbol for block in BODY.blocks()]


def four(kind: Any) -> tuple[Any, ...]:
    shapes = {"T": (3, 20), "J": (3, 4), "weights": (20, 4), "theta": (3, 4)}
    return tuple(kind.sym(name, *shape) for name, shape in shapes.items())


@pytest.mark.parametrize("kind", [cs.MX, cs.SX])
def test_skinning_function_gives_the_vertices_of_a_body(kind: Any) -> None:
    expected, symbols = BODY.vertices(THETA, BETAS), four(kind)
    W = cs.Function("W", list(symbols), [skin(*symbols, BODY.parents)])
    np.testing.assert_allclose(np.asarray(W(*NUMBERS)).T, expected, atol=1e-12)


# Joints that are free, or given.


def problem_of(body: wb.SkinnedBody, *free: str) -> wb.Problem:
    points, joints = body.points(*SYMBOLS), body.joint_points(*SYMBOLS)
    terms = [
        wb.residuals.vertices(points, np.zeros((20, 3)), sigma=1.0),
        wb.residuals.landmarks(joints, np.zeros((4, 3)), sigma=1.0),
    ]
    return wb.Problem(terms, free)


def test_free_joints_take_the_place_of_the_regressor() -> None:
    problem = problem_of(BODY.freed("joints"), "joints", "pose")
    values = {"pose": THETA, "betas": BETAS, "trans": np.zeros(3), "joints": PLACES}
    assert problem.free.unit(0) == "m"
    found = problem.linearize(values).residual.reshape(-1, 3)
    np.testing.assert_allclose(found[:20], GIVEN.vertices(THETA, BETAS), atol=1e-12)
    np.testing.assert_allclose(found[20:], GIVEN.joints(THETA), atol=1e-12)
    start = BODY.freed("joints").start()["joints"]
    np.testing.assert_allclose(start, BODY.J_regressor @ BODY.template, atol=1e-15)


def test_given_joints_do_not_follow_the_shape() -> None:
    np.testing.assert_array_equal(GIVEN.joints(betas=BETAS), GIVEN.joints())
    np.testing.assert_allclose(GIVEN.joints(), PLACES, atol=1e-15)
    np.testing.assert_allclose(GIVEN.vertices(), GIVEN.template, atol=1e-14)
    problem = problem_of(GIVEN, "pose", "betas", "trans")
    values = {"pose": THETA, "betas": BETAS, "trans": PLACES[0]}
    assert_chain_rule_is_graph(problem, values)
    J = problem.linearize(values).jacobian
    assert not J[3 * 20 :, problem.free.slices["betas"]].any()


def test_given_joints_are_kept_where_they_can_be(tmp_path: Path) -> None:
    save_body(GIVEN, tmp_path / "given.npz")
    for back in (pickle.loads(pickle.dumps(GIVEN)), wb.load_body(tmp_path / "given.npz")):
        np.testing.assert_array_equal(back.rest_joints, PLACES)
        np.testing.assert_array_equal(back.vertices(THETA, BETAS), GIVEN.vertices(THETA, BETAS))
    with pytest.raises(BadFile, match="joints at rest"):
        save_body(GIVEN, tmp_path / "given.pkl")
    with pytest.raises(BadBody, match="is given its joints"):
        blend_scape(GIVEN)
