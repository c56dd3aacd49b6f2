"""Archives of arrays: each reader refuses what is damaged, contradicts itself, or is a bomb."""

import io
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.hostile.archives import DAMAGES, arrays_in, with_arrays
from tests.hostile.formats import FORMATS, ask, whole
from tests.hostile.limits import REFUSED, Reader
from tests.tiers import few
from workbench.errors import WorkbenchError
from workbench.solvers import Solution

MB = 2**20


def refusal(name: str, folder: Path, file: str, content: bytes) -> str:
    """The sentence with which a format is refused if one of its files has another content."""
    for other, kept in whole(name).items():
        path = folder / other
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if other == file else kept)
    with pytest.raises(WorkbenchError) as caught:
        FORMATS[name].read(folder)
    told = str(caught.value)
    assert len(told) < 1500
    assert Path(file).stem in told
    return told


def test_damaged_archives_are_refused(tmp_path: Path) -> None:
    (tmp_path / "fit.npz").write_bytes(with_arrays(whole("solution.npz")["fit.npz"], {}))
    Solution.load(tmp_path / "fit.npz")  # packed anew, and whole
    for name, damage in DAMAGES.items():
        damaged = damage(whole("solution.npz")["fit.npz"])
        assert damaged != whole("solution.npz")["fit.npz"], name
        told = refusal("solution.npz", tmp_path, "fit.npz", damaged)
        assert "fit.npz" in told, name
        assert "\n" not in told, name


Change = Callable[[dict[str, Any]], dict[str, object]]  # arrays of a file -> those that change
CONTRADICTIONS: dict[str, tuple[str, dict[str, Change]]] = {  # each array alone might be right
    "SMPL.npz": (
        "SMPL.npz",
        {
            "faces of no vertices": lambda a: {"f": a["f"] + 30},
            "weights of another size": lambda a: {"weights": np.ones((30, 5)) / 5},
            "weights that do not sum to one": lambda a: {"weights": 2 * a["weights"]},
            "a card of brackets": lambda a: {"card": np.array("[" * 100_000)},
            "another way of skinning": lambda a: {"bs_style": np.array("x" * 10**6)},
        },
    ),
    "training-start": (
        "start.npz",
        {
            "a template of another unit": lambda a: {"template": 1e9 * a["template"]},
            "a parent after its child": lambda a: {"parents": a["parents"][::-1]},
            "a segment beyond the joints": lambda a: {"segmentation": a["segmentation"] + 1},
            "two joints of one name": lambda a: {
                "joint_names": a["joint_names"][[0, 0, *range(22)]]
            },
        },
    ),
    "draws.npz": (
        "draws.npz",
        {
            "settings that are no JSON": lambda a: {"settings": np.array("{seed")},
            "no draws": lambda a: {"chain_0": a["chain_0"][:0], "log_prob_0": a["log_prob_0"][:0]},
            "more accepted moves than steps": lambda a: {"accepted_1": np.full(4, 6.0)},
        },
    ),
    "body.npz": (
        "body.npz",
        {
            "landmarks beyond the mesh": lambda a: {"landmarks/one/indices": np.full(5, 999)},
            "landmarks of a huge matrix": lambda a: {"landmarks/one/shape": np.array([2**62] * 2)},
        },
    ),
}


@pytest.mark.parametrize("name", few(CONTRADICTIONS, 3))
def test_arrays_that_contradict_each_other_are_refused(name: str, tmp_path: Path) -> None:
    file, wrong = CONTRADICTIONS[name]
    content = whole(name)[file]
    for change in wrong.values():
        refusal(name, tmp_path, file, with_arrays(content, change(arrays_in(content))))


# Archives that shrink a thousand times.


def bomb(whole: bytes, name: str, descr: str, shape: tuple[int, ...], fill: bytes = b"\0") -> bytes:
    """An archive in which an array of one repeated value is in the place of what it held."""
    start = io.BytesIO()
    told = {"descr": descr, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(start, told)
    size = int(np.prod(shape, dtype=object)) * np.dtype(descr).itemsize
    piece = fill * (12 * MB // len(fill))
    pieces = [start.getvalue(), *[piece] * (size // len(piece)), piece[: size % len(piece)]]
    content, checksum, known = b"", 0, {}
    for one in pieces:
        checksum = zlib.crc32(one, checksum)
        if id(one) not in known:
            known[id(one)] = deflated(one, zlib.Z_FULL_FLUSH)
        content += known[id(one)]
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(file, "w") as archive:
        for other in set(old.namelist()) - {f"{name}.npy"}:
            archive.writestr(other, old.read(other))
        archive.writestr(f"{name}.npy", content + deflated(b"", zlib.Z_FINISH))
        member = archive.getinfo(f"{name}.npy")  # from which the directory is written at the end
        member.compress_type, member.CRC = zipfile.ZIP_DEFLATED, checksum
        member.file_size = len(start.getvalue()) + size
    return file.getvalue()


def deflated(content: bytes, how: int) -> bytes:
    """What comes after it does not depend on it: pieces can be repeated."""
    deflating = zlib.compressobj(9, zlib.DEFLATED, -15)
    return deflating.compress(content) + deflating.flush(how)


def members_without_number(whole: bytes) -> bytes:
    """An archive whose directory has a hundred thousand entries, all for the same bytes."""
    at, end = whole.find(b"PK\x01\x02"), whole.rfind(b"PK\x05\x06")
    length = 46 + sum(int.from_bytes(whole[at + k : at + k + 2], "little") for k in (28, 30, 32))
    directory = whole[at : at + length] * 100_000
    return (
        whole[:at]
        + directory
        + whole[end:][:12]
        + len(directory).to_bytes(4, "little")
        + (whole[end:][16:])
    )


LISTS = "".join(f"{letter}\0\0\0" for letter in "[],").encode()  # an empty list, as numpy has it
BOMBS: dict[str, tuple[str, str, str, str, tuple[int, ...], bytes]] = {
    "zeros beside a body": ("SMPL.npz", "SMPL.npz", "further", "<f8", (80_000_000,), b"\0"),
    "bytes to be widened": ("SMPL.npz", "SMPL.npz", "shapedirs", "|i1", (30, 3, 4_000_000), b"\0"),
    "a card of empty lists": ("SMPL.npz", "SMPL.npz", "card", "<U40000000", (), LISTS),
    "poses": ("training-checkpoint", "checkpoint.npz", "poses", "<f8", (9_000_000, 3, 3), b"\0"),
    "blend shapes": ("embedded.npz", "small.npz", "shapedirs", "<i2", (369, 3, 90_000), b"\0"),
}


@pytest.mark.parametrize("name", few(BOMBS, 1))
def test_zip_bombs_are_refused_before_memory_is_taken(
    name: str, reader: Reader, tmp_path: Path
) -> None:
    format, file, array, descr, shape, fill = BOMBS[name]
    content = bomb(whole(format)[file], array, descr, shape, fill)
    assert len(content) < 8 * MB
    answer = ask(reader, format, tmp_path, file, content)
    assert answer.outcome == REFUSED, answer.what


@pytest.mark.thorough
def test_archives_of_too_many_members_are_refused(reader: Reader, tmp_path: Path) -> None:
    content = members_without_number(whole("truth.npz")["truth.npz"])
    answer = ask(reader, "truth.npz", tmp_path, "truth.npz", content)
    assert answer.outcome == REFUSED
    assert "directory" in answer.what
