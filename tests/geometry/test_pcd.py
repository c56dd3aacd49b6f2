"""Point clouds in .pcd files, each written by hand in its three forms."""

import numpy as np
import pytest

from workbench.geometry.point_clouds import parse_pcd, unpacked_lzf

N = 60
POINTS = np.random.default_rng(0).normal(size=(N, 3)).astype("f4")
NORMALS = np.round(POINTS[:, ::-1], 2).astype("f8")
PLACE = (0.5, 1.25, -3.0)
FORMS = ("ascii", "binary", "binary_compressed")


def packed_lzf(content: bytes) -> bytes:
    """LZF, by looking for the longest piece among the last places at which three bytes stood."""
    found, waiting, at, seen = bytearray(), bytearray(), 0, dict[bytes, int]()

    def write() -> None:
        for k in range(0, len(waiting), 32):
            found.extend((len(waiting[k : k + 32]) - 1, *waiting[k : k + 32]))
        waiting.clear()

    while at < len(content):
        before = seen.get(content[at : at + 3])
        seen[content[at : at + 3]] = at
        length = 0
        if before is not None and at - before <= 8192:
            while length < 264 and content[at : at + 1 + length] == _repeated(
                content, before, at, length + 1
            ):
                if at + length >= len(content):
                    break
                length += 1
        if length < 3:
            waiting.append(content[at])
            at += 1
            continue
        write()
        back, long = at - before - 1, length - 2
        found.extend(
            (min(long, 7) << 5 | back >> 8, *((long - 7,) if long >= 7 else ()), back & 255)
        )
        at += length
    write()
    return bytes(found)


def _repeated(content: bytes, begin: int, end: int, length: int) -> bytes:
    return (content[begin:end] * (length // (end - begin) + 1))[:length]


def pcd(form: str, viewpoint: str = f"{PLACE[0]} {PLACE[1]} {PLACE[2]} 1 0 0 0") -> bytes:
    """Three numbers of a histogram, padding, a colour and normals in double beside x y z."""
    row = np.dtype(
        [("histogram", "<i2", 3), ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("_", "u1", 4)]
        + [("rgb", "<u4")]
        + [(f"normal_{axis}", "<f8") for axis in "xyz"]
    )
    rows = np.zeros(N, row)
    rows["histogram"] = np.arange(3 * N).reshape(N, 3)
    for k, axis in enumerate("xyz"):
        rows[axis], rows[f"normal_{axis}"] = POINTS[:, k], NORMALS[:, k]
    shapes = [row[name].base for name in row.names]
    header = "\n".join(
        (
            "# .PCD v.7 - Point Cloud Data file format",
            "VERSION .7",
            f"FIELDS {' '.join(row.names)}",
            f"SIZE {' '.join(str(kind.itemsize) for kind in shapes)}",
            f"TYPE {' '.join(kind.kind.upper() for kind in shapes)}",
            "COUNT 3 1 1 1 4 1 1 1 1",
            f"WIDTH {N // 2}",
            "HEIGHT 2",
            f"VIEWPOINT {viewpoint}",
            f"POINTS {N}",
            f"DATA {form}\n",
        )
    )
    if form == "ascii":
        data = "".join(
            " ".join(repr(x) for name in row.names for x in np.ravel(one[name]).tolist()) + "\n"
            for one in rows
        ).encode()
    elif form == "binary":
        data = rows.tobytes()
    else:
        columns = b"".join(np.ascontiguousarray(rows[name]).tobytes() for name in row.names)
        packed = packed_lzf(columns)
        data = np.array([len(packed), len(columns)], "<u4").tobytes() + packed
    return header.encode() + data


def test_packed_bytes_come_back() -> None:
    """Also pieces that repeat themselves while they are written, and long ones."""
    rng = np.random.default_rng(1)
    for content in (b"", b"a", b"a" * 5000, b"abcabcab" * 40, rng.bytes(3000), bytes(9) * 9):
        packed = packed_lzf(content)
        assert unpacked_lzf(packed, len(content)) == content
    assert len(packed_lzf(b"a" * 5000)) < 70
    assert unpacked_lzf(packed_lzf(bytes(range(256)) * 20), 5120) == bytes(range(256)) * 20


@pytest.mark.parametrize("form", FORMS)
def test_points_normals_and_viewpoint_come_back(form: str) -> None:
    found = parse_pcd(pcd(form))
    np.testing.assert_array_equal(found.points, POINTS.astype("f8"))
    np.testing.assert_array_equal(found.normals, NORMALS)
    np.testing.assert_array_equal(found.viewpoint, PLACE)
    assert found.unread == ("histogram", "rgb")


def test_unset_viewpoint_is_none() -> None:
    assert parse_pcd(pcd("ascii", "0 0 0 1 0 0 0")).viewpoint is None
    assert parse_pcd(pcd("ascii").replace(b"VIEWPOINT", b"# VIEWPOINT")).viewpoint is None


def test_damaged_clouds_are_refused() -> None:
    text, binary, packed = (pcd(form) for form in FORMS)
    before, _, _ = packed.partition(b"compressed\n")
    sizes = np.array([60, 60 * 50], "<u4").tobytes()
    for content, says in (
        (b"ply\nformat\n", "header says 'ply'"),
        (b"FIELDS x y z\n", "no header that ends"),
        (binary.replace(b"FIELDS histogram x y z", b"FIELDS histogram x y w"), "no x, y"),
        (text.replace(b"TYPE I", b"TYPE C"), "of type 'C'"),
        (text.replace(b"DATA ascii", b"DATA zip"), "'zip'"),
        (text.replace(b"POINTS 60", b"POINTS -1"), "POINTS '-1'"),
        (text.replace(b"HEIGHT 2", b"HEIGHT 3"), "30 times 3"),
        (text[:-1].rpartition(b"\n")[0], "but 59 follow"),
        (binary[:-1], "claims 60 points"),
        (packed[:-1], "cut off"),
        (before + b"compressed\n" + sizes + b"\x20\xff" * 30, "before their beginning"),
    ):
        with pytest.raises(ValueError, match=says):
            parse_pcd(content)
