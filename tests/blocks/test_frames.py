"""Blocks of many frames, and the points of a body in many frames as one source."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
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


def blocks(shared: tuple[str, ...] = ("betas",)) -> FrameBlocks:
    each = (POSE, BETAS, TRANS)
    return FrameBlocks(T, {b.name: b if b.name in shared else framed(b, T) for b in each})


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


def test_graph_size_does_not_grow_with_frames() -> None:
    sizes = []
    for count in (2, 200):
        here = FrameBlocks(count, {b.name: framed(b, count) for b in (POSE, BETAS, TRANS)})
        found = here.in_frames(cs.vec(POINTS.graph()), (POSE, BETAS, TRANS), range(count))
        sizes.append(cs.Function("f", [here[n].symbol for n in VALUES], [found]).n_nodes())
    assert sizes[0] == sizes[1]


# Points.


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
