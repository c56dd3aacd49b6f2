"""Pickles made to hang or to fill the memory: each ends in a sentence."""

import pickle
import re
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.bodies.random_bodies import entries
from tests.hardening.pickle_bombs import (
    BOMBS,
    NO_ARRAY_YET,
    RECONSTRUCT,
    SIZES,
    ZEROS,
    K,
    N,
    array,
    array_of,
    body,
    called_with_a_list,
    chumpy,
    colliding,
    content,
    dictionary,
    doubled_tuples,
    dtype,
    in_itself,
    keys_of,
    of_one_content,
    of_one_text,
    one_entry,
    pickled,
    repeated,
    selected_again,
    selections,
    several,
    shared_attributes,
    shared_state,
    sparse,
    text,
    whole,
)
from tests.hardening.pickled_bodies import SECONDS, refused
from tests.hardening.within_limits import Reader


def test_the_body_that_is_changed_is_one(bodies: Reader, tmp_path: Path) -> None:
    (tmp_path / "model.pkl").write_bytes(body())
    assert bodies.within_limits(tmp_path / "model.pkl").kind == "read"


# A bomb in every place that a reader looks into.

NO_ARRAY = "weights is a .*, but must be an array of numbers|weights is a .* that cannot be read"
UNREAD = "weights is a .* that cannot be read"
F8 = dtype()
PLACES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "an entry": (lambda bomb: bomb, NO_ARRAY),
    "an array's shape": (lambda bomb: array_of(bomb, F8, ZEROS), UNREAD),
    "a size in a shape": (lambda bomb: array_of(several(bomb, bomb), F8, ZEROS), UNREAD),
    "an array's type": (lambda bomb: array_of(SIZES, bomb, ZEROS), UNREAD),
    "the code of a type": (lambda bomb: array_of(SIZES, dtype(bomb), ZEROS), UNREAD),
    "the order of bytes": (lambda bomb: array_of(SIZES, dtype(order=bomb), ZEROS), UNREAD),
    "an array's bytes": (lambda bomb: array_of(SIZES, F8, bomb), UNREAD),
    "the encoding of bytes": (
        lambda bomb: array_of(
            SIZES, F8, b"c_codecs\nencode\n" + several(text("a" * 8 * N * K), bomb) + b"R"
        ),
        UNREAD,
    ),
    "the state of an array": (lambda bomb: NO_ARRAY_YET + bomb + b"b", UNREAD),
    "the class of an array": (
        lambda bomb: RECONSTRUCT + several(bomb, bomb) + b"R" + several(bomb) + b"b",
        "it makes an array of a kind that is not read|is called with a",
    ),
    "the arguments of a call": (
        lambda bomb: RECONSTRUCT + bomb + b"R",
        "it makes an array of a kind that is not read|is called with a",
    ),
    "what is called": (lambda bomb: bomb + b")R", "calls a .*, which is no name"),
    "what is changed inside": (lambda bomb: bomb + b"}b", "changes the inside of a|" + UNREAD),
    "the name of a module": (
        lambda bomb: bomb + text("x") + b"\x93",
        "a name that is no text|a name of 300,001 characters|asks for",
    ),
    "a scalar": (
        lambda bomb: b"cnumpy.core.multiarray\nscalar\n" + several(F8, bomb) + b"R",
        UNREAD,
    ),
    "a buffer": (
        lambda bomb: b"cnumpy.core.numeric\n_frombuffer\n" + several(bomb, F8, bomb, bomb) + b"R",
        UNREAD,
    ),
    "the value of a Ch": (lambda bomb: chumpy("Ch", x=bomb), NO_ARRAY),
    "the attributes of a Ch": (lambda bomb: b"cchumpy.ch\nCh\n)\x81" + bomb + b"b", UNREAD),
    "what is selected from": (
        lambda bomb: chumpy("Select", a=bomb, idxs=array(1, of="i8")),
        UNREAD,
    ),
    "what is selected": (lambda bomb: chumpy("Select", a=array(3), idxs=bomb), UNREAD),
    "the shape of what is selected": (
        lambda bomb: chumpy("Select", a=array(3), idxs=array(3, of="i8"), preferred_shape=bomb),
        UNREAD,
    ),
    "the axes of a transpose": (lambda bomb: chumpy("transpose", a=array(3, 6), axes=bomb), UNREAD),
    "a matrix's shape": (
        lambda bomb: sparse(
            "csc",
            3,
            6,
            data=array(0),
            indices=array(0, of="i4"),
            indptr=array(7, of="i4"),
            _shape=bomb,
        ),
        UNREAD,
    ),
    "a matrix's numbers": (
        lambda bomb: sparse("csc", 3, 6, data=bomb, indices=bomb, indptr=bomb),
        UNREAD,
    ),
    "a matrix's coordinates": (
        lambda bomb: sparse("coo", 3, 6, data=array(0), coords=bomb),
        UNREAD,
    ),
}


@pytest.mark.parametrize("bomb", BOMBS)
@pytest.mark.parametrize("place", PLACES)
def test_a_bomb_in_every_place(bodies: Reader, tmp_path: Path, place: str, bomb: str) -> None:
    put, says = PLACES[place]
    said = refused(bodies, tmp_path, body(weights=put(BOMBS[bomb])))
    assert re.search(says, said), said


# Work and memory that a small file asks for.


TOO_MUCH = "its arrays would take more than 8 times its own .* bytes and 64 MB"
TOO_MANY = "it is made of more than 2,000 arrays and chumpy values"
TOO_LONG = "it has more than 500,000 instructions"
SMALL = bytes(8 * N * K)
GREEDY: dict[str, tuple[Callable[[], bytes], str]] = {
    "chumpy's Select of Select, 16 deep": (
        lambda: body(weights=selections(16)),
        r"weights has shape \(16000,\)",
    ),
    "chumpy's Select of Select, 500 deep": (
        lambda: body(weights=selections(500)),
        "nested more than 16 deep",
    ),
    "one Select for 9,000 entries": (
        lambda: body(weights=b"N", **repeated(selections(16), 9000)),
        "weights is a NoneType",
    ),
    "9,000 entries that each fail": (
        lambda: body(**repeated(chumpy("Select", a=in_itself(), idxs=b"N"), 9000)),
        TOO_MANY,
    ),
    "the same bytes in 1,900 arrays": (lambda: body(**of_one_content(1900, 20_000)), TOO_MUCH),
    "the same text in 1,900 arrays": (lambda: body(**of_one_text(1900, 100_000)), TOO_MUCH),
    "the same text in 9,000 entries": (
        lambda: body(**repeated(text("long " * 20_000), 9000)),
        TOO_MUCH,
    ),
    "the same bytes in 9,000 entries": (
        lambda: body(**repeated(content(bytes(100_000)), 9000)),
        TOO_MUCH,
    ),
    "one number selected 40 million times": (
        lambda: body(**selected_again(400, 100_000)),
        TOO_MUCH,
    ),
    "3,000 arrays of nothing": (lambda: body(**{f"e{i}": array(0) for i in range(3000)}), TOO_MANY),
    "1,900 arrays with one state of 100,000": (
        lambda: body(weights=b"N", **shared_state(1900, 100_000)),
        "weights is a NoneType",
    ),
    "1,900 matrices with one dictionary of 100,000": (
        lambda: body(weights=b"N", **shared_attributes(1900, 100_000)),
        "weights is a NoneType",
    ),
    "20,000 calls with one list of 100,000": (
        lambda: pickled(called_with_a_list(20_000, 100_000)),
        "object is called with a list",
    ),
    "a shape of a million sizes": (
        lambda: body(weights=array_of(several(whole(2**31 - 1) * 60_000), F8, content(SMALL))),
        "its shape is no tuple of sizes",
    ),
    "a shape of long numbers": (
        lambda: body(weights=array_of(several(whole(2**2000) * 30), F8, content(SMALL))),
        "a whole number of 2,001 bits",
    ),
    "a shape of the largest sizes": (
        lambda: body(weights=array(*[2**31 - 1] * 32, holds=content(SMALL))),
        r"\(2147483647, 2147483647, .*numbers of 8 bytes, but 144 bytes",
    ),
    "nothing in very many rows": (
        lambda: body(J_regressor=array(2**31 - 1, 0, holds=content(b""))),
        TOO_MUCH,
    ),
    "nothing selected in very many rows": (
        lambda: body(
            J_regressor=chumpy(
                "Select",
                a=array(0),
                idxs=array(0, of="i8"),
                preferred_shape=several(whole(2**31 - 1), whole(0)),
            )
        ),
        TOO_MUCH,
    ),
    "texts of no size": (lambda: body(weights=array(10**9, of="S0", holds=content(b""))), TOO_MUCH),
    "a matrix of 10 million rows, 100 times": (
        lambda: body(**{f"e{i}": one_entry(10**7, 10**7) for i in range(100)}),
        TOO_MUCH,
    ),
    "a matrix of 2 billion rows": (
        lambda: body(J_regressor=one_entry(2**31 - 1, 5)),
        "a matrix of 2,147,483,647 x 5",
    ),
    "a matrix of more rows than numbers have": (
        lambda: body(J_regressor=one_entry(2**62, 5)),
        "no tuple of sizes from 0 to 2,147,483,647",
    ),
    "pointers of a matrix that point nowhere": (
        lambda: body(
            J_regressor=sparse(
                "csc",
                3,
                4,
                data=array(0),
                indices=array(0, of="i4"),
                indptr=array(5, of="i4", holds=content(struct.pack("<5i", 0, 0, 65536, 0, 0))),
            )
        ),
        "its pointers do not rise from 0 to the number of its entries",
    ),
    "a row of a matrix that is far away": (
        lambda: body(
            J_regressor=sparse(
                "coo",
                3,
                6,
                data=array(1),
                col=array(1, of="i4"),
                row=array(1, of="i4", holds=content(b"\xff\xff\xff\x7f")),
            )
        ),
        "J_regressor is a scipy.sparse.coo.coo_matrix that cannot be read",
    ),
    "400,000 empty lists": (lambda: pickled(b"]" * 400_000), "no dictionary of arrays, but a list"),
    "3 million empty dictionaries": (lambda: pickled(b"}" * 3_000_000), TOO_LONG),
    "3 million marks": (lambda: pickled(b"(" * 3_000_000), TOO_LONG),
    "3 million values pushed and dropped": (lambda: pickled(b"N0" * 1_500_000), TOO_LONG),
    "2 million memories": (lambda: b"\x80\x04" + b"}\x94" * 1_000_000 + b".", TOO_LONG),
    "2 million copies of one value": (lambda: pickled(b"}" + b"2" * 2_000_000), TOO_LONG),
    "a million calls": (
        lambda: pickled(b"cbuiltins\nobject\n" + b")R" * 1_000_000),
        "calls a Made",
    ),
    "a number of a million bytes": (
        lambda: pickled(dictionary({"a": whole(2**8_000_000)})),
        "a whole number of 8,000,001 bits",
    ),
    "a long number as key, again and again": (
        lambda: pickled(keys_of(whole(2**4_000_000), 90_000)),
        "a whole number of 4,000,001 bits",
    ),
    "a long text as key, again and again": (
        lambda: pickled(keys_of(text("x" * 500_000), 90_000)),
        "an entry has 500,000 characters",
    ),
    "long bytes as key, again and again": (
        lambda: pickled(keys_of(content(b"x" * 500_000), 90_000)),
        "an entry has 500,000 characters",
    ),
    "a tuple of tuples as key": (
        lambda: pickled(b"}" + doubled_tuples() + b"Ns"),
        "has no v_template, .*it has nothing",
    ),
    "numbers as keys": (lambda: pickled(colliding(60_000)), "holds 60,000 entries"),
    "150,000 entries": (
        lambda: pickled(dictionary({f"e{i}": b"N" for i in range(150_000)})),
        "150,000 entries",
    ),
    "a million joints": (
        lambda: body(kintree_table=array(2, 200_000, of="u1")),
        "kintree_table has 200,000 joints",
    ),
    "a million vertices that are not finite": (
        lambda: body(v_template=array(10**6, 3, of="f2", holds=content(b"\xff" * 6 * 10**6))),
        r"weights has shape \(6, 3\), but must be \(1000000, 3\)",
    ),
}


@pytest.mark.parametrize("name", GREEDY)
def test_small_files_that_ask_for_much(bodies: Reader, tmp_path: Path, name: str) -> None:
    make, says = GREEDY[name]
    said = refused(bodies, tmp_path, make())
    assert re.search(says, said), said


def test_matrices_that_no_body_uses_are_not_filled_with_zeros(
    bodies: Reader, tmp_path: Path
) -> None:
    """100 matrices of 2,000 x 2,000: 3.2 GB if each was kept as a full array."""
    (tmp_path / "model.pkl").write_bytes(
        body(**{f"e{i}": one_entry(2000, 2000) for i in range(100)})
    )
    assert bodies.within_limits(tmp_path / "model.pkl").kind == "read"


def test_a_large_file_is_read_in_its_time(bodies: Reader, tmp_path: Path) -> None:
    """8,000 vertices and 100 blend shapes in float64, as the largest models have: 60 MB."""
    large = entries(8000, 24, B=100)
    (tmp_path / "model.pkl").write_bytes(pickle.dumps(large, protocol=2))
    answer = bodies.read(tmp_path / "model.pkl")
    assert answer.kind == "read", answer.message
    assert answer.seconds < 2 * SECONDS
