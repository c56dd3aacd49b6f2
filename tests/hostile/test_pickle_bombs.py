"""Pickles made to hang, to fill the memory or to run code: each ends in a short sentence."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.hostile.limits import READ, Reader
from tests.hostile.pickle_bombs import (
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
    doubled_tuples,
    dtype,
    in_itself,
    keys_of,
    of_one_content,
    one_entry,
    pickled,
    repeated,
    selected_again,
    selections,
    several,
    sparse,
    text,
    whole,
)

LOAD = "workbench.bodies.catalogue:load_body"
MEGABYTES = 500


def refused(reader: Reader, folder: Path, file: bytes) -> str:
    """The sentence with which a pickle is refused as a body."""
    (folder / "model.pkl").write_bytes(file)
    return reader.refusal(LOAD, folder / "model.pkl", MEGABYTES)


def test_bodies_made_by_hand_are_read(reader: Reader, tmp_path: Path) -> None:
    card = text(json.dumps({"left_out": 5, "name": [], "provenance": {}}))
    wide = {f"e{i}": one_entry(2000, 2000) for i in range(100)}  # 3.2 GB if they were filled
    for file in (body(), body(card=card, J=array(3)), body(**wide)):
        (tmp_path / "model.pkl").write_bytes(file)
        answer = reader.ask(LOAD, tmp_path / "model.pkl", megabytes=MEGABYTES)
        assert answer.outcome == READ, answer.what


F8 = dtype()
INDEX, POINTERS = array(1, of="i8"), array(7, of="i4")
SELECTED = {"a": array(3), "idxs": array(3, of="i8")}
LETTERS = text("a" * 8 * N * K)
PLACES: dict[str, Callable[[bytes], bytes]] = {  # that a reader looks into
    "an entry": lambda bomb: bomb,
    "the arguments of a call": lambda bomb: RECONSTRUCT + bomb + b"R",
    "what is selected from": lambda bomb: chumpy("Select", a=bomb, idxs=INDEX),
    "a size in a shape": lambda bomb: array_of(several(bomb, bomb), F8, ZEROS),
    "an array's type": lambda bomb: array_of(SIZES, bomb, ZEROS),
    "the code of a type": lambda bomb: array_of(SIZES, dtype(bomb), ZEROS),
    "an array's bytes": lambda bomb: array_of(SIZES, F8, bomb),
    "an encoding": lambda bomb: array_of(
        SIZES, F8, b"c_codecs\nencode\n" + several(LETTERS, bomb) + b"R"
    ),
    "the state of an array": lambda bomb: NO_ARRAY_YET + bomb + b"b",
    "the class of an array": lambda bomb: RECONSTRUCT + several(bomb, bomb) + b"R" + bomb + b"b",
    "what is called": lambda bomb: bomb + b")R",
    "a scalar": lambda bomb: b"cnumpy.core.multiarray\nscalar\n" + several(F8, bomb) + b"R",
    "a buffer": lambda bomb: (
        b"cnumpy.core.numeric\n_frombuffer\n" + several(bomb, F8, bomb, bomb) + b"R"
    ),
    "the value of a Ch": lambda bomb: chumpy("Ch", x=bomb),
    "what is selected": lambda bomb: chumpy("Select", a=array(3), idxs=bomb),
    "a preferred shape": lambda bomb: chumpy("Select", **SELECTED, preferred_shape=bomb),
    "the axes of a transpose": lambda bomb: chumpy("transpose", a=array(3, 6), axes=bomb),
    "a matrix's shape": lambda bomb: sparse(
        "csc", 3, 6, data=array(0), indices=array(0, of="i4"), indptr=POINTERS, _shape=bomb
    ),
    "a matrix's numbers": lambda bomb: sparse("csc", 3, 6, data=bomb, indices=bomb, indptr=bomb),
}


def test_bombs_are_refused_in_every_place(reader: Reader, tmp_path: Path) -> None:
    for number, put in enumerate(PLACES.values()):
        bomb = list(BOMBS.values())[number % len(BOMBS)]
        refused(reader, tmp_path, body(weights=put(bomb)))


@pytest.mark.thorough
@pytest.mark.parametrize("place", list(PLACES)[:4])
def test_every_bomb_is_refused(reader: Reader, tmp_path: Path, place: str) -> None:
    for bomb in BOMBS.values():
        refused(reader, tmp_path, body(weights=PLACES[place](bomb)))


LONG = "x" * 1_000_000
GREEDY: dict[str, Callable[[], bytes]] = {  # small files that ask for much work or memory
    "chumpy's Select of Select, 500 deep": lambda: body(weights=selections(500)),
    "3,000 arrays of nothing": lambda: body(**{f"e{i}": array(0) for i in range(3000)}),
    "the same bytes in 1,900 arrays": lambda: body(**of_one_content(1900, 20_000)),
    "one number selected 40 million times": lambda: body(**selected_again(400, 100_000)),
    "a matrix of 2 billion rows": lambda: body(J_regressor=one_entry(2**31 - 1, 5)),
    "1.5 million values pushed and dropped": lambda: pickled(b"N0" * 1_500_000),
    "a long text as key": lambda: pickled(keys_of(text("x" * 500_000), 90_000)),
    "9,000 entries that each fail": lambda: body(
        **repeated(chumpy("Select", a=in_itself(), idxs=b"N"), 9000)
    ),
    "the same text in 9,000 entries": lambda: body(**repeated(text("long " * 20_000), 9000)),
    "20,000 calls with one list": lambda: pickled(called_with_a_list(20_000, 100_000)),
    "a shape of a million sizes": lambda: body(
        weights=array_of(several(whole(2**31 - 1) * 60_000), F8, ZEROS)
    ),
    "large matrices, 100 times": lambda: body(**{f"e{i}": one_entry(10**7, 9) for i in range(100)}),
    "pointers that point nowhere": lambda: body(
        J_regressor=sparse(
            *("csc", 3, 4),
            data=array(0),
            indices=array(0, of="i4"),
            indptr=array(5, of="i4", holds=content(struct.pack("<5i", 0, 0, 65536, 0, 0))),
        )
    ),
    "a tuple of tuples as key": lambda: pickled(b"}" + doubled_tuples() + b"Ns"),
    "numbers as keys that collide": lambda: pickled(colliding(60_000)),
    "200,000 joints": lambda: body(kintree_table=array(2, 200_000, of="u1")),
    # What would make a sentence long, or paint on a terminal.
    "a long name": lambda: pickled(b"cos\n" + LONG.encode() + b"\n"),
    "a name that paints": lambda: pickled(text("os\x1b[31m\x07\n") + text("\ud800") + b"\x93"),
    "a card of lists in lists": lambda: body(card=text("[" * 200_000)),
    "a million vertices that are none": lambda: body(
        v_template=array(10**6, 3, of="f2", holds=content(b"\xff" * 6 * 10**6))
    ),
}


LIMITS = {  # and the words that name them
    "1.5 million values pushed and dropped": "more than 500,000 instructions",
    "3,000 arrays of nothing": "more than 2,000 arrays",
    "the same bytes in 1,900 arrays": "would take more than",
    "chumpy's Select of Select, 500 deep": "nested more than 16 deep",
    "a matrix of 2 billion rows": "a matrix of 2,147,483,647 x 5",
    "a long text as key": "an entry has 500,000 characters",
}


def test_limits_of_pickles_are_named(reader: Reader, tmp_path: Path) -> None:
    for name, says in LIMITS.items():
        assert says in refused(reader, tmp_path, GREEDY[name]())


@pytest.mark.thorough
@pytest.mark.parametrize("name", GREEDY)
def test_greedy_pickles_are_refused(reader: Reader, tmp_path: Path, name: str) -> None:
    refused(reader, tmp_path, GREEDY[name]())


def single(value: object, of: str, *shape: int) -> bytes:
    """An array of one number again and again."""
    numbers = np.full(shape, value, dtype=of)
    return array(*shape, of=of, holds=content(numbers.tobytes()))


NO_BODIES: dict[str, dict[str, bytes]] = {  # numbers that a conversion would change in silence
    "weights of vertex 0 sum to inf": {"weights": single(1e308, "f8", N, K)},
    "J_regressor of joint 0 sum to inf": {"J_regressor": single(1e308, "f8", K, N)},
    "f must hold whole numbers": {"f": single(1e300, "f8", 4, 3)},
    "f must hold": {"f": single(np.nan, "f8", 4, 3)},
    "face 0 is [-2": {"f": single(2**64 - 2, "u8", 4, 3)},
    "face 0 is": {"f": single(2**63 - 1, "i8", 4, 3)},
    "is not finite (18 such": {"v_template": single(np.nan, "f8", N, 3)},
    "weights holds bool": {"weights": array(N, K, of="b1")},
}


def test_numbers_of_no_body_are_named(reader: Reader, tmp_path: Path) -> None:
    for says, changed in NO_BODIES.items():
        assert says in refused(reader, tmp_path, body(**changed))
