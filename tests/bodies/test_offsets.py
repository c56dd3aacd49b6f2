"""Landmarks that offsets displace at rest: the same in symbols and numbers, and what they mean."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies.laws import assert_chain_rule_is_graph, some_arguments, some_values
from tests.bodies_made_up import random_body, tube_body
from tests.problem.sequences import in_blocks_of_frames
from tests.tiers import few
from workbench import Landmarks, residuals
from workbench.bodies.triangles.body import blend_scape
from workbench.errors import BadBody, NotSupported, UnknownName
from workbench.problem.banded import BlockMatrix

RNG = np.random.default_rng(0)


def with_markers(body: wb.SkinnedBody, M: int = 6) -> wb.SkinnedBody:
    """The body with single vertices and means of vertices as landmarks, the last two in common."""
    rows, rng = np.zeros((M, body.n_vertices)), np.random.default_rng(5)
    rows[np.arange(M - 2), rng.permutation(body.n_vertices)[: M - 2]] = 1.0
    rows[M - 2 :, [3, 8, 11]] = [[0.2, 0.3, 0.5], [0.6, 0.3, 0.1]]
    names = tuple(f"marker {i}" for i in range(M))
    return replace(body, landmarks={"markers": Landmarks(names, csr_array(rows))})


MARKED = with_markers(random_body(2, n_vertices=16, n_joints=5, n_betas=3))
MARKED_BODIES = {
    "bound": with_markers(random_body(3, n_vertices=16, n_joints=5, n_betas=3, bound=True)),
    "dual quaternions": replace(MARKED, skinning=wb.dual_quaternion_blend),
    "freed": MARKED.freed("template", "weights"),
    "joints given": replace(MARKED, rest_joints=RNG.normal(size=(5, 3))),
    "unbent": replace(MARKED, posedirs=np.zeros_like(MARKED.posedirs)),
}
EACH_MARKED = pytest.mark.parametrize("name", few(MARKED_BODIES, 3))
SET = "markers"


def offsets_problem(body: wb.SkinnedBody, *free: str, frame: int = 0) -> wb.Problem:
    offsets = body.offsets(SET)
    given = (*(block.symbol for block in body.blocks()), offsets.symbol)
    points = body.landmark_points(SET, *given)
    observed = np.random.default_rng(frame).normal(size=(points.count, 3))
    found = [residuals.landmarks(points, observed, sigma=0.1)]
    found.append(residuals.gaussian(offsets.symbol, mean=0.0, covariance=0.0095**2, unit="m"))
    return wb.Problem(found, free=free)


@EACH_MARKED
def test_offsets_displace_vertices_in_the_template(name: str) -> None:
    """A landmark is the mean of its vertices, each displaced in the template by its offset."""
    body = MARKED_BODIES[name]
    body = body.with_values({block.name: body.array(n) for n, block in body.free.items()})
    pose, betas, trans = some_arguments(body, scale=0.4)
    offsets = 0.4 * RNG.normal(size=(6, 3))
    still = body
    if body.rest_joints is None:  # joints do not follow a displaced vertex
        still = replace(body, rest_joints=body.joints(betas=betas))
    expected = [
        row @ replace(still, template=body.template + own).vertices(pose, betas, trans)
        for row, own in zip(body.landmarks[SET].regressor.toarray(), offsets, strict=True)
    ]
    found = body.landmark(SET, pose, betas, trans, offsets)
    np.testing.assert_allclose(found, expected, atol=1e-13)
    many = body.landmark(SET, pose, betas, trans, np.stack([0 * offsets, offsets]))
    np.testing.assert_allclose(many[1], expected, atol=1e-13)
    np.testing.assert_allclose(many[0], body.landmark(SET, pose, betas, trans), atol=1e-14)


@EACH_MARKED
def test_offsets_keep_the_chain_rule(name: str) -> None:
    body = MARKED_BODIES[name]
    for free in (
        ("offsets",),
        ("trans", "pose", "betas", "offsets"),
        (f"pose[{body.joint_names[1]}]", "offsets[marker 3]", "offsets[marker 5, y]"),
    ):
        problem = offsets_problem(body, *free)
        assert_chain_rule_is_graph(problem, some_values(problem))


def test_offsets_may_be_affine_maps_of_blocks() -> None:
    """Such as a depth of each marker along a normal, and a block that has two roles."""
    pose, betas, trans = (block.symbol for block in MARKED.blocks())
    depth, normals = wb.Block("depth", (6,), "m"), RNG.normal(size=(3, 6))
    along = cs.DM(normals) * cs.repmat(depth.symbol.T, 3, 1)
    for given, numeric in (
        (along + 0.01, True),
        (cs.repmat(trans, 1, 6) + along, True),
        (along**2, False),  # the graph remains
    ):
        points = MARKED.landmark_points(SET, pose, betas, trans, given)
        assert (points.source.numeric is not None) == numeric
        residual = residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)
        problem = wb.Problem([residual], free=("pose", "depth", "trans"))
        assert_chain_rule_is_graph(problem, some_values(problem))


@pytest.mark.thorough
@pytest.mark.parametrize("shared", [("betas", "offsets"), ("betas",), ()], ids=str)
def test_offsets_are_shared_in_sequences(
    shared: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def build() -> wb.Problem:
        free = ("trans", "pose", "betas", "offsets")
        frames = [offsets_problem(MARKED, *free, frame=t) for t in range(4)]
        return wb.sequence(frames, shared=shared)

    video = build()
    values = some_values(video)
    assert_chain_rule_is_graph(video, values)
    labels = [video.free.label(i) for i in range(video.free.size)]
    assert ("offsets[marker 3, y]" in labels) == ("offsets" in shared)
    in_blocks_of_frames(monkeypatch)
    one, other = video.linearize(values), build().linearize(values)
    assert isinstance(other.jacobian, BlockMatrix)
    np.testing.assert_allclose(other.dense, one.dense, atol=1e-11 * np.abs(one.dense).max())
    step = one.step(0.1)
    np.testing.assert_allclose(other.step(0.1), step, atol=1e-9 * np.abs(step).max())


def test_blocks_of_offsets_have_names_and_a_unit() -> None:
    block = MARKED.offsets(SET)
    assert (block.name, block.shape, block.unit) == ("offsets", (6, 3), "m")
    assert block.labels == MARKED.landmark_names(SET)
    assert MARKED.offsets(SET, "left_").name == "left_offsets"
    assert MARKED.freed("template").offsets(SET) is block
    given = (*(b.symbol for b in MARKED.blocks()), cs.MX.sym("worn", 3, 6))
    points = MARKED.landmark_points(SET, *given)
    problem = wb.Problem([residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)], free=("worn",))
    assert problem.free["worn"].unit == "m"
    assert problem.free.label(5) == "worn[marker 1, z]"


def test_offsets_that_make_no_sense_are_refused() -> None:
    given, offsets = [b.symbol for b in MARKED.blocks()], MARKED.offsets(SET).symbol
    with pytest.raises(UnknownName, match="'shoes'"):
        MARKED.offsets("shoes")
    with pytest.raises(BadBody, match="for offsets"):
        MARKED.landmark_points(SET, *given, offsets.T)
    with pytest.raises(BadBody, match="for 6 landmarks"):
        MARKED.landmark(SET, offsets=np.zeros((5, 3)))
    with pytest.raises(BadBody, match="do not fit each other"):
        MARKED.landmark(SET, np.zeros((2, 5, 3)), offsets=np.zeros((3, 6, 3)))
    for body, name in (
        (MARKED, "no offsets of joints"),
        (blend_scape(tube_body()), "TriangleBody"),
    ):
        with pytest.raises(NotSupported, match=name):
            body.landmark_points("joints", *(b.symbol for b in body.blocks()), offsets)
        with pytest.raises(NotSupported, match=name):
            body.landmark("joints", offsets=np.zeros((5, 3)))
