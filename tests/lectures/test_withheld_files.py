"""A file that is marked cannot hand in the lecture's own solutions."""

from pathlib import Path

import pytest

from workbench.course.outline import lecture, root
from workbench.course.student_process import grade
from workbench.course.withheld_files import of_a_lecture

ROTATIONS = lecture(2)
SOLUTIONS = str(ROTATIONS.folder / "solutions.py")
MODULE = "workbench.lectures.lec02_rotations.solutions"
REFUSED = "lec02_rotations/solutions.py cannot be read by a file that is being graded; write the"


@pytest.mark.parametrize(
    "cheat",
    [
        f"from {MODULE} import *",
        pytest.param(
            "from workbench.lectures.lec02_rotations.checks import solutions\nhat = solutions.hat",
            marks=pytest.mark.thorough,
        ),
        f"import sys\nhat = sys.modules[{MODULE!r}].hat",
        "from workbench.course.outline import lecture\nhat = lecture(2).solution('hat')",
        f"import sys\nsys.path.insert(0, {str(root().parent)!r})\n"
        f"from {root().name}.lec02_rotations.solutions import *",
        pytest.param(
            f"import runpy\nhat = runpy.run_path({SOLUTIONS!r})['hat']", marks=pytest.mark.thorough
        ),
        f"exec(open({SOLUTIONS!r}).read())",
        f"def hat(w):\n    from {MODULE} import hat\n    return hat(w)",
    ],
    ids=["import", "checks", "loaded", "outline", "checkout", "runpy", "open", "late"],
)
def test_solutions_earn_no_points(cheat: str, tmp_path: Path) -> None:
    path = tmp_path / "answers.py"
    path.write_text(cheat + "\n")
    found = grade(ROTATIONS, path)
    assert found.points == 0
    said = found.trouble or found.exercises["hat"][0].came
    refused = REFUSED.replace("solutions.py", "checks.py") if ".checks" in cheat else REFUSED
    assert refused in said or "sys.modules" in cheat
    assert said.startswith("line ")


def test_what_is_no_solution_may_be_imported_and_read(tmp_path: Path) -> None:
    """Also a module of the student's own that happens to have the name."""
    (tmp_path / "solutions.py").write_text(
        "import numpy as np\n\n\ndef mine(w):\n    return np.cross(np.eye(3), -w).T\n"
    )
    path = tmp_path / "answers.py"
    path.write_text(
        "from solutions import mine as hat\n"
        "from workbench.lectures.outline import COURSE\n"
        "from workbench.lectures.lec02_rotations.exercises import rodrigues\n"
        f"text = open({str(ROTATIONS.folder / 'lecture.py')!r}).read()\n"
    )
    found = grade(ROTATIONS, path)
    assert found.trouble == ""
    assert found.points == 1


def test_lectures_are_recognised_wherever_they_are(tmp_path: Path) -> None:
    for name in ("solutions.py", "checks.py", "__pycache__/solutions.cpython-311.pyc"):
        assert of_a_lecture(ROTATIONS.folder / name), name
        assert not of_a_lecture(tmp_path / "lec02_rotations" / name), name
    (tmp_path / "outline.py").touch()
    assert of_a_lecture(tmp_path / "lec02_rotations" / "solutions.py")  # a second checkout
    for name in ("exercises.py", "lecture.py", "solutions_of_mine.py"):
        assert not of_a_lecture(ROTATIONS.folder / name), name


def test_the_guide_says_what_this_is_and_what_it_is_not() -> None:
    guide = " ".join((root() / "GUIDE.md").read_text().split())
    assert "cannot import the solutions or the checks of a lecture, or open their files" in guide
    assert "This prevents only the easiest way of copying" in guide
    assert "**no sandbox**" in guide
