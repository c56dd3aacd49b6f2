"""Pickles written by hand, instruction by instruction: small files that ask for very much."""

import struct
from collections.abc import Mapping
from functools import reduce

from tests.bodies.random_bodies import entries

RECONSTRUCT = b"cnumpy.core.multiarray\n_reconstruct\n"
NO_ARRAY_YET = RECONSTRUCT + b"(cnumpy\nndarray\nK\x00\x85U\x01btR"
N, K = 6, 3  # vertices and joints of the body that is changed
FREE = 250  # a place of the memo that nothing else here uses


def text(value: str | bytes) -> bytes:
    """A text, pushed."""
    encoded = value.encode("utf-8", "surrogatepass") if isinstance(value, str) else value
    return b"X" + struct.pack("<I", len(encoded)) + encoded


def content(value: bytes) -> bytes:
    """Bytes, pushed."""
    return b"B" + struct.pack("<I", len(value)) + value


def whole(number: int) -> bytes:
    """A whole number of any length, pushed."""
    size = number.bit_length() // 8 + 1
    encoded = number.to_bytes(size, "little", signed=True)
    if size < 256:
        return b"\x8a" + bytes([size]) + encoded
    return b"\x8b" + struct.pack("<i", size) + encoded


def several(*values: bytes) -> bytes:
    """A tuple, pushed."""
    return b"(" + b"".join(values) + b"t"


def listed(*values: bytes) -> bytes:
    """A list, pushed."""
    return b"(" + b"".join(values) + b"l"


def dictionary(entries: Mapping[str, bytes]) -> bytes:
    """A dictionary of texts to what pushes their values, pushed."""
    return b"}(" + b"".join(text(key) + value for key, value in entries.items()) + b"u"


def kept(value: bytes, place: int) -> bytes:
    """The same, remembered under a number."""
    return value + b"r" + struct.pack("<I", place)


def again(place: int) -> bytes:
    """What was remembered, pushed once more."""
    return b"j" + struct.pack("<I", place)


def dtype(code: bytes = text("f8"), order: bytes = text("<")) -> bytes:
    """A numpy.dtype, pushed."""
    made = b"cnumpy\ndtype\n" + several(code, b"K\x00", b"K\x01") + b"R"
    return made + several(b"K\x03", order, b"NNN", whole(-1), whole(-1), b"K\x00") + b"b"


def array(*sizes: int, of: str = "f8", holds: bytes | None = None) -> bytes:
    """An array, pushed: of zeros unless the instructions that push its bytes are given."""
    count = reduce(int.__mul__, sizes, 1) * int(of[1:])
    zeros = content(bytes(count)) if holds is None else holds
    return array_of(several(*map(whole, sizes)), dtype(text(of)), zeros)


def array_of(shape: bytes, kind: bytes, holds: bytes) -> bytes:
    """An array whose parts are pushed by what is given."""
    return NO_ARRAY_YET + several(b"K\x01", shape, kind, b"\x89", holds) + b"b"


def chumpy(name: str, **attributes: bytes) -> bytes:
    """A value of chumpy, pushed."""
    place = {"Ch": "ch"}.get(name, "reordering")
    return f"cchumpy.{place}\n{name}\n)\x81".encode("latin1") + dictionary(attributes) + b"b"


def sparse(kind: str, rows: int, columns: int, **parts: bytes) -> bytes:
    """A matrix of scipy, pushed."""
    shape = {"_shape": several(whole(rows), whole(columns))}
    name = f"cscipy.sparse.{kind}\n{kind}_matrix\n)\x81".encode("latin1")
    return name + dictionary(shape | parts) + b"b"


def one_entry(rows: int, columns: int) -> bytes:
    """A coo matrix with a zero in its corner, pushed."""
    corner = array(1, of="i4")
    return sparse("coo", rows, columns, data=array(1), row=corner, col=corner)


def pickled(pushed: bytes) -> bytes:
    """A whole file that says what is pushed."""
    return b"\x80\x02" + pushed + b"."


def doubled_tuples(levels: int = 200) -> bytes:
    """A tuple that holds a tuple twice, which holds one twice, ...: 2^200 in the end."""
    return b")" + b"2\x86" * levels


def doubled_lists(levels: int = 200) -> bytes:
    """The same of lists."""
    inner = b"0(" + again(FREE) * 2 + kept(b"l", FREE)
    return kept(b"]", FREE) + inner * levels


def deep_tuples(levels: int = 20_000) -> bytes:
    """A tuple in a tuple in a tuple."""
    return b")" + b"\x85" * levels


def deep_lists(levels: int = 20_000) -> bytes:
    """The same of lists."""
    return b"(" * levels + b"l" * levels


def in_itself() -> bytes:
    """A list that holds itself."""
    return kept(b"]", FREE) + again(FREE) + b"a"


def repeated(pushed: bytes, count: int) -> dict[str, bytes]:
    """Entries beside those of a body that all hold the same."""
    return {"e0": kept(pushed, FREE), **{f"e{i}": again(FREE) for i in range(1, count)}}


def selections(levels: int) -> bytes:
    """chumpy's Select of Select of ..., each made of the one before twice, of 16,000 zeros."""
    made = kept(array(16_000, of="u1"), FREE)
    for _ in range(levels):
        made += b"0" + kept(chumpy("Select", a=again(FREE), idxs=again(FREE)), FREE)
    return made


def of_one_content(count: int, size: int) -> dict[str, bytes]:
    """Arrays that all take their numbers from the same bytes."""
    first = array(size, holds=kept(content(bytes(8 * size)), FREE))
    others = {f"e{i}": array(size, holds=again(FREE)) for i in range(1, count)}
    return {"e0": first, **others}


def selected_again(count: int, size: int) -> dict[str, bytes]:
    """Selections that repeat the one entry of an array very often."""
    which = kept(array(size, of="u1"), FREE)
    first = chumpy("Select", a=array(1), idxs=which)
    others = {f"e{i}": chumpy("Select", a=array(1), idxs=again(FREE)) for i in range(1, count)}
    return {"e0": first} | others


def called_with_a_list(count: int, size: int) -> bytes:
    """Calls of which each copies a long list, if it is taken for a tuple."""
    call = b"cbuiltins\nobject\n" + again(FREE) + b"R0"
    return kept(listed(b"N" * size), FREE) + call * count


def keys_of(key: bytes, count: int) -> bytes:
    """One key set again and again, which is hashed or compared each time."""
    return kept(key, FREE) + b"0}" + (again(FREE) + b"Ns") * count


def colliding(count: int) -> bytes:
    """Whole numbers as keys that meet in the same places of a dictionary."""
    return b"}(" + b"".join(whole(i << 40) + b"N" for i in range(count)) + b"u"


def body(**changed: bytes) -> bytes:
    """The pickle of a small body with some of its entries changed, or others added."""
    good = {
        key: array(*value.shape, of=value.dtype.str[1:], holds=content(value.tobytes()))
        for key, value in entries(N, K, B=2).items()
    }
    return pickled(dictionary({**good, **changed}))


SIZES, ZEROS = several(whole(N), whole(K)), content(bytes(8 * N * K))  # of the weights
BOMBS = {  # that are put in the place of something else
    "tuples twice on every level": doubled_tuples(),
    "lists twice on every level": doubled_lists(),
    "chumpy values twice on every level": selections(200),
    "tuples in tuples": deep_tuples(),
    "lists in lists": deep_lists(),
    "a list in itself": in_itself(),
    "a long text": text("x" * 300_000),
    "a text of half a surrogate": text("\ud800" * 9),
    "long bytes": content(b"\xff" * 300_000),
    "a number of a million bytes": whole(2**8_000_000),
}
