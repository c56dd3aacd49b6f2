"""Archives of arrays that are damaged or were made to do harm, each from a good one."""

import io
import struct
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.hostile.mutations import members

Members = dict[str, bytes]  # the files of an archive by name
Damage = Callable[[bytes], bytes]


def packed(found: Members, how: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", how) as archive:
        for name, content in found.items():
            archive.writestr(name, content)
    return file.getvalue()


def npy(array: object) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=True)
    return file.getvalue()


def arrays_in(whole: bytes) -> dict[str, NDArray[Any]]:
    with np.load(io.BytesIO(whole), allow_pickle=False) as file:
        return dict(file)


def with_arrays(whole: bytes, changed: Mapping[str, object]) -> bytes:
    """The archive with some arrays being others; None takes one out."""
    found = members(whole)
    for name, array in changed.items():
        found.pop(f"{name}.npy", None)
        if array is not None:
            found[f"{name}.npy"] = npy(array)
    return packed(found)


def first_member(change: Callable[[bytes], bytes]) -> Damage:
    """A damage of the first array alone, packed anew, so that its checksum is right."""

    def damage(whole: bytes) -> bytes:
        found = members(whole)
        name = next(iter(found))
        return packed(found | {name: change(found[name])})

    return damage


def headed(header: str, version: tuple[int, int] = (1, 0), length: int | None = None) -> Damage:
    """Another header before the numbers of the first array."""

    def change(content: bytes) -> bytes:
        old = 10 + struct.unpack("<H", content[8:10])[0]
        new = header.encode("latin1") + b"\n"
        code = "<H" if version == (1, 0) else "<I"
        size = struct.pack(code, len(new) if length is None else length)
        return b"\x93NUMPY" + bytes(version) + size + new + content[old:]

    return first_member(change)


def in_the_directory(offset: int, value: bytes) -> Damage:
    """Bytes of the first entry of the archive's directory being others."""

    def damage(whole: bytes) -> bytes:
        at = whole.find(b"PK\x01\x02") + offset
        return whole[:at] + value + whole[at + len(value) :]

    return damage


def _torn(whole: bytes) -> bytes:
    """Packed numbers in the middle of the first array are others."""
    start = 30 + struct.unpack("<H", whole[26:28])[0] + struct.unpack("<H", whole[28:30])[0]
    name = next(iter(members(whole)))
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        size = archive.getinfo(name).compress_size
    middle = start + size // 2
    torn = bytes(b ^ 0xFF for b in whole[middle : middle + 8])
    return whole[:middle] + torn + whole[middle + 8 :]


def _doubled(whole: bytes) -> bytes:
    found = members(whole)
    name = next(iter(found))
    other = "x" * len(name)  # zipfile warns of writing the same name twice
    return packed({**found, other: found[name]}).replace(other.encode(), name.encode())


GOOD = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }"
HEADERS: dict[str, str] = {
    "a header that never ends": "{'descr': '<f8', 'shape': (",
    "a header with other keys": "{'descr': '<f8', 'shape': (3,)}",
    "three thousand signs": "-" * 3000 + "1",
    "a number of five thousand digits": "9" * 5000,
    "ten milliard numbers": GOOD.replace("3,", "10000000000,"),
    "more numbers than can be counted": GOOD.replace("3,", "4611686018427387904, 8"),
    "a shape beyond any number": GOOD.replace("3,", f"{10**30}, 0"),
    "a shape below zero": GOOD.replace("3,", "-1,"),
    "numbers of no bytes": GOOD.replace("3,", "1000000000000,").replace("<f8", "<U0"),
    "arrays in an array": GOOD.replace("'<f8'", "('<f8', (3,))"),
    "columns": GOOD.replace("'<f8'", "[('x', '<f8'), ('y', '<i4')]"),
    "a type that does not exist": GOOD.replace("<f8", "<Q9"),
}
LETTERS = npy(np.frombuffer(b"\xff\xff\xff\x7f" * 3, "<U3"))
DAMAGES: dict[str, Damage] = {
    "text": lambda whole: b"no archive at all",
    "one array and no archive": lambda whole: npy(np.zeros(3)),
    "a pickle": lambda whole: b"\x80\x04K\x01.",
    "without its last byte": lambda whole: whole[:-1],
    "cut after the first bytes": lambda whole: whole[:20],
    "directory missing": lambda whole: whole[: whole.find(b"PK\x01\x02")],
    "packed numbers torn": _torn,
    "checksum of another": in_the_directory(16, b"\0\0\0\0"),
    "unknown way of packing": in_the_directory(10, b"\x63\0"),
    "with a password": in_the_directory(8, b"\x01\0"),
    "claims to unpack to 4 GB": in_the_directory(24, b"\xfe\xff\xff\xff"),
    "packed with LZMA": lambda whole: packed(members(whole), zipfile.ZIP_LZMA),
    "packed with bzip2": lambda whole: packed(members(whole), zipfile.ZIP_BZIP2),
    "two arrays of one name": _doubled,
    "no arrays": lambda whole: packed({"readme.txt": b"nothing"}),
    "no numpy array": first_member(lambda content: b"x" + content[1:]),
    "an unknown version": headed(GOOD, (9, 1)),
    "a header longer than the file": headed("{}", (2, 0), 2**31),
    "one number less than it says": first_member(lambda content: content[:-1]),
    "more numbers than it says": first_member(lambda content: content + bytes(8)),
    "letters that are none": first_member(lambda content: LETTERS),
    **{name: headed(header) for name, header in HEADERS.items()},
}
