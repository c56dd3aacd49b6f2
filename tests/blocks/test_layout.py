"""Packing named arrays into a vector, taking it apart again, and naming its entries."""

import casadi as cs
import numpy as np
import pytest

from workbench.blocks import Block, Layout
from workbench.errors import (
    MissingValue,
    NonFiniteValue,
    NotNumbers,
    ShapeMismatch,
    UnknownName,
)

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


def test_unpack_undoes_pack() -> None:
    values = some_values()
    flat = LAYOUT.pack(values)
    assert flat.shape == (LAYOUT.size,) == (1 + 6 + 4 + 30,)
    back = LAYOUT.unpack(flat)
    assert list(back) == list(LAYOUT.names)
    for name, value in values.items():
        np.testing.assert_array_equal(back[name], value)
        assert back[name].shape == value.shape


def test_unpacked_arrays_are_copies() -> None:
    flat = LAYOUT.pack(some_values())
    before = flat.copy()
    for value in LAYOUT.unpack(flat).values():
        value[...] = 7
    np.testing.assert_array_equal(flat, before)


def test_blocks_lie_row_by_row_where_the_slices_say() -> None:
    values = some_values()
    flat = LAYOUT.pack(values)
    for name, part in LAYOUT.slices.items():
        np.testing.assert_array_equal(flat[part], values[name].ravel())


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


def test_an_unknown_block_lists_what_exists() -> None:
    text = "no block is called 'poze'; there are betas, nothing, pose, scale, walk"
    with pytest.raises(UnknownName, match=text):
        LAYOUT["poze"]
    with pytest.raises(UnknownName, match=text):
        LAYOUT.only(["pose", "poze"])
    assert LAYOUT.only(["walk", "pose"]).names == ("walk", "pose")


def test_a_missing_block_is_named_with_its_shape() -> None:
    values = some_values()
    del values["pose"]
    with pytest.raises(MissingValue, match=r"'pose' \(2, 3\) was given no value.*betas.*walk"):
        LAYOUT.pack(values)


def test_a_wrong_shape_names_block_found_and_needed() -> None:
    with pytest.raises(
        ShapeMismatch, match=r"block 'pose' has shape \(2, 3\), but was given \(3, 2\)"
    ):
        LAYOUT.pack(some_values() | {"pose": np.zeros((3, 2))})
    with pytest.raises(ShapeMismatch):
        LAYOUT.pack(some_values() | {"pose": np.zeros(6)})


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_is_named(bad: float) -> None:
    pose = np.zeros((2, 3))
    pose[1] = bad
    with pytest.raises(NonFiniteValue, match=rf"'pose' holds {bad} at \[right_ankle, x\]"):
        LAYOUT.pack(some_values() | {"pose": pose})
    with pytest.raises(NonFiniteValue, match="its only entry"):
        LAYOUT.pack(some_values() | {"scale": np.array(bad)})


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("abc", "text"),
        ([["1", "2", "3"]] * 2, "text"),
        ([[0, 0, 0], [1, 1]], "rows of different lengths"),
        (None, "something of type NoneType"),
        ([[None] * 3] * 2, "something of type NoneType"),
        (np.zeros((2, 3), complex), "complex numbers"),
        ([[1j, 0, 0]] * 2, "complex numbers"),
        (np.zeros((2, 3), "datetime64[s]"), "dates"),
        (LAYOUT["pose"].symbol, "a symbol; give its numbers"),
        ({"pose": 1}, "something of type dict"),
    ],
)
def test_what_are_no_numbers_is_named(value: object, found: str) -> None:
    with pytest.raises(NotNumbers, match=f"block 'pose' must be an array of real .*, not {found}"):
        LAYOUT.pack(some_values() | {"pose": value})  # type: ignore[dict-item]


@pytest.mark.parametrize("dtype", [bool, np.int8, np.uint64, np.float16, np.longdouble])
def test_numbers_of_any_precision_are_packed(dtype: type) -> None:
    pose = np.arange(6).reshape(2, 3).astype(dtype)
    flat = LAYOUT.pack(some_values() | {"pose": pose})
    np.testing.assert_array_equal(flat[LAYOUT.slices["pose"]], pose.ravel())


def test_an_axis_of_length_one_may_come_or_go() -> None:
    flat = Layout((Block("c", (1, 3)),)).pack({"c": [1.0, 2.0, 3.0]})
    np.testing.assert_array_equal(flat, [1, 2, 3])


def test_no_blocks_are_no_numbers() -> None:
    empty = Layout(())
    assert empty.size == 0
    assert empty.pack({"other": 1.0}).shape == (0,)
    assert empty.unpack(np.zeros(0)) == {}
