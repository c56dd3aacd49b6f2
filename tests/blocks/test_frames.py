"""Blocks of many frames, and the points of a body in many frames as one source."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench.blocks.composed_points import FrameBlocks, framed
from workbench.errors import BadBlock

BODY = random_body(1, n_vertices=5, n_joints=3, n_betas=2)
POSE, BETAS, TRANS = BODY.blocks()
POINTS = BODY.joint_points(POSE.symbol, BETAS.symbol, TRANS.symbol)
T = 4
RNG = np.random.default_rng(0)
VALUES = {
    "pose": RNG.normal(scale=0.4, size=(T, 3, 3)),
    "betas": RNG.normal(size=2),
    "trans": RNG.normal(size=(T, 3)),
}
SUBSETS = few(((0, 2), (0, 1, 2, 3), (3,), (1, 2, 3)), 1)


def blocks(shared: tuple[str, ...] = ("betas",)) -> FrameBlocks:
    each = (POSE, BETAS, TRANS)
    return FrameBlocks(T, {b.name: b if b.name in shared else framed(b, T) for b in each})


def by_graph(
    source: wb.blocks.PointSource, values: wb.Values
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The points (N, 3) and their derivatives (3 N, size) by each block, from the expression."""
    symbols = [b.symbol for b in source.blocks]
    assert source.expression is not None
    column = cs.vec(source.expression)
    function = cs.Function("f", symbols, [column, *(cs.jacobian(column, s) for s in symbols)])
    points, *slopes = function(
        *(values[b.name].ravel().reshape(b.symbol_shape, order="F") for b in source.blocks)
    )
    found = {b.name: np.asarray(J) for b, J in zip(source.blocks, slopes, strict=True)}
    return np.asarray(points).reshape(-1, 3), found


# Blocks.


def test_block_of_frames_keeps_its_labels() -> None:
    pose = framed(wb.Block("pose", (2, 3), "rad", ("hip", "knee")), 3)
    assert pose.shape == (3, 2, 3)
    assert pose.framed
    assert pose.unit == "rad"
    assert pose.symbol_shape == (3, 6)
    labels = [pose.entry(i) for i in range(pose.size)]
    assert labels[0] == "[0, hip, x]"
    assert labels[4] == "[0, knee, y]"
    assert labels[-1] == "[2, knee, z]"
    assert len(set(labels)) == 18
    assert framed(wb.Block("trans", (3,), "m"), 2).entry(4) == "[1, y]"
    assert framed(wb.Block("betas", (2,)), 2).entry(3) == "[1, 1]"
    assert framed(wb.Block("scale"), 2).entry(1) == "[1]"
    with pytest.raises(BadBlock, match="counts none"):
        wb.Block("scale", (), framed=True)
    with pytest.raises(BadBlock, match="has 2 rows but 3 labels"):
        wb.Block("pose", (3, 2, 3), labels=("a", "b", "c"), framed=True)


def test_part_of_a_block_names_its_entries() -> None:
    pose = framed(wb.Block("pose", (2, 3), "rad", ("hip", "knee")), 3)
    part = wb.Block.part(pose, [3, 4, 5, 15])
    assert [part.entry(i) for i in range(4)] == [
        "[0, knee, x]",
        "[0, knee, y]",
        "[0, knee, z]",
        "[2, knee, x]",
    ]
    flat_block = framed(wb.Block("trans", (3,), "m", ("a", "b", "c")), 2)
    rows = wb.Block.part(flat_block, [3, 4, 5])
    assert rows.size == 3
    assert flat_block.taken(np.arange(6).reshape(2, 3)).shape == (2, 3)


@pytest.mark.parametrize("some", SUBSETS, ids=str)
def test_expression_of_a_frame_in_some_frames(some: tuple[int, ...]) -> None:
    here = blocks()
    one = POSE.symbol @ cs.vertcat(1, 2, 3) * cs.sum1(BETAS.symbol) + TRANS.symbol
    found = here.in_frames(one, (POSE, BETAS, TRANS), some)
    function = cs.Function("f", [here[n].symbol for n in VALUES], [found])
    values = (v.ravel().reshape(here[n].symbol_shape, order="F") for n, v in VALUES.items())
    expected = [
        VALUES["pose"][t].T @ [1, 2, 3] * VALUES["betas"].sum() + VALUES["trans"][t] for t in some
    ]
    np.testing.assert_allclose(np.asarray(function(*values)).T, expected, atol=1e-14)


def test_graph_size_does_not_grow_with_frames() -> None:
    sizes = []
    for count in (2, 200):
        here = FrameBlocks(count, {b.name: framed(b, count) for b in (POSE, BETAS, TRANS)})
        found = here.in_frames(cs.vec(POINTS.graph()), (POSE, BETAS, TRANS), range(count))
        sizes.append(cs.Function("f", [here[n].symbol for n in VALUES], [found]).n_nodes())
    assert sizes[0] == sizes[1]


# Points.


@pytest.mark.parametrize(
    "shared", few([("betas",), (), ("pose",), ("pose", "betas", "trans")], 2), ids=str
)
@pytest.mark.parametrize("some", SUBSETS, ids=str)
def test_framed_points_and_derivatives_are_those_of_frames(
    shared: tuple[str, ...], some: tuple[int, ...]
) -> None:
    source = blocks(shared).points(POINTS, some).source
    values = {}
    for name, value in VALUES.items():
        one = value if name == "betas" else value[0]
        many = np.stack([value + 0.1 * t for t in range(T)]) if name == "betas" else value
        values[name] = one if name in shared else many
    points, slopes = by_graph(source, values)
    each = [
        BODY.joints(*(values[n] if n in shared else values[n][t] for n in VALUES)) for t in some
    ]
    np.testing.assert_allclose(points, np.concatenate(each), atol=1e-13)
    assert source.count == len(points) == 3 * len(some)
    assert source.numeric is not None
    here = source.numeric.evaluate(values)
    np.testing.assert_allclose(here.points, points, atol=1e-13)
    scale = RNG.uniform(1, 2, 3 * len(points))
    into = {name: np.zeros((J.shape[1], J.shape[0])) for name, J in slopes.items()}
    here.write_jacobian(into, None)
    for name, J in slopes.items():
        np.testing.assert_allclose(into[name].T, J, atol=1e-12)
    here.write_jacobian(into, scale)
    for name, J in slopes.items():
        np.testing.assert_allclose(into[name], J.T * scale, atol=1e-12)
    cotangent = RNG.standard_normal(3 * len(points))
    for name, g in here.vjp(cotangent).items():
        np.testing.assert_allclose(g, cotangent @ slopes[name], atol=1e-12)
    for name, J in slopes.items():
        if name in shared:
            continue
        pattern = source.numeric.pattern(name)
        assert pattern is not None
        assert not (J != 0)[pattern.toarray() == 0].any()
        sparse = here.jacobian(name)
        assert not (sparse.toarray() != 0)[pattern.toarray() == 0].any()
        np.testing.assert_allclose(sparse.toarray(), J, atol=1e-12)


def test_framed_points_of_many_values_at_once() -> None:
    source = blocks().points(POINTS, (0, 2, 3)).source
    assert source.numeric is not None
    many = {n: np.stack([v, v + 0.1, v - 0.2]) for n, v in VALUES.items()}
    found = source.numeric.evaluate_batch(many)
    for i in range(3):
        one = source.numeric.evaluate({n: v[i] for n, v in many.items()}).points
        np.testing.assert_allclose(found[i], one, atol=1e-13)


def test_points_have_the_names_of_their_frames() -> None:
    source = blocks().points(POINTS, (1, 3)).source
    assert source.labels == tuple(f"{t}, joint{k}" for t in (1, 3) for k in range(3))
    assert tuple(b.name for b in source.blocks) == ("pose", "betas", "trans")


def test_trees_of_frames_are_a_forest() -> None:
    own = POINTS.source.tree
    assert own is not None
    source = blocks().points(POINTS, (1, 3)).source
    tree = source.tree
    assert tree is not None
    assert tree.names[0] == "1, joint0"
    assert tree.names[5] == "3, joint2"
    roots = [k for k, parent in enumerate(tree.parents) if parent < 0]
    assert roots == [0, 3]
    assert [p - 3 for p in tree.parents[4:]] == [int(p) for p in own.parents[1:]]
    assert tree.places[:3] == tuple(("pose", 9 + 3 * k) for k in range(3))
    assert tree.places[3:] == tuple(("pose", 27 + 3 * k) for k in range(3))
    one_pose = blocks(("pose", "betas")).points(POINTS, (1, 3)).source
    assert one_pose.tree is own
