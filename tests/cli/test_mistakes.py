"""Mistakes of users: a sentence, exit code 2, and nothing written."""

from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.own_files import LINE, write_keypoints


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("run balanse", "no experiment is called 'balanse'; there are balance"),
        ("run missing.py", "there is no file missing.py"),
        ("run --solver newtons", "no solver is called 'newtons'; there are dogleg"),
        ("run --set frames=1", "no argument of balance is called 'frames'"),
        ("run --set frame=abc", "frame of balance must be a whole number, not 'abc'"),
        ("run --set compared=foo", "no solver is called 'foo'; there are dogleg"),
        ("run --set held_out=cam09", "no camera is called 'cam09'; there are cam01, cam02"),
        ("run --set frame", "--set takes NAME=VALUE"),
        ("run known-correspondences --set seed=-1", "cannot be built with seed=-1: ValueError"),
        ("run exits.py", "exits.py line 3: it ends the program (sys.exit(3))"),
        ("run broken.py", "broken.py line 1: SyntaxError"),
        ("run unknown.py", "unknown.py: no solver is called 'foo'"),
        ("run nan.py", "has no finite cost, or no slope, where it starts"),
        ("fit missing.json", "cannot be read as JSON"),
        ("fit 3.json", "annotations must be a list of objects"),
        ("fit kp.json --focal nan", "--focal takes a number above 0, not nan"),
        ("fit kp.json --sigma 0", "--sigma takes a number above 0"),
        ("fit walk.c3d --across 1", "--across takes a length in m, above 0 and below 0.1"),
        ("fit walk.c3d --marker-height nan", "--marker-height takes a length in m, above 0"),
        ("fit kp.json --size 0x0", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --size ²x2", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --person 1", "there are 0 (kp.json holds 1 person, counted from 0)"),
        ("fit kp.json --cameras 3.json", "3.json holds no cameras"),
        ("fit kp.json --size 9x9 --focal 9 --height 172", "metres"),
        ("fit kp.json --size 9x9 --focal 9 --hypotheses 0", "1 to 8 starts"),
        ("body card huge", "default-blend-scape, default-female"),
        ("compare balance --solver newtons", "no solver is called 'newtons'"),
        ("compare balance --out mine", "mine exists and holds no comparison"),
        ("design nobody", "no experiment is called 'nobody'"),
        ("diagnose nobody", "no experiment is called 'nobody'"),
        ("register nowhere.ply", "there is no"),
        ("lecture show 77", "no lecture is called '77'"),
    ],
)
def test_mistake_ends_in_a_sentence_and_writes_nothing(
    workbench: Run, tmp_path: Path, arguments: str, said: str
) -> None:
    write_keypoints(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "diary.txt").write_text("mine")
    (tmp_path / "3.json").write_text("3")
    (tmp_path / "exits.py").write_text("import sys\n\nsys.exit(3)\n")
    (tmp_path / "broken.py").write_text("def f(:\n")
    (tmp_path / "unknown.py").write_text(LINE + "compared = ('foo',)")
    (tmp_path / "nan.py").write_text(
        LINE + "start['a'][:] = 1e200; start['x'] = 1e200 * start['x']"
    )
    code, _, err = workbench(*arguments.split())
    assert code == 2
    assert err.startswith("error: ")
    assert said in " ".join(err.split())
    assert "Traceback" not in err
    assert not list(tmp_path.glob("runs/*"))


def test_misuse_of_options_ends_with_code_2(workbench: Run) -> None:
    code, out, _ = workbench("run", "--help")
    assert code == 0
    assert "Run an experiment" in out
    for arguments in (("run", "--nope"), ("nope",), ("fit",), ("fit", "a", "--focal", "x")):
        code, _, err = workbench(*arguments)
        assert code == 2
        assert "Traceback" not in err
        assert err


def test_file_without_one_solver_is_refused(workbench: Run) -> None:
    Path("two.py").write_text("import workbench as wb\na = b = wb.GaussNewton()\n")
    Path("none.py").write_text("x = 3\n")
    for file, said in (
        ("two.py", "defines several solvers: a and b"),
        ("none.py", "none.py defines no solver"),
        ("missing.py", "there is no file missing.py"),
    ):
        code, _, err = workbench("run", "nist-misra1a", "--solver", file)
        assert code == 2
        assert said in err
    assert not Path("runs/nist-misra1a").exists()
