"""Landmarks that offsets displace at rest: the same in symbols and numbers, and what they mean."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies_made_up import random_body
from tests.problem.sequences import assert_numbers, both_storages
from tests.problem.test_chain import assert_same
from workbench import Landmarks, SkinnedBody, residuals
from workbench.bodies import dual_quaternion_blend
from workbench.bodies.triangles.recipes import blend_scape
from workbench.diagnostics import diagnose
from workbench.errors import BadBody, NotSupported, UnknownName
from workbench.problem.block_matrix import BlockMatrix

RNG = np.random.default_rng(5)


def with_markers(body: SkinnedBody, M: int = 6) -> SkinnedBody:
    """The body with single vertices and means of vertices as landmarks, the last two in common."""
    rows = np.zeros((M, body.n_vertices))
    rows[np.arange(M - 2), RNG.permutation(body.n_vertices)[: M - 2]] = 1.0
    rows[M - 2 :, [3, 8, 11]] = [[0.2, 0.3, 0.5], [0.6, 0.3, 0.1]]
    names = tuple(f"marker {i}" for i in range(M))
    return replace(body, landmarks={"markers": Landmarks(names, csr_array(rows))})


PLAIN = with_markers(random_body(2, n_vertices=40, n_joints=5, n_betas=3))
BOUND = with_markers(random_body(3, n_vertices=40, n_joints=5, n_betas=3, bound=True))
UNBENT = replace(PLAIN, posedirs=np.zeros_like(PLAIN.posedirs))
GIVEN = replace(PLAIN, rest_joints=RNG.normal(size=(5, 3)))
DUAL = replace(PLAIN, skinning=dual_quaternion_blend)
EACH = pytest.mark.parametrize(
    "body",
    [PLAIN, BOUND, UNBENT, GIVEN, DUAL, PLAIN.freed("template", "weights")],
    ids=["plain", "bound", "unbent", "joints given", "dual quaternions", "freed"],
)
MARKERS = "markers"


def problem_of(body: SkinnedBody, free: tuple[str, ...], frame: int = 0) -> wb.Problem:
    pose, betas, trans = body.blocks()
    offsets = body.offsets(MARKERS)
    points = body.landmark_points(
        MARKERS, pose.symbol, betas.symbol, trans.symbol, offsets=offsets.symbol
    )
    observed = np.random.default_rng(frame).normal(size=(points.count, 3))
    found = [residuals.landmarks(points, observed, sigma=0.1)]
    found.append(residuals.gaussian(offsets.symbol, mean=0.0, covariance=0.0095**2, unit="m"))
    return wb.Problem(found, free=free)


def values_of(problem: wb.Problem, seed: int = 1) -> wb.Values:
    rng = np.random.default_rng(seed)
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    return {b.base.name: rng.normal(scale=0.4, size=b.base.shape) for b in blocks}


@EACH
def test_numbers_are_those_of_the_definition(body: SkinnedBody) -> None:
    """A landmark is the mean of its vertices, each displaced in the template by its offset."""
    pose, betas, trans, offsets = (
        RNG.normal(scale=0.4, size=shape) for shape in [(5, 3), (3,), (3,), (6, 3)]
    )
    if body.free:
        body = body.with_values({block.name: body.array(n) for n, block in body.free.items()})
    if body.rest_joints is None:  # joints do not follow a displaced vertex
        joints = body.J_regressor @ (body.template + body.shapedirs @ betas)
        still = replace(body, rest_joints=joints)
    else:
        still = body
    expected = [
        row @ replace(still, template=body.template + own).vertices(pose, betas, trans)
        for row, own in zip(body.landmarks[MARKERS].regressor.toarray(), offsets, strict=True)
    ]
    found = body.landmark(MARKERS, pose, betas, trans, offsets)
    np.testing.assert_allclose(found, expected, atol=1e-13)
    symbols = [block.symbol for block in (*body.blocks(), body.offsets(MARKERS))]
    graph = body.landmark_points(MARKERS, *symbols).graph()
    by_graph = cs.Function("f", symbols, [graph])(pose.T, betas, trans, offsets.T)
    np.testing.assert_allclose(np.asarray(by_graph).T, expected, atol=1e-13)


@EACH
@pytest.mark.parametrize(
    "free",
    [
        ("pose",),
        ("offsets",),
        ("trans", "pose", "betas", "offsets"),
        ("pose[1]", "offsets[marker 3]", "offsets[marker 5, y]"),
    ],
    ids=str,
)
def test_values_jacobian_and_adjoint_are_those_of_the_graph(
    body: SkinnedBody, free: tuple[str, ...]
) -> None:
    if "pose[1]" in free:
        free = (f"pose[{body.joint_names[1]}]", *free[1:])
    problem = problem_of(body, free)
    assert_same(problem, values_of(problem))


def test_arithmetic_reads_the_offsets() -> None:
    (points,) = problem_of(PLAIN, ("pose",)).points
    assert points.source.numeric is not None
    assert points.source.numeric.reads == ("pose", "betas", "trans", "offsets")
    assert points.labels == PLAIN.landmark_names(MARKERS)


def test_batches_are_those_of_single_values() -> None:
    (points,) = problem_of(PLAIN, ("pose", "offsets")).points
    numeric = points.source.numeric
    assert numeric is not None
    shapes = {"pose": (5, 3), "betas": (3,), "trans": (3,), "offsets": (6, 3)}
    many = {name: RNG.normal(scale=0.4, size=(4, *shape)) for name, shape in shapes.items()}
    each = [numeric.evaluate({n: v[i] for n, v in many.items()}).points for i in range(4)]
    np.testing.assert_allclose(numeric.evaluate_batch(many), each, atol=1e-14)
    ordered = [many[name] for name in shapes]
    np.testing.assert_allclose(PLAIN.landmark(MARKERS, *ordered), each, atol=1e-14)
    np.testing.assert_allclose(
        DUAL.landmark(MARKERS, *ordered)[2],
        DUAL.landmark(MARKERS, *(one[2] for one in ordered)),
        atol=1e-14,
    )
    one_pose = PLAIN.landmark(MARKERS, many["pose"][0], offsets=many["offsets"])
    assert one_pose.shape == (4, 6, 3)


def test_offsets_may_be_an_affine_map_of_blocks() -> None:
    """Such as a depth of each marker along a normal, and a block that has two roles."""
    pose, betas, trans = PLAIN.blocks()
    depth, normals = wb.Block("depth", (6,), "m"), RNG.normal(size=(3, 6))
    along = cs.DM(normals) * cs.repmat(depth.symbol.T, 3, 1)
    for given in (along, along + 0.01, cs.repmat(trans.symbol, 1, 6) + along):
        points = PLAIN.landmark_points(MARKERS, pose.symbol, betas.symbol, trans.symbol, given)
        assert points.source.numeric is not None
        residual = residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)
        problem = wb.Problem([residual], free=("pose", "depth", "trans"))
        assert_same(problem, values_of(problem))
        assert diagnose(problem, values_of(problem)).rank == 18  # as many as there are rows
    bent = PLAIN.landmark_points(MARKERS, pose.symbol, betas.symbol, trans.symbol, along**2)
    assert bent.source.numeric is None  # the graph remains
    problem = wb.Problem([residuals.landmarks(bent, np.ones((6, 3)), sigma=0.1)], free=("depth",))
    assert_same(problem, values_of(problem))


@pytest.mark.parametrize("shared", [("betas", "offsets"), ("betas",), ()], ids=str)
@pytest.mark.parametrize("offsets_free", [True, False], ids=["free", "fixed"])
def test_sequences(shared: tuple[str, ...], offsets_free: bool) -> None:
    free = ("trans", "pose", "betas", "offsets") if offsets_free else ("trans", "pose", "betas")
    video = wb.sequence([problem_of(PLAIN, free, t) for t in range(4)], shared=shared)
    assert_numbers(video, values_of(video))
    entry = "offsets[marker 3, y]" if "offsets" in shared else "offsets[2, marker 3, y]"
    labels = [video.free.label(i) for i in range(video.free.size)]
    assert (entry in labels) == offsets_free


def test_shared_offsets_are_in_the_border_of_a_sequence(monkeypatch: pytest.MonkeyPatch) -> None:
    def build() -> wb.Problem:
        frames = [problem_of(PLAIN, ("trans", "pose", "betas", "offsets"), t) for t in range(5)]
        return wb.sequence(frames, shared=("betas", "offsets"))

    plain, blocked = both_storages(build, monkeypatch)
    values = values_of(plain)
    one, other = plain.linearize(values), blocked.linearize(values)
    assert isinstance(other.jacobian, BlockMatrix)
    np.testing.assert_allclose(other.dense, one.dense, atol=1e-11 * np.abs(one.dense).max())
    step = one.step(0.1)
    np.testing.assert_allclose(other.step(0.1), step, atol=1e-9 * np.abs(step).max())


def test_no_offset_is_an_offset_of_zero_to_the_last_bit() -> None:
    pose, betas, trans = PLAIN.blocks()
    symbols = pose.symbol, betas.symbol, trans.symbol
    with_block = PLAIN.landmark_points(MARKERS, *symbols, PLAIN.offsets(MARKERS).symbol)
    without = PLAIN.landmark_points(MARKERS, *symbols)
    at = values_of(problem_of(PLAIN, ("pose",))) | {"offsets": np.zeros((6, 3))}
    found = []
    for points in (with_block, without):
        residual = residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)
        here = wb.Problem([residual], free=("pose", "betas", "trans"))
        x, fixed = here.split({name: at[name] for name in here.known})
        linear = here.linearize_at(x, fixed)
        found.append((linear.residual, linear.jacobian, here.cost_and_gradient(x, fixed)[1]))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_rotating_the_body_rotates_what_offsets_do() -> None:
    """The derivative by an offset is a blend of rotations: one joint alone leaves its length."""
    rigid = replace(PLAIN, weights=np.eye(5)[RNG.integers(5, size=40)])
    pose = RNG.normal(size=(5, 3))
    offsets = RNG.normal(scale=0.01, size=(6, 3))
    moved = rigid.landmark(MARKERS, pose, offsets=offsets) - rigid.landmark(MARKERS, pose)
    single = slice(0, 4)  # the markers on one vertex
    np.testing.assert_allclose(
        np.linalg.norm(moved[single], axis=1), np.linalg.norm(offsets[single], axis=1), rtol=1e-12
    )
    np.testing.assert_allclose(
        rigid.landmark(MARKERS, offsets=offsets) - rigid.landmark(MARKERS), offsets, atol=1e-15
    )


def test_the_block_has_names_and_a_unit() -> None:
    block = PLAIN.offsets(MARKERS)
    assert block is PLAIN.offsets(MARKERS)
    assert (block.name, block.shape, block.unit) == ("offsets", (6, 3), "m")
    assert block.labels == PLAIN.landmark_names(MARKERS)
    assert PLAIN.offsets(MARKERS, "left_").name == "left_offsets"
    assert problem_of(PLAIN, ("offsets",)).free.label(4) == "offsets[marker 1, y]"
    freed = PLAIN.freed("template")
    assert freed.offsets(MARKERS) is block
    with pytest.raises(UnknownName, match="'shoes'; there are joints, markers"):
        PLAIN.offsets("shoes")


def test_a_symbol_of_other_origin_is_labelled_by_the_landmarks() -> None:
    pose, betas, trans = PLAIN.blocks()
    own = cs.MX.sym("worn", 3, 6)
    points = PLAIN.landmark_points(MARKERS, pose.symbol, betas.symbol, trans.symbol, own)
    problem = wb.Problem([residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)], free=("worn",))
    assert problem.free["worn"].unit == "m"
    assert problem.free.label(5) == "worn[marker 1, z]"


def test_errors_say_what_offsets_are() -> None:
    pose, betas, trans = (block.symbol for block in PLAIN.blocks())
    offsets = PLAIN.offsets(MARKERS).symbol
    with pytest.raises(BadBody, match=r"shape \(3, 6\) for offsets, not \(6, 3\)"):
        PLAIN.landmark_points(MARKERS, pose, betas, trans, offsets.T)
    with pytest.raises(BadBody, match=r"shape \(\.\.\., 6, 3\) for 6 landmarks, not \(5, 3\)"):
        PLAIN.landmark(MARKERS, offsets=np.zeros((5, 3)))
    with pytest.raises(BadBody, match=r"and offsets .* do not fit each other"):
        PLAIN.landmark(MARKERS, np.zeros((2, 5, 3)), offsets=np.zeros((3, 6, 3)))
    for refused in (
        lambda: PLAIN.offsets("joints"),
        lambda: PLAIN.landmark_points("joints", pose, betas, trans, offsets),
        lambda: PLAIN.landmark("joints", offsets=np.zeros((5, 3))),
    ):
        with pytest.raises(NotSupported, match="no offsets of joints"):
            refused()
    triangles = blend_scape(wb.load_body("small"))
    pose, betas, trans = (block.symbol for block in triangles.blocks())
    with pytest.raises(NotSupported, match=r"a TriangleBody.*landmarks of a SkinnedBody"):
        triangles.landmark_points("joints", pose, betas, trans, offsets)
    with pytest.raises(NotSupported, match="a TriangleBody"):
        triangles.landmark("joints", offsets=np.zeros((5, 3)))
