"""Valid files with one to a few things wrong, drawn from a seed."""

import io
import json
import os
import pickle
import pickletools
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Rng = np.random.Generator
Mutation = Callable[[bytes, Rng], bytes]

LARGEST = 2**24  # bytes: what a large file may take is another question
NUMBERS = (
    *("0", "-1", "1", "2147483648", "-9223372036854775809", "1e999", "-1e308", "1e-320", "nan"),
    *("NaN", "Infinity", "-inf", "0.1", "1_0", "0x10", "9" * 400, "9" * 5000, "", " ", "1,5"),
    *("é", "\x00", "true", "null", '"', "[", "{", "0/1", "1/2/3", "3 0 1 2"),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 0.5, 2**31, 2**63, -(2**64), 10**400, 1e308),
    *(float("nan"), float("inf"), "", "0", "nan", "CONVERGED", "é" * 50, "\x00", "x" * 3000),
    *([], [[]], [None], {}, {"": None}, [0] * 17, [1e300] * 3, [[1, 2], [3]], {"a": {"b": [1]}}),
)
DTYPES = ("<f2", "<f8", ">f4", "<i1", "<u8", "?", "<c16", "<U3", "S2", "<M8[s]", "<m8[D]")
WORDS = (b"os", b"system", b"numpy", b"builtins", b"eval", b"ndarray", b"csc_matrix", b"chumpy.ch")


def mutated(name: str, content: bytes, rng: Rng) -> bytes:
    """Another content for the file of that name: its structure is broken, or its bytes are."""
    known = BY_SUFFIX.get(name[name.rfind(".") :], ())
    for _ in range(rng.geometric(0.6)):
        mutations = known if known and rng.random() < 0.6 else BYTES
        mutate = mutations[rng.integers(len(mutations))]
        try:
            content = mutate(content, rng)
        except Exception:  # it is broken already, so that its structure cannot be taken apart
            content = flipped(content, rng)
        if len(content) > LARGEST:
            content = content[:LARGEST]
    return content


# ---- bytes -------------------------------------------------------------------------------------


def _place(content: bytes, rng: Rng) -> int:
    """Headers are where most can go wrong: every other place is near the start or the end."""
    n = len(content)
    near = int(min(n, 1 + rng.exponential(60)))
    return int(rng.choice((rng.integers(n + 1), rng.integers(n + 1), near, max(0, n - near))))


def flipped(content: bytes, rng: Rng) -> bytes:
    """Some bits are others."""
    changed = bytearray(content or b"\0")
    for _ in range(rng.integers(1, 8)):
        changed[min(_place(content, rng), len(changed) - 1)] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def cut(content: bytes, rng: Rng) -> bytes:
    """The end is missing."""
    return content[: _place(content, rng)]


def doubled(content: bytes, rng: Rng) -> bytes:
    """A piece stands twice, or somewhere else."""
    at, to, size = _place(content, rng), _place(content, rng), int(rng.integers(1, 256))
    return content[:to] + content[at : at + size] + content[to:]


def strewn(content: bytes, rng: Rng) -> bytes:
    """A piece is noise, zeros or ones."""
    at, size = _place(content, rng), int(rng.integers(1, 64))
    new = (rng.bytes(size), b"\0" * size, b"\xff" * size)[rng.integers(3)]
    return content[:at] + new + content[at + size * int(rng.integers(2)) :]


BYTES: tuple[Mutation, ...] = (flipped, cut, doubled, strewn)


# ---- text --------------------------------------------------------------------------------------


def line_changed(content: bytes, rng: Rng) -> bytes:
    """A line is missing, twice, elsewhere, empty or very long."""
    lines = content.split(b"\n")
    at, to = rng.integers(len(lines), size=2)
    others = ([], [lines[at]] * 2, [lines[to]], [b""], [lines[at] * int(rng.integers(2, 400))])
    lines[at : at + 1] = others[rng.integers(5)]
    return b"\n".join(lines)


def word_changed(content: bytes, rng: Rng) -> bytes:
    """A word is another one, or a number that few expect."""
    words = list(re.finditer(rb"[^\s,\[\]{}()=:]+", content))
    word = words[rng.integers(len(words))]
    other = words[rng.integers(len(words))][0]
    new = NUMBERS[rng.integers(len(NUMBERS))].encode() if rng.random() < 0.7 else other
    return content[: word.start()] + new + content[word.end() :]


# ---- JSON --------------------------------------------------------------------------------------


def json_changed(content: bytes, rng: Rng) -> bytes:
    """Some value in a JSON text is of another type or size, or not there; or an endless nest."""
    if rng.random() < 0.03:
        depth = int(rng.choice((100, 5_000, 200_000)))
        return b"[" * depth + content + b"]" * depth
    data = json.loads(content)
    places: list[tuple[Any, Any]] = []
    pending = [data]
    while pending:
        here = pending.pop()
        keys = list(here) if isinstance(here, dict) else range(len(here))
        places += [(here, key) for key in keys]
        pending += [here[key] for key in keys if isinstance(here[key], (dict, list)) and here[key]]
    where, key = places[rng.integers(len(places))]
    match rng.integers(4):
        case 0:
            del where[key]
        case 1 if isinstance(where, dict):
            where["unheard of"] = where.pop(key)
        case 2:
            other, another = places[rng.integers(len(places))]
            where[key] = json.loads(json.dumps(other[another]))
        case _:
            where[key] = VALUES[rng.integers(len(VALUES))]
    return json.dumps(data).encode()


# ---- archives of arrays ------------------------------------------------------------------------


def array_changed(content: bytes, rng: Rng) -> bytes:
    """An array in an archive has another type, shape, content or name; the archive is whole."""
    inside = members(content)
    name = list(inside)[rng.integers(len(inside))]
    match rng.integers(8):
        case 0:
            del inside[name]
        case 1:
            inside[name + "x"] = inside.pop(name)
        case 2:
            other = list(inside)[rng.integers(len(inside))]
            inside[name], inside[other] = inside[other], inside[name]
        case 3:
            inside[name] = npy_changed(inside[name], rng)
        case 4:
            inside[name] = BYTES[rng.integers(len(BYTES))](inside[name], rng)
        case _:
            inside[name] = _another(inside[name], rng)
    return _packed(inside, rng)


def members(content: bytes) -> dict[str, bytes]:
    """The files in an archive by name."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist()}


def _packed(inside: dict[str, bytes], rng: Rng) -> bytes:
    file = io.BytesIO()
    method = (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED, zipfile.ZIP_BZIP2)[rng.choice(3, p=_HOW)]
    with zipfile.ZipFile(file, "w") as archive:
        for name, member in inside.items():
            info = zipfile.ZipInfo(name)  # of a fixed date: a seed means the same bytes on any day
            info.compress_type = method
            archive.writestr(info, member)
    return file.getvalue()


_HOW = (0.6, 0.35, 0.05)


def npy_changed(content: bytes, rng: Rng) -> bytes:
    """A header of an array says something else than what follows."""
    length = int.from_bytes(content[8:10], "little")
    header, rest = content[10 : 10 + length], content[10 + length :]
    shapes = b"() (-1,) (0,) (9999999999,) (99999,99999,9) (1.5,) 3 (".split()
    types = (b"'|O'", b"'<U999999999'", b"'<f3'", b"[('a', '<f8')]", b"'V9'", b"None", b"'<f16'")
    match rng.integers(4):
        case 0:
            header = re.sub(rb"\([^)]*\)", lambda _: shapes[rng.integers(len(shapes))], header)
        case 1:
            header = re.sub(rb"'[<>|][^']*'", lambda _: types[rng.integers(len(types))], header)
        case 2:
            header = word_changed(header, rng)
        case _:
            header = flipped(header, rng)
    return content[:8] + len(header).to_bytes(2, "little") + header + rest


def _another(content: bytes, rng: Rng) -> bytes:
    """An array like that one, but with something wrong in it."""
    array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    if array.dtype.kind == "U" and not array.ndim and str(array)[:1] in ("{", "["):
        text = (json_changed, word_changed)[rng.integers(2)](str(array).encode(), rng)
        new = np.array(text.decode(errors="replace"))
    else:
        with np.errstate(all="ignore"):
            new = WRONG[rng.integers(len(WRONG))](array.copy(), rng)
    file = io.BytesIO()
    np.lib.format.write_array(file, new, allow_pickle=False)
    return file.getvalue()


def _spoiled(array: np.ndarray, rng: Rng) -> np.ndarray:
    """One number is none, infinite, huge, or at an edge of its range."""
    if array.size and array.dtype.kind in "fiu":
        whole = array.dtype.kind != "f"
        edges = (np.iinfo(array.dtype).max, np.iinfo(array.dtype).min, 0) if whole else ODD
        array.flat[rng.integers(array.size)] = edges[rng.integers(len(edges))]
    return array


ODD = (np.nan, np.inf, -np.inf, 1e300, -1.0)
WRONG: tuple[Callable[[np.ndarray, Rng], np.ndarray], ...] = (
    *(_spoiled, _spoiled),
    lambda array, rng: array[..., None],
    lambda array, rng: array[:-1] if array.ndim else array[None],
    lambda array, rng: array.ravel(),
    lambda array, rng: np.concatenate([array, array]) if array.ndim else array,
    lambda array, rng: np.zeros((0, *array.shape[1:]), array.dtype),
    lambda array, rng: array[..., :1] if array.ndim else array,
    lambda array, rng: array.astype(DTYPES[rng.integers(len(DTYPES))]),
)


# ---- pickles -----------------------------------------------------------------------------------


def opcode_changed(content: bytes, rng: Rng) -> bytes:
    """Instructions of a pickle are missing, doubled, exchanged, or name something else."""
    starts = [at for _, _, at in pickletools.genops(content)]
    parts = [content[a:b] for a, b in zip(starts, [*starts[1:], len(content)], strict=True)]
    at, to = rng.integers(len(parts), size=2)
    old, new = WORDS[rng.integers(len(WORDS))], WORDS[rng.integers(len(WORDS))]
    renamed, many = parts[at].replace(old, new), int(rng.integers(2, 300))
    others = ([], [parts[at]] * 2, [parts[to]], [parts[at]] * many, [renamed])
    parts[at : at + 1] = others[rng.integers(5)]
    return b"".join(parts)


# ---- claims and traps --------------------------------------------------------------------------


class Trap:
    """What makes a file where it is unpickled by Python."""

    def __init__(self, marker: Path) -> None:
        self.marker = str(marker)

    def __reduce__(self) -> Any:
        return os.mkdir, (self.marker,)


def trapped(name: str, content: bytes, marker: Path) -> bytes | None:
    """A file that makes a marker where a pickle in it is run; None if it can hold no pickle."""
    if name.endswith((".pkl", ".joblib")):
        return b"\x80\x02" + pickle.dumps(Trap(marker), 2)[2:-1] + b"0" + content[2:]
    held = io.BytesIO()
    np.save(held, np.array([Trap(marker)] * 2, dtype=object), allow_pickle=True)
    if name.endswith(".npy"):
        return held.getvalue()
    if name.endswith((".npz", ".smpl")):
        return _packed(dict.fromkeys(members(content), held.getvalue()), np.random.default_rng(0))
    return None


def overstated(name: str, content: bytes) -> bytes:
    """A file that claims to hold billions of numbers, where its format says how many there are."""
    many = b"3000000000"
    if name.endswith(".npy"):
        return re.sub(rb"'shape': \([0-9]*,?", b"'shape': (" + many + b",", content, count=1)
    if name.endswith((".npz", ".smpl")):
        inside = members(content)
        array = max(inside, key=lambda one: len(inside[one]))
        claims = re.sub(rb"\([0-9]*,? *", b"(" + many + b",", inside[array][10:], count=1)
        header = claims.split(b"\n", 1)[0]
        inside[array] = inside[array][:8] + (len(header) + 1).to_bytes(2, "little") + claims
        return _packed(inside, np.random.default_rng(0))
    if name.endswith(".json"):
        return b"[" + b"[]," * 3_000_000 + content + b"]"
    if name.endswith(".toml"):
        return b"#" * 2_000_000 + b"\n" + content
    if name.endswith((".glb", ".stl", ".c3d", ".pkl")):
        at = {".glb": 12, ".stl": 80, ".c3d": 2}.get(name[name.rfind(".") :], 300)
        return content[:at] + b"\xff" * 4 + content[at + 4 :]
    return re.sub(rb"(?<=[\s#,])[1-9][0-9]*(?=[\s,])", many, content, count=2)


TEXT: tuple[Mutation, ...] = (line_changed, word_changed)
BY_SUFFIX: dict[str, tuple[Mutation, ...]] = {
    **dict.fromkeys((".npz", ".smpl"), (array_changed,)),
    ".npy": (npy_changed,),
    ".json": (json_changed, json_changed, *TEXT),
    ".pkl": (opcode_changed,),
    **dict.fromkeys((".toml", ".csv", ".obj", ".off", ".ply", ".stl", ".py", ".bvh", ".trc"), TEXT),
    **dict.fromkeys((".xyz", ".pcd", ".gltf", ".yml", ".xml", ".txt"), TEXT),
    ".glb": (*TEXT,),
}
