"""A skinned body against the paper's equations, the laws that it keeps, and what it refuses."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_root_turns_everything_about_pelvis,
    in_symbols,
    said,
    some_arguments,
)
from tests.bodies.paper import smpl
from tests.bodies.random_bodies import entries
from tests.bodies_made_up import random_body, smpl_like_body
from tests.tiers import few
from workbench import Landmarks, SkinnedBody
from workbench.bodies.forward.few_points import JointPoints
from workbench.bodies.forward.kinematics import Skeleton, binding_motions, pose_features
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.skinning import linear_blend
from workbench.errors import BadBody, UnknownName, WorkbenchError
from workbench.geometry.rotation import matrix_from_vector, rodrigues

BODIES = {
    "a few joints": random_body(0),
    "bound in another pose": random_body(1, n_joints=6, bound=True),
    "one joint": random_body(3, n_joints=1),
    "SMPL's tree": smpl_like_body(),
    "no betas": random_body(2, n_betas=0),
    "one vertex": random_body(4, n_vertices=1, n_joints=3),
    "52 joints": random_body(5, n_joints=52, n_betas=16, n_vertices=40),
}
EACH_BODY = pytest.mark.parametrize(
    "body", few([pytest.param(body, id=name) for name, body in BODIES.items()], 5)
)


def assert_as_in_paper(body: SkinnedBody, seed: int = 0) -> None:
    arguments = some_arguments(body, seed)
    vertices, joints = smpl(body, *arguments)
    np.testing.assert_allclose(body.vertices(*arguments), vertices, rtol=0, atol=1e-12)
    np.testing.assert_allclose(body.joints(*arguments), joints, rtol=0, atol=1e-12)


# Against the paper.


@EACH_BODY
def test_vertices_and_joints_are_those_of_the_paper(body: SkinnedBody) -> None:
    assert_as_in_paper(body)


def test_body_of_a_file_is_that_of_the_paper(tmp_path: Path) -> None:
    np.savez(tmp_path / "somebody.npz", **entries(N=40, B=10))
    assert_as_in_paper(wb.load_body(tmp_path / "somebody.npz"))


def test_embedded_body_is_that_of_the_paper() -> None:
    assert_as_in_paper(wb.load_body("small"))


@EACH_BODY
def test_bind_pose_leaves_the_shaped_template(body: SkinnedBody) -> None:
    assert_bind_pose_leaves_template(body)
    betas = some_arguments(body)[1]
    shaped = body.template + body.shapedirs @ betas
    np.testing.assert_allclose(body.vertices(body.bind_pose, betas), shaped, atol=1e-13)
    np.testing.assert_allclose(body.joints(betas=betas), body.J_regressor @ shaped, atol=1e-13)


# Laws.


@EACH_BODY
def test_turning_the_root_turns_everything_about_the_pelvis(body: SkinnedBody) -> None:
    assert_root_turns_everything_about_pelvis(body)


def test_one_hot_weights_keep_lengths_within_a_part() -> None:
    body = random_body(7, n_vertices=40, n_joints=6)
    part = np.arange(40) % 6
    body = replace(body, weights=np.eye(6)[part], posedirs=0 * body.posedirs)
    posed = body.vertices(some_arguments(body)[0])
    for k in range(6):
        before, after = body.template[part == k], posed[part == k]
        lengths = [np.linalg.norm(v[:, None] - v, axis=-1) for v in (before, after)]
        np.testing.assert_allclose(lengths[1], lengths[0], atol=1e-14)


def test_joints_lie_in_the_convex_hull_of_vertices() -> None:
    body = smpl_like_body()
    betas = some_arguments(body)[1]
    hull = ConvexHull(body.vertices(betas=betas))
    outside = body.joints(betas=betas) @ hull.equations[:, :3].T + hull.equations[:, 3]
    assert outside.max() <= 1e-14


def test_joints_follow_a_moved_or_scaled_surface() -> None:
    body = random_body(8)
    pose, betas, _ = some_arguments(body)
    before, shift = body.joints(pose, betas), np.array([1.0, 2.0, 3.0])
    moved = replace(body, template=body.template + shift)
    np.testing.assert_allclose(moved.joints(pose, betas), before + shift, atol=1e-13)
    larger = replace(body, template=2 * body.template, shapedirs=2 * body.shapedirs)
    np.testing.assert_allclose(larger.joints(pose, betas), 2 * before, atol=1e-13)


def test_conjugated_rotations_turn_the_body_in_space() -> None:
    """Turning the template and its directions turns what comes out, all rotations conjugated."""
    body, turn = random_body(9), Rotation.from_rotvec([0.3, 1.0, -0.5])
    pose, betas, trans = some_arguments(body)
    Q = turn.as_matrix()
    pieces = body.posedirs.reshape(30, 3, -1, 3, 3)
    turned = replace(
        body,
        template=body.template @ Q.T,
        shapedirs=np.einsum("ij,njb->nib", Q, body.shapedirs),
        # features become Q (R - I) Q', and the directions must read them so
        posedirs=np.einsum("ij,njkrc,ar,bc->nikab", Q, pieces, Q, Q).reshape(30, 3, -1),
    )
    found = turned.vertices(turn.apply(pose), betas, turn.apply(trans))
    np.testing.assert_allclose(found, turn.apply(body.vertices(pose, betas, trans)), atol=1e-13)


# The chain of joints.

PARENTS = (-1, 0, 0, 1, 3, 2)
JOINTS, POSE, BIND = np.random.default_rng(0).normal(size=(3, 6, 3))


def rotations(vectors: np.ndarray) -> cs.DM:
    return cs.DM(np.hstack(list(matrix_from_vector(vectors))))


def test_posed_joints_are_the_sum_over_the_path() -> None:
    """J'_k = j_0 + sum over c on the path of R_parent(c) (j_c - j_parent(c))."""
    _, posed = binding_motions(rotations(POSE), rotations(0 * POSE), cs.DM(JOINTS.T), PARENTS)
    R = matrix_from_vector(POSE)
    turned = [R[0]]
    for k in range(1, len(PARENTS)):
        turned.append(turned[PARENTS[k]] @ R[k])
    for k in range(len(PARENTS)):
        position, c = JOINTS[0].copy(), k
        while c > 0:
            position += turned[PARENTS[c]] @ (JOINTS[c] - JOINTS[PARENTS[c]])
            c = PARENTS[c]
        np.testing.assert_allclose(np.asarray(posed)[:, k], position, atol=1e-14)


def test_parts_stay_together_at_their_joints() -> None:
    G, posed = binding_motions(rotations(POSE), rotations(BIND), cs.DM(JOINTS.T), PARENTS)
    for k in range(len(PARENTS)):
        for part in (k, max(PARENTS[k], 0)):  # a joint belongs to its parent's part as well
            moved = np.asarray(G[part]) @ (*JOINTS[k], 1)
            np.testing.assert_allclose(moved, np.asarray(posed)[:, k], atol=1e-14)


def test_a_joint_changes_its_own_nine_features() -> None:
    body = random_body(n_joints=6, bound=True)
    R0 = matrix_from_vector(body.bind_pose)
    for k in range(6):
        pose = body.bind_pose.copy()
        pose[k] = [0.3, -0.5, 0.7]
        f = np.asarray(pose_features(rodrigues(cs.DM(pose.T)), rodrigues(cs.DM(body.bind_pose.T))))
        expected = np.zeros((5, 9))  # the root has none
        if k:
            expected[k - 1] = (matrix_from_vector(pose[k]) - R0[k]).ravel()
        np.testing.assert_allclose(f.ravel(), expected.ravel(), atol=1e-15)


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
        joints_at = JointPoints(skeleton, kinematics.ancestors).at(motion, people[i])
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
            (many.derivatives[i].numbers, changes.numbers),
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
    ({"trans": "abc"}, "text"),
    ({"pose": [[0.0], [1.0, 2.0]]}, "different lengths"),
    ({"betas": [1j]}, "complex"),
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


def test_posed_surface_is_a_mesh_of_trimesh() -> None:
    body = smpl_like_body()
    pose, betas, trans = some_arguments(body)
    mesh = body.trimesh(pose, betas, trans)
    np.testing.assert_array_equal(mesh.vertices, body.vertices(pose, betas, trans))
    np.testing.assert_array_equal(mesh.faces, body.faces)
    with pytest.raises(BadBody, match=r"in one pose, not in a batch \(2,\)"):
        body.trimesh(np.zeros((2, 24, 3)))


def test_blocks_are_the_same_objects_each_time() -> None:
    body = smpl_like_body()
    assert body.blocks("scan 3/") is body.blocks("scan 3/")
    names = [b.name for b in body.blocks("scan 3/")]
    assert names == ["scan 3/pose", "scan 3/betas", "scan 3/trans"]
    assert body.blocks()[0].entry(3 * 8 + 2) == "[right_ankle, z]"


# Linearity: SMPL is linear in all but its pose, in each array alone.

N, K, B = 6, 3, 2


def is_linear(*names: str) -> bool:
    """In these symbols together, by the expanded graph: its structure is exact by entries."""
    arrays = [name for name in names if name not in ("pose", "betas", "trans")]
    body = random_body(n_vertices=N, n_joints=K, n_betas=B).freed(*arrays)
    symbols = {b.name: b.symbol for b in (*body.blocks(), *body.free.values())}
    surface = cs.vec(body.points(*(b.symbol for b in body.blocks())).source.expression)
    return linear_in(surface, [symbols[name] for name in names])


def linear_in(expression: cs.MX, symbols: list[cs.MX]) -> bool:
    others = [s for s in cs.symvar(expression) if not any(cs.is_equal(s, t) for t in symbols)]
    f = cs.Function("f", [*symbols, *others], [expression]).expand()
    x = cs.SX.sym("x", sum(s.numel() for s in symbols))
    edges = np.cumsum([0, *(s.numel() for s in symbols)]).tolist()
    pieces = [
        cs.reshape(part, s.shape) for part, s in zip(cs.vertsplit(x, edges), symbols, strict=True)
    ]
    rest = [cs.SX.sym("other", *s.shape) for s in others]
    return bool(cs.is_linear(f(*pieces, *rest), x))


def test_surface_is_linear_in_each_array_but_pose() -> None:
    arrays = ("template", "shapedirs", "posedirs", "weights", "J_regressor", "betas", "trans")
    assert [name for name in arrays if not is_linear(name)] == []
    assert not is_linear("pose")
    assert is_linear("template", "posedirs")
    for product in (("weights", "posedirs"), ("weights", "template"), ("shapedirs", "betas")):
        assert not is_linear(*product), product
    for product in (("J_regressor", "template"), ("weights", "J_regressor")):
        assert not is_linear(*product), product


def test_training_pose_directions_is_one_linear_problem() -> None:
    """Jointly linear in rest template, pose directions and joints, for fixed pose and weights."""
    body = random_body(n_vertices=N, n_joints=K)
    pose = cs.MX.sym("pose", 3, K)
    rest, joints = cs.MX.sym("rest", 3, N), cs.MX.sym("joints", 3, K)
    P, W = cs.MX.sym("P", 3 * N, 9 * (K - 1)), cs.MX.sym("W", N, K)
    R, bind = rodrigues(pose), rodrigues(cs.DM(body.bind_pose.T))
    G, _ = binding_motions(R, bind, joints, body.parents)
    bent = rest + cs.reshape(P @ pose_features(R, bind), 3, N)
    vertices = cs.vec(linear_blend(bent, G, W))
    assert linear_in(vertices, [rest, P, joints])
    assert not linear_in(vertices, [W, P])
    assert not linear_in(vertices, [W, joints])


# Arrays that do not fit together.


def broken(name: str, index: Any, value: Any) -> dict[str, Any]:
    array = getattr(random_body(), name)
    dense = array.toarray() if isinstance(array, csr_array) else array.copy()
    dense[index] = value
    return {name: csr_array(dense) if isinstance(array, csr_array) else dense}


BROKEN = [
    ({"template": np.zeros((30, 2))}, r"template .*\(N, 3\)"),
    ({"template": np.zeros((0, 3))}, "template has no vertices"),
    ({"template": [["a", "b", "c"]] * 30}, "template .*text"),
    ({"shapedirs": np.zeros((29, 3, 2))}, r"shapedirs .*\(30, 3, B\)"),
    ({"shapedirs": np.ones((30, 3, 1), complex)}, "shapedirs .*complex"),
    ({"posedirs": np.zeros((30, 3, 45))}, r"posedirs .*\(30, 3, 36\)"),
    ({"J_regressor": csr_array((4, 30))}, r"J_regressor .*\(5, 30\)"),
    ({"J_regressor": np.ones(30)}, "J_regressor .*two axes"),
    ({"weights": np.ones((30, 4)) / 4}, r"weights .*\(30, 5\)"),
    ({"weights": None}, "weights .*NoneType"),
    ({"faces": np.zeros((4, 4), dtype=int)}, r"faces .*\(F, 3\)"),
    ({"faces": np.ones((2, 3))}, "faces .*whole numbers"),
    ({"joint_names": ("a",)}, "1 names for 5 joints"),
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
    (broken("faces", (6, 0), -1), r"face 6 is \[-1, "),
    ({"parents": (0, 0, 0, 0, 0)}, "joint 0 must be the root"),
    ({"parents": (-1, 0, 3, 0, 0)}, "joint 2 has parent 3"),
    ({"parents": (-1, 0, -1, 0, 0)}, "joint 2 has parent -1"),
    ({"mirror": np.roll(np.arange(30), 1)}, "mirror must swap"),
    ({"mirror": np.arange(31)}, "mirror must swap"),
    ({"bound_in": np.full((5, 3), np.nan)}, "bound_in must be finite"),
    ({"rest_joints": np.zeros((6, 3))}, "rest_joints must be finite"),
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
