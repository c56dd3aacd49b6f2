"""A block's symbol, its memory, and the names of its entries."""

import copy
import pickle
from typing import Any

import casadi as cs
import numpy as np
import pytest

from workbench.blocks import Block
from workbench.errors import BadBlock


@pytest.mark.parametrize(
    ("shape", "inside"),
    [((), (1, 1)), ((4,), (4, 1)), ((5, 3), (3, 5)), ((2, 5, 3), (3, 10)), ((0,), (0, 1))],
)
def test_the_symbol_has_the_axes_reversed(shape: tuple[int, ...], inside: tuple[int, int]) -> None:
    block = Block("b", shape)
    assert block.symbol.shape == inside
    assert block.size == np.prod(shape, dtype=int)


def test_an_array_and_its_symbol_are_the_same_memory() -> None:
    block = Block("points", (5, 3))
    array = np.random.default_rng(0).normal(size=(5, 3))
    column_by_column = cs.Function("f", [block.symbol], [cs.vec(block.symbol)])
    np.testing.assert_array_equal(np.asarray(column_by_column(array.T)).ravel(), array.ravel())


def test_the_symbol_is_made_once_and_never_shared() -> None:
    one, other = Block("b", (3,)), Block("b", (3,))
    assert one.symbol is one.symbol
    assert not cs.is_equal(one.symbol, other.symbol)


def test_entries_have_names() -> None:
    pose = Block("pose", (2, 3), "rad", ("pelvis", "right_ankle"))
    assert pose.entry(5) == "[right_ankle, z]"
    assert Block("betas", (4,)).entry(2) == "[2]"
    assert Block("trans", (3,), "m", ("x", "y", "z")).entry(1) == "[y]"
    assert Block("scale").entry(0) == ""
    assert Block("walk", (2, 2, 3)).entry(7) == "[1, 0, y]"
    assert Block("observed", (4, 2), "px").entry(3) == "[1, 1]"


def test_labels_must_be_one_per_row() -> None:
    with pytest.raises(BadBlock, match="'pose' has 2 rows but 3 labels"):
        Block("pose", (2, 3), labels=("a", "b", "c"))


@pytest.mark.parametrize(
    ("symbol", "shape"), [((1, 1), ()), ((4, 1), (4,)), ((3, 5), (5, 3)), ((1, 3), (3, 1))]
)
def test_a_bare_symbol_tells_its_block(symbol: tuple[int, int], shape: tuple[int, ...]) -> None:
    bare = cs.MX.sym("bare", *symbol)
    block = Block.of(bare)
    assert (block.name, block.shape, block.symbol_shape) == ("bare", shape, symbol)
    assert block.symbol is bare


@pytest.mark.parametrize(("given", "shape"), [(3, (3,)), (np.int64(3), (3,)), ([24, 3], (24, 3))])
def test_a_shape_may_be_one_number_or_any_list(given: Any, shape: tuple[int, ...]) -> None:
    block = Block("x", given)
    assert block.shape == shape
    assert all(type(length) is int for length in block.shape)
    assert block.size == np.prod(shape)


@pytest.mark.parametrize("shape", [-1, (3, -1), 1.5, (24, 3.0), "3", None, ((1, 2), 3)])
def test_a_shape_that_is_none_is_refused(shape: Any) -> None:
    with pytest.raises(BadBlock, match=r"block 'x' has the shape .*, but a shape is whole numbers"):
        Block("x", shape)


@pytest.mark.parametrize(
    "travel", [copy.copy, copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))]
)
def test_a_copy_is_another_block_of_the_same_name(travel: Any) -> None:
    block = Block("pose", (2, 3), "rad", ("pelvis", "right_ankle"))
    _ = block.symbol
    other = travel(block)
    assert (other.name, other.shape, other.unit) == (block.name, block.shape, block.unit)
    assert other.labels == block.labels
    assert other.symbol.shape == block.symbol.shape
    assert not cs.is_equal(other.symbol, block.symbol)
