"""C code of joints and landmarks: compiled and called, it says what the body says."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.files.c_code import write_c
from workbench.errors import BadArgument, UnknownName

SMALL, HAND = wb.load_body("small"), wb.load_body("hand")
COMPILER = shutil.which("cc") or shutil.which("gcc")
DOUBLES = ctypes.POINTER(ctypes.c_double)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler on the PATH")
@pytest.mark.parametrize(("body", "points"), [(SMALL, "joints"), (HAND, "tips")])
def test_compiled_code_says_what_the_body_says(
    tmp_path: Path, body: wb.SkinnedBody, points: str
) -> None:
    path, library = tmp_path / "code.c", tmp_path / "code.so"
    write_c(path, body, points)
    assert COMPILER is not None
    command = [COMPILER, "-shared", "-fPIC", "-O0", str(path), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, timeout=100)
    code = ctypes.CDLL(str(library))
    sizes = [ctypes.c_longlong() for _ in range(4)]
    getattr(code, f"{points}_work")(*(ctypes.byref(size) for size in sizes))
    rng = np.random.default_rng(0)
    pose, betas, trans = (
        rng.normal(scale=0.3, size=(body.n_joints, 3)),
        rng.normal(size=10),
        rng.normal(size=3),
    )
    given, found = [pose, betas, trans], np.empty((len(body.landmark_names(points)), 3))
    integers, reals = (np.zeros(max(1, size.value)) for size in sizes[2:])
    arg = (DOUBLES * max(3, sizes[0].value))(*(a.ctypes.data_as(DOUBLES) for a in given))
    res = (DOUBLES * max(1, sizes[1].value))(found.ctypes.data_as(DOUBLES))
    done = getattr(code, points)(
        arg, res, integers.ctypes.data_as(ctypes.c_void_p), reals.ctypes.data_as(DOUBLES), 0
    )
    assert done == 0
    np.testing.assert_allclose(found, body.landmark(points, *given), atol=1e-12)


def test_the_header_says_arguments_units_and_names(tmp_path: Path) -> None:
    write_c(tmp_path / "code.c", SMALL, "coco")
    for name in ("code.c", "code.h"):
        text = (tmp_path / name).read_text()
        assert "arg[0]  pose, 24 x 3, rad" in text
        assert "arg[2]  trans, 3, m" in text
        assert "res[0]  the points, 23 x 3, m" in text
        about = " ".join(text.split("*/")[0].split())
        assert all(joint in about for joint in (*SMALL.joint_names, "left_big_toe"))
    assert "int coco(const" in (tmp_path / "code.h").read_text()


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="no landmark set is called 'face'"):
        write_c(tmp_path / "code.c", SMALL, "face")
    with pytest.raises(BadArgument, match=r"goes into a file that ends in \.c"):
        write_c(tmp_path / "code.h", SMALL)
    assert not list(tmp_path.iterdir())
