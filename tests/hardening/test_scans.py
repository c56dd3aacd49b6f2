"""Two hundred damaged or hostile files of scans: each ends in a sentence of ours, or is read."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.geometry.test_pcd import packed_lzf
from tests.hardening.archives import DAMAGES, OTHERS, npy, packed, with_arrays
from tests.hardening.test_meshes import HOSTILE
from tests.hardening.within_limits import Reader, reader

SECONDS, MEGABYTES = 10.0, 1000
SUFFIXES = (".ply", ".obj", ".off", ".stl", ".glb", ".npz", ".npy", ".xyz", ".csv", ".pcd")
MUTATIONS = 14  # of a good file of each format: 140 together
SPHERE = trimesh.creation.icosphere(subdivisions=3, radius=0.8)


@pytest.fixture(scope="module")
def scans() -> Iterator[Reader]:
    yield from reader("workbench.fitting.scan_files:read_scan", SECONDS, MEGABYTES)


def sphere_in_pcd(form: str) -> bytes:
    """Field after field if it is packed, otherwise point after point."""
    points = np.asarray(SPHERE.vertices, dtype="<f4")
    header = f"""FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {len(points)}
HEIGHT 1
VIEWPOINT 0 0 3 1 0 0 0
POINTS {len(points)}
DATA {form}
""".encode()
    if form == "ascii":
        return header + "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in points.tolist()).encode()
    if form == "binary":
        return header + points.tobytes()
    packed = packed_lzf(points.T.tobytes())
    return header + np.array([len(packed), points.nbytes], "<u4").tobytes() + packed


def good(suffix: str) -> bytes:
    """A sphere in a format."""
    if suffix == ".pcd":
        return sphere_in_pcd("binary_compressed")
    points, faces = np.asarray(SPHERE.vertices), np.asarray(SPHERE.faces)
    separator = "," if suffix == ".csv" else " "
    if suffix == ".npz":
        arrays = {"points": points, "normals": points / 0.8, "faces": faces}
        return packed({f"{name}.npy": npy(array) for name, array in arrays.items()})
    if suffix == ".npy":
        return npy(points)
    if suffix in (".xyz", ".csv"):
        lines = (separator.join(map(repr, row)) for row in points.tolist())
        return "\n".join(lines).encode()
    content = SPHERE.export(file_type=suffix[1:])
    return content if isinstance(content, bytes) else content.encode()


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """The content, cut off, with bits turned over, or with a stretch left out, doubled or zero."""
    size = len(content)
    at, end = sorted(int(i) for i in rng.integers(0, size, 2))
    match int(rng.integers(6)):
        case 0:
            return content[:at]
        case 1:
            turned = np.frombuffer(content, np.uint8).copy()
            some = rng.integers(0, size, int(rng.integers(1, 50)))
            turned[some] ^= (1 << rng.integers(0, 8, len(some))).astype(np.uint8)
            return turned.tobytes()
        case 2:  # the beginning, where files say how much they hold
            turned = np.frombuffer(content, np.uint8).copy()
            turned[rng.integers(0, min(size, 300), 3)] = rng.integers(0, 256, 3)
            return turned.tobytes()
        case 3:
            return content[:at] + content[end:]
        case 4:
            return content[:end] + content[at:]
        case _:
            return content[:at] + bytes(end - at) + content[end:]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_damaged_files_end_in_a_sentence_or_are_read(
    scans: Reader, tmp_path: Path, suffix: str
) -> None:
    whole, path = good(suffix), tmp_path / f"scan{suffix}"
    path.write_bytes(whole)
    assert scans.within_limits(path).kind == "read"
    rng = np.random.default_rng(SUFFIXES.index(suffix))
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(whole, rng))
        scans.within_limits(path)


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_archives_are_refused(scans: Reader, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "scan.npz"
    path.write_bytes(DAMAGES[damage](good(".npz")))
    scans.refusal(path)


def test_other_arrays_in_the_place_of_points_end_in_a_sentence_or_are_read(
    scans: Reader, tmp_path: Path
) -> None:
    points = np.asarray(SPHERE.vertices)
    for name in ("points", "normals", "faces"):
        for make in OTHERS.values():
            path = tmp_path / "scan.npz"
            path.write_bytes(with_arrays(good(".npz"), {name: make(points)}))
            scans.within_limits(path)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes_end_in_a_sentence_or_are_read(
    scans: Reader, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(HOSTILE[name][0]())
    scans.within_limits(path)


TEXTS: dict[str, bytes] = {
    "nothing": b"",
    "blank lines": b"\n" * 1000,
    "words": b"a b c\n" * 1000,
    "one endless line": b"1 " * 3_000_000,
    "no text": bytes(range(256)) * 100,
    "rows of different lengths": b"1 2 3\n1 2\n" * 200,
    "a word among numbers": b"1 2 3\n" * 200 + b"1 two 3\n",
    "numbers beyond all": b"1e999 -1e999 1\n" * 200,
    "a cut number": b"0.5 0.5 0.5\n" * 200 + b"0.",
}


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_damaged_clouds_end_in_a_sentence_or_are_read(
    scans: Reader, tmp_path: Path, form: str
) -> None:
    whole, path = sphere_in_pcd(form), tmp_path / "scan.pcd"
    path.write_bytes(whole)
    assert scans.within_limits(path).kind == "read"
    rng = np.random.default_rng(len(form))
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(whole, rng))
        scans.within_limits(path)


MANY = 10**14
CLOUDS: dict[str, bytes] = {
    "nothing": b"",
    "an endless header": b"# pcd\n" * 100_000,
    "a header without lines": b"FIELDS x y z " * 100_000,
    "points beyond the file": sphere_in_pcd("binary").replace(b"642", b"%d" % MANY),
    "lines beyond the file": sphere_in_pcd("ascii").replace(b"642", b"%d" % MANY),
    "bytes beyond the file": sphere_in_pcd("binary").replace(b"COUNT", b"COUNT %d" % MANY),
    "a histogram": sphere_in_pcd("binary").replace(b"COUNT 1 1 1", b"COUNT 1 1 %d" % MANY),
    "no points": sphere_in_pcd("ascii").replace(b"642", b"0").partition(b"ascii")[0] + b"ascii\n",
    "no numbers": sphere_in_pcd("ascii").partition(b"ascii")[0] + b"ascii\n" + b"a b c\n" * 642,
    "one endless line": sphere_in_pcd("ascii").partition(b"ascii")[0] + b"ascii\n" + b"1 " * 10**6,
    "unpacked it is 4 GB": b"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nPOINTS %d\n" % (2**32 // 24)
    + b"DATA binary_compressed\n"
    + np.array([3 * 10**5, 2**32 - 16], "<u4").tobytes()
    + b"\xe0\xff\x00" * 10**5,
    "packed it is 4 GB": sphere_in_pcd("binary_compressed")[:-100],
}


@pytest.mark.parametrize("name", CLOUDS)
def test_clouds_that_claim_too_much_are_refused(scans: Reader, tmp_path: Path, name: str) -> None:
    path = tmp_path / "scan.pcd"
    path.write_bytes(CLOUDS[name])
    scans.refusal(path)


@pytest.mark.parametrize("name", TEXTS)
def test_texts_that_hold_no_points_are_refused(scans: Reader, tmp_path: Path, name: str) -> None:
    path = tmp_path / "scan.xyz"
    path.write_bytes(TEXTS[name])
    scans.refusal(path)


def test_what_is_no_file_is_refused(scans: Reader, tmp_path: Path) -> None:
    for suffix in SUFFIXES:
        scans.refusal(tmp_path / f"missing{suffix}")
        (tmp_path / f"folder{suffix}").mkdir()
        scans.refusal(tmp_path / f"folder{suffix}")
        os.mkfifo(tmp_path / f"pipe{suffix}")
        scans.refusal(tmp_path / f"pipe{suffix}")
        scans.refusal(tmp_path / f"{'n' * 300}{suffix}")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_refused(scans: Reader, tmp_path: Path) -> None:
    for suffix in SUFFIXES:
        path = tmp_path / f"scan{suffix}"
        path.write_bytes(good(suffix))
        path.chmod(0)
        scans.refusal(path)
