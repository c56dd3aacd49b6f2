"""No archive of arrays makes its reader take more memory or time than a file of its size should.

Archives are made that shrink a thousand times, and read in a process that may take 1 GB more than
it has after its imports. What is read there in seconds takes none where it is refused.
"""

import io
import json
import subprocess
import sys
import textwrap
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.hardening.test_arrays import READERS, START, N, written

resource = pytest.importorskip("resource", reason="limits of memory are POSIX's")
MB = 2**20
SECONDS = 5.0


def bomb(path: Path, name: str, descr: str, shape: tuple[int, ...], fill: bytes = b"\0") -> None:
    """Put an array of one repeated value into an archive, in the place of what it held."""
    with zipfile.ZipFile(path) as archive:
        others = {n: archive.read(n) for n in archive.namelist() if n != f"{name}.npy"}
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    size = int(np.prod(shape, dtype=object)) * np.dtype(descr).itemsize
    piece = fill * (12 * MB // len(fill))
    pieces = [header.getvalue(), *[piece] * (size // len(piece)), piece[: size % len(piece)]]
    content, checksum, known = b"", 0, {}
    for one in pieces:
        checksum = zlib.crc32(one, checksum)
        if id(one) not in known:
            known[id(one)] = flushed(one, zlib.Z_FULL_FLUSH)
        content += known[id(one)]
    with zipfile.ZipFile(path, "w") as archive:
        for other, kept in others.items():
            archive.writestr(other, kept)
        archive.writestr(f"{name}.npy", content + flushed(b"", zlib.Z_FINISH))
        member = archive.getinfo(f"{name}.npy")  # from which the directory is written at the end
        member.compress_type, member.CRC = zipfile.ZIP_DEFLATED, checksum
        member.file_size = len(header.getvalue()) + size


def flushed(content: bytes, how: int) -> bytes:
    """Deflated, so that what comes after it does not depend on it: pieces can be repeated."""
    deflating = zlib.compressobj(9, zlib.DEFLATED, -15)
    return deflating.compress(content) + deflating.flush(how)


LISTS = "".join(f"{letter}\0\0\0" for letter in "[],").encode()  # an empty list, as numpy has it
BOMBS: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "bytes that would be widened": (
        "body",
        lambda path: bomb(path, "shapedirs", "|i1", (12, 3, 4_000_000)),
        "in memory",
    ),
    "template of bytes": (
        "body",
        lambda path: bomb(path, "v_template", "|i1", (50_000_000, 3)),
        "in memory",
    ),
    "zeros beside a body": (
        "body",
        lambda path: bomb(path, "further", "<f8", (80_000_000,)),
        "in memory",
    ),
    "weights of another size": (
        "body",
        lambda path: bomb(path, "weights", "<f4", (50_000_000, 1)),
        "weights has shape",
    ),
    "a card of empty lists": (
        "body",
        lambda path: bomb(path, "card", "<U40000000", (), LISTS),
        "in memory",
    ),
    "template of a start": (
        "start",
        lambda path: bomb(path, "template", "<f4", (30_000_000, 3)),
        "in memory",
    ),
    "segments as bytes": (
        "start",
        lambda path: bomb(path, "segmentation", "|u1", (80_000_000,)),
        "in memory",
    ),
    "a trace of another length": (
        "solution",
        lambda path: bomb(path, "trace:x", "<f8", (8_000_000, 2, 3)),
        "trace:x has",
    ),
    "facts of empty lists": (
        "solution",
        lambda path: bomb(path, "solution", "<U40000000", (), LISTS),
        "in memory",
    ),
    "facts of fewer empty lists": (
        "solution",
        lambda path: bomb(path, "solution", "<U20000000", (), LISTS),
        "lists and objects, too many",
    ),
    "a record's costs": (
        "record",
        lambda path: bomb(path, "trace", "<f8", (8_000_000, 9)),
        "counts as none",
    ),
    "poses of a checkpoint": (
        "checkpoint",
        lambda path: bomb(path, "poses", "<f8", (3_000_000, 6, 3)),
        "(4, 6, 3)",
    ),
    "vertices of a registration": (
        "registration",
        lambda path: bomb(path, "vertices", "<f4", (20_000_000, 3)),
        f"({N}, 3)",
    ),
    "blend shapes of an embedded body": (
        "embedded body",
        lambda path: bomb(path, "shapedirs", "<i2", (369, 3, 90_000)),
        "in memory",
    ),
    "angles of a recording": (
        "recording",
        lambda path: bomb(path, "poses", "<f4", (1_200_000, 72)),
        "in memory",
    ),
    "components of a mixture": (
        "mixture",
        lambda path: bomb(path, "means", "<f4", (8, 9_000_000)),
        "in memory",
    ),
    "as many members as there is room for": (
        "truth",
        lambda path: members_without_number(path),
        "directory",
    ),
}


def members_without_number(path: Path) -> None:
    """An archive whose directory has a hundred thousand entries, all for the same bytes."""
    whole = path.read_bytes()
    at, end = whole.find(b"PK\x01\x02"), whole.rfind(b"PK\x05\x06")
    length = 46 + sum(int.from_bytes(whole[at + k : at + k + 2], "little") for k in (28, 30, 32))
    directory = whole[at : at + length] * 100_000
    tail = bytearray(whole[end:])
    tail[12:16] = len(directory).to_bytes(4, "little")
    path.write_bytes(whole[:at] + directory + bytes(tail))


READ = """
    import json, resource, sys, time
    from pathlib import Path
    from tests.hardening.test_arrays import READERS

    def now():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[0]) * resource.getpagesize()

    for name, path, whole in json.load(sys.stdin):
        READERS[name].read(Path(whole))  # what is imported or built once is there now
        limit = now() + 2**30
        before = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
        began, said = time.process_time(), "it was read"
        try:
            READERS[name].read(Path(path))
        except Exception as error:
            said = f"{type(error).__module__}: {error}"
        seconds = time.process_time() - began
        resource.setrlimit(resource.RLIMIT_AS, before)
        print(json.dumps([said, seconds]), flush=True)
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, float]]:
    """What one process says to all of them, and after how many seconds."""
    folder, jobs = tmp_path_factory.mktemp("bombs"), []
    for number, (name, make, _) in enumerate(BOMBS.values()):
        folders = folder / f"{number}", folder / f"{number} whole"
        for one in folders:
            one.mkdir()
        path, whole = (written(READERS[name], one) for one in folders)
        make(path)
        assert path.stat().st_size < 8 * MB
        jobs.append((name, str(path), str(whole)))
    ended = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(READ)],
        input=json.dumps(jobs),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    said = [json.loads(line) for line in ended.stdout.splitlines()]
    assert len(said) == len(jobs), ended.stderr
    return dict(zip(BOMBS, said, strict=True))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc says how much memory")
@pytest.mark.parametrize("name", BOMBS)
def test_no_archive_takes_a_gigabyte_or_five_seconds(
    name: str, answers: dict[str, tuple[str, float]]
) -> None:
    said, seconds = answers[name]
    assert said.startswith("workbench.errors: ")
    assert BOMBS[name][2] in said
    assert seconds < SECONDS


def test_an_archive_that_is_as_large_as_what_it_holds_is_read(tmp_path: Path) -> None:
    """What the sentence advises to do: zeros that are not compressed."""
    path = written(READERS["start"], tmp_path)
    with np.load(path) as file:
        arrays = dict(file)
    further = np.zeros(2**23, dtype=np.int8)
    np.savez(path, **arrays, further=further)
    assert READERS["start"].read(path) is not None
    assert len(START.template) == N
