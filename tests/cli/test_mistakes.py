"""Mistakes of users: a sentence, exit code 2, and nothing written."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from workbench.solvers import SOLVERS

POINTS = np.column_stack([np.arange(300, 317), np.arange(200, 540, 20), np.ones(17)])
KEYPOINTS = {
    "images": [{"id": 1, "width": 1088, "height": 1920}],
    "annotations": [{"image_id": 1, "keypoints": POINTS.ravel().tolist()}],
}
LINE = """
import numpy as np
import workbench as wb
a = wb.Block("a", (2,)).symbol
x, y = wb.Block("x", (3,)).symbol, wb.Block("y", (3,)).symbol
problem = wb.Problem([wb.Residual("line", a[0] + a[1] * x - y, sigma=0.1)], ["a"])
start = {"a": np.zeros(2), "x": np.arange(3.0), "y": np.array([1.0, 3.0, 5.5])}
compared = ("gauss-newton", "nlopt-lbfgs")
"""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("fit kp.json --focal nan", "--focal takes a length in px above 0, not nan"),
        ("fit kp.json --focal 0", "--focal takes a length in px above 0"),
        ("fit kp.json --focal -5", "--focal takes a length in px above 0"),
        ("fit kp.json --sigma 0", "--sigma takes a number above 0"),
        ("fit kp.json --sigma nan", "--sigma takes a number above 0"),
        ("fit walk.c3d --across 1", "--across takes a length in m, above 0 and below 0.1"),
        ("fit walk.c3d --marker-height nan", "--marker-height takes a length in m, above 0"),
        ("fit kp.json --size 0x0", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --size ²x2", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --size 3", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --person 1", "there are 0 (kp.json holds 1 person, counted from 0)"),
        ("fit 3.json", "annotations must be a list of objects, not 3"),
        ("fit kp.json --cameras 3.json", "3.json holds no cameras"),
        ("run --set frame=abc", "frame of balance must be a whole number, not 'abc'"),
        ("run --set frame=true", "frame of balance must be a whole number"),
        ("run --set compared=foo", "no solver is called 'foo'; there are dogleg"),
        ('run --set compared=["foo"]', "no solver is called 'foo'"),
        ("run --set held_out=cam09", "no camera is called 'cam09'; there are cam01, cam02"),
        ("run --set frame=100", "no frame is called '100'; there are 0 to 99"),
        ("run --set frame", "--set takes NAME=VALUE"),
        ("run known-correspondences --set seed=-1", "cannot be built with seed=-1: ValueError"),
        ("run exits.py", "exits.py line 3: it ends the program (sys.exit(3))"),
        ("run broken.py", "broken.py line 1: SyntaxError"),
        ("run unknown.py", "unknown.py: no solver is called 'foo'"),
        ("run nan.py", "has no finite cost, or no slope, where it starts"),
    ],
)
def test_a_sentence_and_nothing_written(
    workbench: Run, tmp_path: Path, arguments: str, said: str
) -> None:
    (tmp_path / "kp.json").write_text(json.dumps(KEYPOINTS))
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


def test_help_and_misuse_are_typers_own(workbench: Run) -> None:
    code, out, _ = workbench("run", "--help")
    assert code == 0
    assert "Run an experiment" in out
    for arguments in (("run", "--nope"), ("nope",), ("fit",), ("fit", "a", "--focal", "x")):
        code, _, err = workbench(*arguments)
        assert code == 2
        assert "Traceback" not in err
        assert err


def test_two_files_of_one_name_do_not_share_a_folder(workbench: Run, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "line.py").write_text(LINE)
    assert workbench("run", "a/line.py", "--no-compare")[0] == 0
    assert workbench("run", "a/line.py", "--no-compare")[0] == 0
    code, _, err = workbench("run", "b/line.py")
    assert code == 2
    assert "--out" in err
    assert workbench("run", "b/line.py", "--no-compare", "--out", "other")[0] == 0


class Interrupting:
    """A solver during which somebody presses Ctrl-C."""

    def solve(self, *_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_of_the_comparison_keeps_the_rest(
    workbench: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SOLVERS, "gauss-newton", Interrupting())  # type: ignore[arg-type]
    (tmp_path / "line.py").write_text(LINE)
    code, out, err = workbench("run", "line.py")
    assert code == 130
    assert err == "interrupted; the report holds what was found until then\n"
    assert "cut short from the keyboard; not run: gauss-newton, nlopt-lbfgs." in " ".join(
        out.split()
    )
    assert (tmp_path / "runs" / "line" / "index.html").is_file()


@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        ("SIGINT", 130, "interrupted; nothing was written"),
        ("SIGTERM", 143, "terminated; nothing was written"),
    ],
)
def test_signals_end_it_with_a_sentence(
    workbench: Run, tmp_path: Path, number: str, code: int, said: str
) -> None:
    (tmp_path / "x.py").write_text(f"import signal\nsignal.raise_signal(signal.{number})\n")
    assert workbench("run", "x.py") == (code, "", said + "\n")
    assert not list(tmp_path.glob("runs/*"))


def test_while_the_report_is_written_too(
    workbench: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def terminated(*_: object) -> None:
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("workbench.reports.report.run_page", terminated)
    (tmp_path / "line.py").write_text(LINE)
    code, _, err = workbench("run", "line.py", "--no-compare")
    assert (code, err) == (143, "terminated; nothing was written\n")
    assert list((tmp_path / "runs").iterdir()) == []
