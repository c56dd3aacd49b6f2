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
    """LZF of pieces to be taken as they are; a run of zeros repeats the first of them."""
    found, at = bytearray(), 0
    while at < len(content):
        zeros = len(content[at : at + 200]) - len(content[at : at + 200].lstrip(b"\0"))
        if zeros > 9:
            found += bytes([0, 0, 7 << 5, zeros - 1 - 9, 0])
            at += zeros
        else:
            piece = content[at : at + 32]
            found += bytes([len(piece) - 1]) + piece
            at += len(piece)
    return bytes(found)


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
    for content in (b"", b"a", bytes(500) + b"end", bytes(range(256)) * 3):
        assert unpacked_lzf(packed_lzf(content), len(content)) == content
    again = bytes([2, 97, 98, 99, 4 << 5, 2])  # a piece that repeats itself while it is written
    assert unpacked_lzf(again, 9) == b"abcabcabc"


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
