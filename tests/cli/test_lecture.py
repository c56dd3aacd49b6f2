"""`workbench lecture`: list, show, run, start, check."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from workbench.course import notebooks
from workbench.course.outline import course, lecture


def test_list_and_show(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "list")
    assert code == 0
    assert "Rotations" in out
    assert "Fitting images" in out
    code, out, _ = workbench("lecture", "show", "2")
    assert code == 0
    for name in lecture(2).exercises:
        assert name in out
    assert "in a pack, with other numbers for each student:" in " ".join(out.split())
    code, _, err = workbench("lecture", "show", "77")
    assert code == 2
    assert "no lecture is called '77'; there are" in err


def test_list_and_show_a_lecture_that_is_still_to_come(
    workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = replace(lecture(2), number=88, name="planned", title="A plan")
    monkeypatch.setattr("workbench.lectures.outline.COURSE", (*course(), planned))
    code, out, _ = workbench("lecture", "list")
    assert code == 0
    assert "A plan (to come)" in out
    code, _, err = workbench("lecture", "show", "88")
    assert code == 2
    assert "lecture 88, A plan, is still to come" in err


def test_run_writes_its_figures(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "run", "6", "--out", "here")
    assert code == 0
    assert "difference quotient" in out
    assert "\n    Jᵀ J p = − Jᵀ e.\n" in out  # formulas in letters
    assert "UPPER, LOWER = 0.30" not in out
    assert "the code: " in out
    assert out.rstrip().endswith("lecture.py")
    pictures = sorted(path.name for path in Path("here/lec06_least_squares").iterdir())
    assert pictures == [f"figure-{k}.png" for k in (1, 2, 3, 4)]


def test_run_shows_the_code_before_what_it_prints(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "run", "6", "--code")
    assert code == 0
    assert out.index("F at the start: {residual") < out.index("F at the start: 0.")


def test_a_student_starts_checks_and_is_done(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "start", "2", "mine")
    assert code == 0
    assert "lecture check 2 mine/lec02_rotations.py" in out
    code, out, _ = workbench("lecture", "check", "2", "mine")
    assert code == 1
    assert "not attempted" in out
    assert "0 of" in out
    code, _, err = workbench("lecture", "start", "2", "mine")
    assert code == 2
    assert "left as it is" in err
    Path("mine/lec02_rotations.py").write_text((lecture(2).folder / "solutions.py").read_text())
    code, out, _ = workbench("lecture", "check", "2", "mine/lec02_rotations.py", "--json")
    assert code == 0
    data = json.loads(out)
    assert data["passed"]
    assert data["points"] == data["of"] == sum(check.points for check in lecture(2).checks)
    assert [one["number"] for one in data["exercises"]][:2] == ["2.1", "2.2"]


def test_a_wrong_answer_is_told_why(workbench: Run) -> None:
    Path("lec02_rotations.py").write_text(
        "import numpy as np\ndef hat(w):\n    return np.cross(np.eye(3), -w)\n"
    )
    code, out, _ = workbench("lecture", "check", "2")
    assert code == 1
    for told in ("failed", "expected", "returned", "perhaps", "v x w", "no such name in the file"):
        assert told in out
    code, _, err = workbench("lecture", "check", "6")
    assert code == 2
    assert "there is no file" in err


def test_every_failed_line_has_a_reason_and_no_line_is_blank(workbench: Run) -> None:
    Path("lec06_least_squares.py").write_text(
        "import numpy as np\n"
        "def jacobian(x):\n    return np.zeros((2, 4))\n"
        "def gradient(e, J):\n    return e @ J\n"
    )
    code, out, _ = workbench("lecture", "check", "6")
    assert code == 1
    assert "not checked: see above" in out
    lines = out.rstrip().splitlines()
    assert all(line.strip() for line in lines)
    failed = [i for i, line in enumerate(lines) if line.startswith("  failed")]
    assert all(lines[i + 1].startswith("      ") for i in failed)


def test_notebooks_are_not_written_over(workbench: Run) -> None:
    Path("books").mkdir()
    Path("books/lec06_least_squares.ipynb").write_text("a student's evening")
    code, _, err = workbench("lecture", "notebooks", "books")
    assert code == 2
    assert "somebody's work" in err
    assert Path("books/lec06_least_squares.ipynb").read_text() == "a student's evening"
    assert len(list(Path("books").iterdir())) == 1


def test_a_missing_library_is_told_before_a_folder_is_made(
    workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(notebooks, "import_module", missing)
    code, _, err = workbench("lecture", "notebooks", "new")
    assert code == 2
    assert "need the library jupytext" in err
    assert not Path("new").exists()


def test_the_guide_shows_what_a_misprint_is_told(workbench: Run) -> None:
    guide = (Path(__file__).parents[2] / "lectures" / "GUIDE.md").read_text()
    shown = guide.partition("$ workbench lecture check 2\n")[2].partition("```")[0]
    workbench("lecture", "start", "2", ".")
    file = Path("lec02_rotations.py")
    misprint = """
    t = np.linalg.norm(w)
    n = w / t if t > 0 else w
    K = np.cross(np.eye(3), n)
    return np.eye(3) + np.sin(t) * K + np.cos(t) * K @ K
"""
    file.write_text(
        "import numpy as np\n"
        + file.read_text().replace('    raise Unsolved("rodrigues")\n', misprint.lstrip("\n"))
    )
    code, out, _ = workbench("lecture", "check", "2")
    assert code == 1
    assert " ".join(shown.split()) in " ".join(out.split())
