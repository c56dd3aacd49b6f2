"""A skinned body against the paper's equations, and the laws that it must keep."""

from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from tests.bodies.paper import smpl
from tests.bodies_made_up import random_body, smpl_like_body
from workbench import Landmarks, Points, SkinnedBody
from workbench.errors import BadBody, NotNumbers, UnknownName
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

BODIES = {
    "a few joints": random_body(0),
    "bound in another pose": random_body(1, n_joints=6, bound=True),
    "no betas": random_body(2, n_betas=0),
    "one joint": random_body(3, n_joints=1),
    "one vertex": random_body(4, n_vertices=1, n_joints=3),
    "SMPL's tree": smpl_like_body(),
    "52 joints": random_body(5, n_joints=52, n_betas=16, n_vertices=40),
}
EACH_BODY = pytest.mark.parametrize("body", BODIES.values(), ids=list(BODIES))


def some_arguments(body: SkinnedBody, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return (
        rng.normal(scale=0.7, size=(body.n_joints, 3)),
        rng.normal(size=body.n_betas),
        rng.normal(size=3),
    )


# Against the paper.


@EACH_BODY
@pytest.mark.parametrize("seed", range(2))
def test_vertices_and_joints_are_those_of_the_paper(body: SkinnedBody, seed: int) -> None:
    arguments = some_arguments(body, seed)
    vertices, joints = smpl(body, *arguments)
    np.testing.assert_allclose(body.vertices(*arguments), vertices, rtol=0, atol=1e-12)
    np.testing.assert_allclose(body.joints(*arguments), joints, rtol=0, atol=1e-12)


@EACH_BODY
def test_the_bind_pose_leaves_the_template_alone(body: SkinnedBody) -> None:
    np.testing.assert_allclose(body.vertices(), body.template, atol=1e-14)
    np.testing.assert_allclose(body.vertices(body.bind_pose), body.template, atol=1e-14)
    np.testing.assert_allclose(body.joints(), body.J_regressor @ body.template, atol=1e-14)
    betas = some_arguments(body)[1]
    shaped = body.template + body.shapedirs @ betas
    np.testing.assert_allclose(body.vertices(betas=betas), shaped, atol=1e-13)
    np.testing.assert_allclose(body.joints(betas=betas), body.J_regressor @ shaped, atol=1e-13)


# Laws.


@EACH_BODY
def test_turning_the_root_turns_everything_about_the_pelvis(body: SkinnedBody) -> None:
    pose, betas, trans = some_arguments(body)
    before, turn = body.vertices(pose, betas), matrix_from_vector([0.5, -1.0, 2.0])
    pelvis = body.joints(pose, betas)[0]
    turned = pose.copy()
    turned[0] = vector_from_matrix(turn @ matrix_from_vector(pose[0]))
    expected = (before - pelvis) @ turn.T + pelvis + trans
    np.testing.assert_allclose(body.vertices(turned, betas, trans), expected, atol=1e-13)
    joints = (body.joints(pose, betas) - pelvis) @ turn.T + pelvis + trans
    np.testing.assert_allclose(body.joints(turned, betas, trans), joints, atol=1e-13)


def test_one_hot_weights_keep_the_lengths_within_a_part() -> None:
    body = random_body(7, n_vertices=40, n_joints=6)
    part = np.arange(40) % 6
    body = replace(body, weights=np.eye(6)[part], posedirs=0 * body.posedirs)
    posed = body.vertices(some_arguments(body)[0])
    for k in range(6):
        before, after = body.template[part == k], posed[part == k]
        lengths = [np.linalg.norm(v[:, None] - v, axis=-1) for v in (before, after)]
        np.testing.assert_allclose(lengths[1], lengths[0], atol=1e-14)


def test_joints_lie_in_the_convex_hull_of_the_vertices() -> None:
    body = smpl_like_body()
    betas = some_arguments(body)[1]
    hull = ConvexHull(body.vertices(betas=betas))
    outside = body.joints(betas=betas) @ hull.equations[:, :3].T + hull.equations[:, 3]
    assert outside.max() <= 1e-14


def test_joints_follow_the_surface_when_it_is_moved_or_scaled() -> None:
    body = random_body(8)
    pose, betas, _ = some_arguments(body)
    shift = np.array([1.0, 2.0, 3.0])
    moved = replace(body, template=body.template + shift)
    np.testing.assert_allclose(
        moved.joints(pose, betas), body.joints(pose, betas) + shift, atol=1e-13
    )
    larger = replace(body, template=2 * body.template, shapedirs=2 * body.shapedirs)
    np.testing.assert_allclose(larger.joints(pose, betas), 2 * body.joints(pose, betas), atol=1e-13)


def test_posed_joints_are_the_chains_and_not_the_regressors() -> None:
    body = smpl_like_body()
    pose, betas, trans = some_arguments(body)
    gap = body.joints(pose, betas, trans) - body.J_regressor @ body.vertices(pose, betas, trans)
    assert np.linalg.norm(gap, axis=1).max() > 1e-3
    # the gap is gone where the skin around a joint is rigid
    K = body.n_joints
    rigid = replace(
        body,
        template=np.vstack([body.template, body.template]),
        shapedirs=np.zeros((2 * body.n_vertices, 3, 0)),
        posedirs=np.zeros((2 * body.n_vertices, 3, 9 * (K - 1))),
        weights=np.eye(K)[np.arange(2 * body.n_vertices) % K],
        J_regressor=csr_array(np.eye(K, 2 * body.n_vertices)),  # vertex k is joint k's
        mirror=None,
    )
    np.testing.assert_allclose(
        rigid.joints(pose), rigid.J_regressor @ rigid.vertices(pose), atol=1e-13
    )


# Batches.

BATCHES = [(), (1,), (4,), (2, 1), (1, 4), (2, 4), (0,)]


@pytest.mark.parametrize("of_pose", BATCHES)
@pytest.mark.parametrize("of_betas", BATCHES)
@pytest.mark.parametrize("of_trans", [(), (4,), (2, 1), (0,)])
def test_batches_broadcast(of_pose: Any, of_betas: Any, of_trans: Any) -> None:
    try:
        batch = np.broadcast_shapes(of_pose, of_betas, of_trans)
    except ValueError:
        batch = None
    body, rng = BODIES["a few joints"], np.random.default_rng(0)
    pose = rng.normal(size=(*of_pose, 5, 3))
    betas = rng.normal(size=(*of_betas, 3))
    trans = rng.normal(size=(*of_trans, 3))
    if batch is None:
        with pytest.raises(BadBody, match="do not fit each other"):
            body.vertices(pose, betas, trans)
        return
    vertices, joints = body.vertices(pose, betas, trans), body.joints(pose, betas, trans)
    assert vertices.shape == (*batch, 30, 3)
    assert joints.shape == (*batch, 5, 3)
    for i in np.ndindex(batch):
        one = (
            np.broadcast_to(pose, (*batch, 5, 3))[i],
            np.broadcast_to(betas, (*batch, 3))[i],
            np.broadcast_to(trans, (*batch, 3))[i],
        )
        np.testing.assert_allclose(vertices[i], body.vertices(*one), atol=1e-14)
        np.testing.assert_allclose(joints[i], body.joints(*one), atol=1e-14)


@pytest.mark.parametrize("name", ["no betas", "one joint", "SMPL's tree"])
def test_batches_of_odd_bodies(name: str) -> None:
    body = BODIES[name]
    pose, betas, trans = some_arguments(body)
    vertices = body.vertices(np.stack([pose, 0 * pose]), betas, trans)
    np.testing.assert_allclose(vertices[0], body.vertices(pose, betas, trans), atol=1e-14)
    np.testing.assert_allclose(vertices[1], body.vertices(None, betas, trans), atol=1e-14)


def test_the_pose_may_be_flat_as_in_smpl_files() -> None:
    body = smpl_like_body()
    theta = np.random.default_rng(0).normal(scale=0.5, size=(2, 72))
    together = body.vertices(theta)
    np.testing.assert_allclose(together, body.vertices(theta.reshape(2, 24, 3)), atol=1e-14)
    np.testing.assert_allclose(body.vertices(theta[1]), together[1], atol=1e-14)


def test_betas_may_be_fewer() -> None:
    body = smpl_like_body()
    np.testing.assert_allclose(
        body.vertices(betas=[1.0, -2.0]), body.vertices(betas=[1.0, -2.0, 0, 0]), atol=1e-15
    )


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"pose": np.zeros((23, 3))}, r"24 joints and takes a pose of shape \(\.\.\., 24, 3\)"),
        ({"pose": np.zeros(69)}, r"or \(\.\.\., 72\), not \(69,\)"),
        ({"betas": np.zeros(5)}, r"takes up to 4 betas, not an array \(5,\)"),
        ({"betas": 1.0}, r"takes up to 4 betas, not an array \(\)"),
        ({"trans": np.zeros(2)}, r"a trans of shape \(\.\.\., 3\), not \(2,\)"),
        ({"trans": "abc"}, "trans must be an array of real numbers, not text"),
        ({"pose": [[0.0], [1.0, 2.0]]}, "pose must .*, not rows of different lengths"),
        ({"betas": [1j]}, "betas must .*, not complex numbers"),
    ],
)
def test_wrong_arguments_are_explained(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises((BadBody, NotNumbers), match=text):
        smpl_like_body().vertices(**arguments)


# Symbols and numbers agree.


def evaluated(points: Points, body: SkinnedBody, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    """The source's expression with these arguments, and the body's free arrays as they are."""
    values = {b.name: v for b, v in zip(body.blocks(), arguments, strict=True)}
    values |= {block.name: body.array(name) for name, block in body.free.items()}
    blocks = points.source.blocks
    numbers = [values[b.name].reshape(b.symbol_shape[::-1]).T for b in blocks]
    f = cs.Function("f", [b.symbol for b in blocks], [points.source.expression])
    return np.asarray(f(*numbers)).T


def with_landmarks(body: SkinnedBody) -> SkinnedBody:
    regressor = np.zeros((3, body.n_vertices))
    regressor[0, 3], regressor[1, [0, 7]], regressor[2, [1, 3, 9]] = 1, (0.25, 0.75), 1 / 3
    return replace(
        body, landmarks={"face": Landmarks(("nose", "eye", "ear"), csr_array(regressor))}
    )


@pytest.mark.parametrize(
    "free",
    [
        (),
        ("template",),
        ("shapedirs",),
        ("posedirs",),
        ("J_regressor",),
        ("weights",),
        ("template", "shapedirs", "posedirs", "J_regressor", "weights"),
    ],
    ids=lambda names: "+".join(names) or "none free",
)
def test_symbols_and_numbers_agree(free: tuple[str, ...]) -> None:
    body = with_landmarks(random_body(1, n_joints=6, bound=True)).freed(*free)
    arguments = some_arguments(body)
    symbols = [block.symbol for block in body.blocks()]
    vertices, joints = smpl(body, *arguments)
    for found in (body.vertices(*arguments), evaluated(body.points(*symbols), body, arguments)):
        np.testing.assert_allclose(found, vertices, atol=1e-12)
    for found in (body.joints(*arguments), evaluated(body.joint_points(*symbols), body, arguments)):
        np.testing.assert_allclose(found, joints, atol=1e-12)
    some = evaluated(body.points(*symbols, vertices=[5, 0, 17]), body, arguments)
    np.testing.assert_allclose(some, vertices[[5, 0, 17]], atol=1e-12)
    face = body.landmarks["face"].regressor @ vertices
    landmarks = body.landmark_points("face", *symbols)
    np.testing.assert_allclose(evaluated(landmarks, body, arguments), face, atol=1e-12)
    np.testing.assert_allclose(body.landmark("face", *arguments), face, atol=1e-12)
    names = {block.name for block in body.points(*symbols).source.blocks}
    assert names == {"pose", "betas", "trans", *free}


def test_free_arrays_are_blocks_with_their_files_shapes() -> None:
    body = random_body().freed("J_regressor", "template", prefix="new ")
    shapes = {block.name: block.shape for block in body.free.values()}
    assert shapes == {"new J_regressor": (5, 30), "new template": (30, 3)}
    assert body.freed("weights").free.keys() == {"J_regressor", "template", "weights"}
    start = body.start()
    np.testing.assert_array_equal(start["new J_regressor"], body.J_regressor.toarray())
    with pytest.raises(UnknownName, match="no array to free is called 'faces'; there are J_reg"):
        body.freed("faces")


def test_landmarks_come_in_batches_and_joints_are_always_there() -> None:
    body = with_landmarks(random_body())
    pose = np.random.default_rng(0).normal(size=(2, 4, 5, 3))
    face = body.landmark("face", pose)
    assert face.shape == (2, 4, 3, 3)
    np.testing.assert_allclose(face[1, 2], body.landmark("face", pose[1, 2]), atol=1e-15)
    np.testing.assert_array_equal(body.landmark("joints", pose), body.joints(pose))
    assert body.landmark_names("face") == ("nose", "eye", "ear")
    with pytest.raises(UnknownName, match="no landmark set is called 'fase'; there are face, j"):
        body.landmark("fase")


def test_an_empty_batch_has_no_points() -> None:
    body = with_landmarks(random_body())
    for batch in ((0,), (2, 0), (0, 3)):
        pose = np.zeros((*batch, 5, 3))
        assert body.landmark("face", pose).shape == (*batch, 3, 3)
        assert body.landmark("joints", pose).shape == (*batch, 5, 3)
        assert body.joints(pose).shape == (*batch, 5, 3)
        assert body.vertices(pose).shape == (*batch, 30, 3)


def test_blocks_are_the_same_objects_each_time() -> None:
    body = smpl_like_body()
    assert body.blocks() is body.blocks()
    assert body.blocks("scan 3/") is body.blocks("scan 3/")
    assert [b.name for b in body.blocks("scan 3/")] == [
        "scan 3/pose",
        "scan 3/betas",
        "scan 3/trans",
    ]
    assert body.blocks()[0].entry(3 * 8 + 2) == "[right_ankle, z]"


def test_rigid_motion_of_the_body_is_one_of_space() -> None:
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


# Arrays that do not fit together.


def broken(name: str, index: Any, value: Any) -> dict[str, Any]:
    array = getattr(random_body(), name)
    dense = array.toarray() if isinstance(array, csr_array) else array.copy()
    dense[index] = value
    return {name: csr_array(dense) if isinstance(array, csr_array) else dense}


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"template": np.zeros((30, 2))}, r"template has shape \(30, 2\), but must be \(N, 3\)"),
        ({"shapedirs": np.zeros((29, 3, 2))}, r"shapedirs has shape .* must be \(30, 3, B\)"),
        ({"shapedirs": np.zeros((30, 3))}, r"shapedirs has shape \(30, 3\), but must be"),
        ({"posedirs": np.zeros((30, 3, 45))}, r"posedirs has shape .* must be \(30, 3, 36\)"),
        ({"J_regressor": csr_array((4, 30))}, r"J_regressor has shape .* must be \(5, 30\)"),
        ({"weights": np.ones((30, 4)) / 4}, r"weights has shape .* must be \(30, 5\)"),
        ({"faces": np.zeros((4, 4), dtype=int)}, r"faces has shape .* must be \(F, 3\)"),
        ({"joint_names": ("a",)}, "joint_names has 1 names for 5 joints"),
        (broken("template", (4, 1), np.nan), r"template\[4, 1\] is not finite \(1 such"),
        (broken("shapedirs", (4, 1, 2), np.inf), r"shapedirs\[4, 1, 2\] is not finite"),
        (broken("posedirs", (0, 0, 0), np.nan), r"posedirs\[0, 0, 0\] is not finite"),
        (broken("weights", (7, 2), np.nan), r"weights\[7, 2\] is not finite"),
        (broken("J_regressor", (2, 2), np.nan), "J_regressor holds entries that are not finite"),
        (broken("weights", 7, 0.0), "weights of vertex 7 sum to 0, but must sum to 1"),
        (broken("weights", 7, (2, -1, 0, 0, 0)), r"weights\[7, 1\] is negative \(-1\)"),
        (broken("J_regressor", 3, 0.0), "J_regressor of joint 3 sum to 0, but must sum to 1"),
        (broken("faces", (5, 1), 30), r"face 5 is \[.*30.*\], but there are vertices 0 to 29"),
        (broken("faces", (6, 0), -1), r"face 6 is \[-1, "),
        ({"parents": (0, 0, 0, 0, 0)}, "joint 0 must be the root, with parent -1"),
        ({"parents": (-1, 0, 3, 0, 0)}, "joint 2 has parent 3; parents must come before"),
        ({"parents": (-1, 0, -1, 0, 0)}, "joint 2 has parent -1"),
        ({"mirror": np.roll(np.arange(30), 1)}, "mirror must swap vertices in pairs"),
        ({"mirror": np.arange(31)}, "mirror must swap vertices in pairs"),
        ({"mirror": np.arange(5)}, "mirror must swap vertices in pairs"),
        ({"bound_in": np.zeros((4, 3))}, r"bound_in must be finite angles \(5, 3\)"),
        ({"bound_in": np.full((5, 3), np.nan)}, "bound_in must be finite angles"),
        (
            {"landmarks": {"face": Landmarks(("nose",), csr_array((2, 30)))}},
            r"landmarks 'face': 1 names and a regressor \(2, 30\), which must be \(1, 30\)",
        ),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_broken_array_is_named(wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(BadBody, match=f"body 'made-up': .*{text}"):
        replace(random_body(), **wrong)
