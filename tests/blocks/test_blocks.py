"""Blocks, their symbols and names; packing their values into a vector and back."""

import copy
import pickle

import casadi as cs
import numpy as np
import pytest

from workbench import load_body
from workbench.blocks import Block, Layout
from workbench.errors import (
    BadArgument,
    BadBlock,
    NonFiniteValue,
    NotNumbers,
    ShapeMismatch,
    UnknownName,
)


def test_symbol_has_the_axes_reversed() -> None:
    for shape, inside in [((), (1, 1)), ((4,), (4, 1)), ((5, 3), (3, 5)), ((2, 5, 3), (3, 10))]:
        block = Block("b", shape)
        assert block.symbol.shape == inside
        assert block.size == np.prod(shape, dtype=int)


def test_array_and_symbol_share_their_memory_layout() -> None:
    block = Block("points", (5, 3))
    array = np.random.default_rng(0).normal(size=(5, 3))
    column_by_column = cs.Function("f", [block.symbol], [cs.vec(block.symbol)])
    np.testing.assert_array_equal(np.asarray(column_by_column(array.T)).ravel(), array.ravel())


def test_entries_are_named_by_labels_and_axes() -> None:
    pose = Block("pose", (2, 3), "rad", ("pelvis", "right_ankle"))
    assert pose.entry(5) == "[right_ankle, z]"
    assert Block("betas", (4,)).entry(2) == "[2]"
    assert Block("trans", (3,), "m", ("x", "y", "z")).entry(1) == "[y]"
    assert Block("scale").entry(0) == ""
    assert Block("walk", (2, 2, 3)).entry(7) == "[1, 0, y]"
    assert Block("observed", (4, 2), "px").entry(3) == "[1, 1]"


def test_block_is_made_of_a_symbol() -> None:
    for symbol, shape in [((4, 1), (4,)), ((3, 5), (5, 3))]:
        bare = cs.MX.sym("bare", *symbol)
        block = Block.of(bare)
        assert (block.name, block.shape, block.symbol_shape) == ("bare", shape, symbol)
        assert block.symbol is bare


def test_shape_may_be_a_number_or_a_list() -> None:
    for given, shape in [(np.int64(3), (3,)), ([24, 3], (24, 3))]:
        block = Block("x", given)
        assert block.shape == shape
        assert all(type(length) is int for length in block.shape)
        assert block.size == np.prod(shape)


def test_bad_shapes_are_refused() -> None:
    for shape in [(3, -1), 1.5, "3", None]:
        with pytest.raises(BadBlock, match=r"'x'.*shape is whole numbers"):
            Block("x", shape)


def test_copies_have_symbols_of_their_own() -> None:
    for travel in [copy.copy, lambda b: pickle.loads(pickle.dumps(b))]:
        block = Block("pose", (2, 3), "rad", ("pelvis", "right_ankle"))
        _ = block.symbol
        other = travel(block)
        assert (other.name, other.shape, other.unit) == (block.name, block.shape, block.unit)
        assert other.labels == block.labels
        assert other.symbol.shape == block.symbol.shape
        assert not cs.is_equal(other.symbol, block.symbol)


LAYOUT = Layout(
    (
        Block("scale"),
        Block("pose", (2, 3), "rad", ("pelvis", "right_ankle")),
        Block("betas", (4,)),
        Block("walk", (2, 5, 3), "m"),
        Block("nothing", (0,)),
    )
)


def some_values() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {block.name: rng.normal(size=block.shape) for block in LAYOUT.blocks}


def test_unpack_inverts_pack() -> None:
    values = some_values()
    flat = LAYOUT.pack(values)
    assert flat.shape == (LAYOUT.size,) == (1 + 6 + 4 + 30,)
    back = LAYOUT.unpack(flat)
    assert list(back) == list(LAYOUT.names)
    for name, value in values.items():
        np.testing.assert_array_equal(back[name], value)
        np.testing.assert_array_equal(flat[LAYOUT.slices[name]], value.ravel())
        assert back[name].shape == value.shape


def test_symbolic_pieces_are_the_blocks_symbols() -> None:
    x = cs.MX.sym("x", LAYOUT.size)
    values = some_values()
    pieces = cs.Function("pieces", [x], LAYOUT.pieces(x))(LAYOUT.pack(values))
    for block, piece in zip(LAYOUT.blocks, pieces, strict=True):
        assert piece.shape == block.symbol_shape
        array = values[block.name].reshape(block.symbol_shape[::-1])
        np.testing.assert_array_equal(np.asarray(piece), array.T)


def test_entries_are_labelled_with_block_row_and_axis() -> None:
    assert LAYOUT.label(0) == "scale"
    assert LAYOUT.label(6) == "pose[right_ankle, z]"
    assert LAYOUT.label(7) == "betas[0]"
    assert LAYOUT.label(LAYOUT.size - 1) == "walk[1, 4, z]"
    assert LAYOUT.labels_of(np.array([7, 0])) == ["betas[0]", "scale"]
    assert LAYOUT.unit(6) == "rad"
    for i in (-1, LAYOUT.size):
        with pytest.raises(IndexError):
            LAYOUT.label(i)


def test_unknown_blocks_are_named_with_those_that_exist() -> None:
    text = "no block is called 'poze'; there are betas, nothing, pose, scale, walk"
    with pytest.raises(UnknownName, match=text):
        LAYOUT["poze"]


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(
        ShapeMismatch, match=r"block 'pose' has shape \(2, 3\), but was given \(3, 2\)"
    ):
        LAYOUT.pack(some_values() | {"pose": np.zeros((3, 2))})
    with pytest.raises(ShapeMismatch):
        LAYOUT.pack(some_values() | {"pose": np.zeros(6)})


def test_values_that_are_not_finite_are_refused() -> None:
    for bad in [np.nan, -np.inf]:
        pose = np.zeros((2, 3))
        pose[1] = bad
        with pytest.raises(NonFiniteValue, match=rf"'pose' holds {bad} at \[right_ankle, x\]"):
            LAYOUT.pack(some_values() | {"pose": pose})
        with pytest.raises(NonFiniteValue, match="its only entry"):
            LAYOUT.pack(some_values() | {"scale": np.array(bad)})


def test_values_that_are_no_numbers_are_refused() -> None:
    for value, found in [
        ("abc", "text"),
        ([[0, 0, 0], [1, 1]], "rows of different lengths"),
        (None, "something of type NoneType"),
        (np.zeros((2, 3), complex), "complex numbers"),
        (LAYOUT["pose"].symbol, "a symbol; give its numbers"),
    ]:
        with pytest.raises(
            NotNumbers, match=f"block 'pose' must be an array of real .*, not {found}"
        ):
            LAYOUT.pack(some_values() | {"pose": value})  # type: ignore[dict-item]


def test_no_chosen_points_are_refused_in_a_sentence() -> None:
    body = load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    with pytest.raises(BadArgument, match="no points are chosen; choose at least one"):
        body.points(pose, betas, trans, vertices=[])
