"""What is said of a pickle: short and printable, whatever the file holds; and of its numbers."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.hardening.pickle_bombs import (
    SIZES,
    ZEROS,
    K,
    N,
    array,
    array_of,
    body,
    chumpy,
    content,
    dictionary,
    dtype,
    pickled,
    sparse,
    text,
)
from tests.hardening.pickled_bodies import refused
from tests.hardening.within_limits import Reader
from workbench.bodies.catalogue import load_body
from workbench.errors import BadFile

# Messages, whatever the file holds.

LONG = "x" * 1_000_000
SAYING: dict[str, tuple[Callable[[], bytes], str]] = {
    "a long name": (lambda: pickled(b"cos\n" + LONG.encode() + b"\n"), "a name of 1,000,002 chara"),
    "a name of a million dots": (
        lambda: pickled(b"cchumpy" + b".a" * 10**6 + b"\nb\n"),
        "a name of 2,000,007 characters",
    ),
    "a name that no terminal prints": (
        lambda: pickled(text("os\x1b[31m\x07\n") + text("\ud800") + b"\x93"),
        r"asks for os\\x1b\[31m\\x07\\n.\\ud800, which",
    ),
    "a long line that is no number": (lambda: pickled(b"I" + LONG.encode() + b"\n"), "damaged"),
    "a long line that is no real number": (
        lambda: pickled(b"F" + LONG.encode() + b"\n"),
        "could not convert .*xxx\\.\\.\\.",
    ),
    "a long line of digits": (lambda: pickled(b"L" + b"9" * 10**6 + b"L\n"), "digits"),
    "a text without its quotes": (lambda: pickled(b"S" + LONG.encode() + b"\n"), "damaged"),
    "the code of a type": (
        lambda: body(weights=array_of(SIZES, dtype(text("f8" + LONG)), ZEROS)),
        "an array of type 'f8xxx.*xxx\\.\\.\\.', not of numbers",
    ),
    "the type of a column": (
        lambda: body(weights=array_of(SIZES, dtype(text("V8")), ZEROS)),
        "type 'V8', not of numbers",
    ),
    "9,000 entries": (
        lambda: pickled(dictionary({f"e{i}": b"N" for i in range(9000)})),
        r"it has e0, e1, e10, .*, and 8,\d\d\d more",
    ),
    "long entries": (
        lambda: pickled(dictionary({f"{i}" + "x" * 190: b"N" for i in range(9)})),
        "0xxx.*xxx.*, and . more",
    ),
    "an entry that no terminal prints": (
        lambda: pickled(dictionary({"\x1b[2J\x07": b"N"})),
        r"it has \\x1b\[2J\\x07\. ",
    ),
    "an entry that is half a surrogate": (
        lambda: pickled(dictionary({"\udc80": b"N"})),
        "surrogates not allowed",
    ),
    "a style of skinning": (lambda: body(bs_style=text(LONG)), r"by bs_style 'xxx.*\.\.\.'; there"),
    "a body's name": (lambda: body(name=text(LONG)), "name holds a name of 1,000,000 characters"),
    "a gender": (lambda: body(gender=text(LONG)), "gender holds a name of 1,000,000 characters"),
    "a gender that no terminal prints": (
        lambda: body(weights=b"N", gender=text("\ud800")),
        "weights is a NoneType",
    ),
    "names of joints": (
        lambda: body(joint_names=array(K, of="U9", holds=content(b"\xff" * 36 * K))),
        "joint_names must be a list of names",
    ),
    "a card of lists in lists": (
        lambda: body(card=text("[" * 200_000)),
        "its card is no JSON .*recursion",
    ),
    "a card of a long number": (
        lambda: body(card=text('{"a": ' + "9" * 10**6 + "}")),
        "its card is no JSON .*digits",
    ),
    "a card that is a list": (lambda: body(card=text("[]")), "its card is a list, not an object"),
}


@pytest.mark.parametrize("name", SAYING)
def test_messages_are_short_and_printable(bodies: Reader, tmp_path: Path, name: str) -> None:
    make, says = SAYING[name]
    said = refused(bodies, tmp_path, make())
    assert re.search(says, said), said


# Numbers that a conversion would warn of, or would turn into others in silence.


def single(value: object, of: str, *shape: int) -> bytes:
    """An array of one number again and again."""
    numbers = np.full(shape, value, dtype=of)
    return array(*shape, of=of, holds=content(numbers.tobytes()))


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"weights": single(1e308, "f8", N, K)}, "weights of vertex 0 sum to inf"),
        ({"weights": single(np.longdouble("1e4000"), "f16", N, K)}, "weights.* is not finite"),
        ({"J_regressor": single(1e308, "f8", K, N)}, "J_regressor of joint 0 sum to inf"),
        ({"J_regressor": single(np.longdouble("1e4000"), "f16", K, N)}, "J_regressor holds"),
        ({"f": single(1e300, "f8", 4, 3)}, "f must hold whole numbers"),
        ({"f": single(np.inf, "f2", 4, 3)}, "f must hold whole numbers"),
        ({"f": single(np.nan, "f8", 4, 3)}, "f must hold whole numbers"),
        ({"f": single(2**64 - 2, "u8", 4, 3)}, r"face 0 is \[-2"),
        ({"f": single(2**63 - 1, "i8", 4, 3)}, "face 0 is"),
        ({"v_template": single(np.nan, "f8", N, 3)}, r"template\[0, 0\] is not finite \(18 such"),
        ({"weights": array(N, K, of="b1")}, "weights holds bool, but must hold numbers"),
        ({"weights": array(N, K, of="S8")}, r"weights holds \|S8, but must hold numbers"),
        (
            {"weights": chumpy("Select", a=array(9, of="S8"), idxs=array(1, of="i8"))},
            r"made of \|S8, not of numbers",
        ),
        (
            {
                "J_regressor": sparse(
                    "csc",
                    1,
                    1,
                    data=array(1, of="S1"),
                    indices=array(1, of="i4"),
                    indptr=array(2, of="i4"),
                )
            },
            r"made of \|S1, not of numbers",
        ),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else value[:30],
)
def test_numbers_that_are_no_body_s(
    bodies: Reader, tmp_path: Path, changed: dict[str, bytes], says: str
) -> None:
    longer = any(b"f16" in pushed for pushed in changed.values())
    if longer and np.dtype(np.longdouble).itemsize != 16:
        pytest.skip("this processor has no numbers of 16 bytes")
    said = refused(bodies, tmp_path, body(**changed))
    assert re.search(says, said), said


def test_a_pipe_is_no_body(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "model.pkl")
    with pytest.raises(BadFile, match="is a pipe or a device; give a file"):
        load_body(tmp_path / "model.pkl")


def test_a_card_may_hold_anything(bodies: Reader, tmp_path: Path) -> None:
    """`left_out` is a list in cards of the workbench; this file has one more entry to be named."""
    card = text(json.dumps({"left_out": 5, "name": [], "provenance": {}}))
    (tmp_path / "model.pkl").write_bytes(body(card=card, J=array(3)))
    assert bodies.within_limits(tmp_path / "model.pkl").kind == "read"
