"""Files of answers to a lecture: fair marks, and no harm to other answers."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.tiers import few
from workbench.course.checks import Missed, equal
from workbench.course.grading import CheckResult, CheckState, Grade, grade_exercise
from workbench.course.outline import hand_out, lecture
from workbench.course.process import ProcessLimits, grade, load
from workbench.errors import BadArgument, BadFile, UnknownName

ROTATIONS = lecture(2)
HEAD = "import numpy as np\nfrom workbench.course import Unsolved\n"
HOSTILE = """
import os, sys, time
import numpy as np

def hat(w):
    while True:
        pass

def rodrigues(w):
    sys.exit(3)

def angle_between(A, B):
    print("x" * 1_000_000)
    return 2 * np.arcsin(min(1.0, np.linalg.norm(A - B) / np.sqrt(8)))

def shorter(w, turns):
    return w

def nearest_rotation(M):
    os._exit(7)

def mean_rotation(rotations):
    rotations[:] = 0
    return nothing_of_that_name
"""


def said(found: Grade, exercise: str) -> str:
    return " ".join(f"{m.what} {m.expected} {m.came}" for m in found.exercises[exercise])


def marks_of(number: int, **answer: Any) -> list[CheckResult]:
    ((name, function),) = answer.items()
    return grade_exercise(lecture(number), name, function)


def test_equal_says_how_far_numbers_are_off() -> None:
    off = np.eye(3)
    off[1, 2] = 5e-9
    with pytest.raises(Missed) as small:
        equal(off, np.eye(3), "it", 1e-12)
    assert "off by up to 5e-09 at entry [1, 2], allowed 1e-12" in small.value.came
    with pytest.raises(Missed) as large:
        equal(off + 1, np.eye(3), "it", 1e-12)
    assert "off by" not in large.value.came
    with pytest.raises(Missed) as number:
        equal(1 + 1e-8, 1, "it")
    assert "off by up to 1e-08, allowed 1e-09" in number.value.came


@pytest.mark.thorough
def test_hostile_answers_leave_the_others_marked(tmp_path: Path) -> None:
    path = tmp_path / "answers.py"
    path.write_text(HOSTILE)
    found = grade(ROTATIONS, path, ProcessLimits(2))
    assert "stopped after 2 s" in said(found, "hat")
    assert "sys.exit(3)" in said(found, "rodrigues")
    assert [m.state for m in found.exercises["angle_between"]] == [CheckState.PASSED] * 2
    assert len(found.printed["angle_between"]) < 1000
    assert "signature" in said(found, "shorter")
    assert "shorter(w)" in said(found, "shorter")
    assert "shorter(w, turns)" in said(found, "shorter")
    assert "exit code 7" in said(found, "nearest_rotation")
    assert "line 24: NameError" in said(found, "mean_rotation")
    assert found.points == 2
    assert [p.name for p in tmp_path.iterdir()] == ["answers.py"]  # no __pycache__ either


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import numpy as np\ndef hat(w:\n    return w\n", "line 2: SyntaxError"),
        ("import nothing_of_that_name\n", "line 1: ModuleNotFoundError: No module named"),
        ("import sys\nsys.exit('enough')\n", "line 2: it ends the program (sys.exit(enough))"),
        ("\x00", "SyntaxError"),
        ("def f():\n    return f()\nf()\n", "line 2: RecursionError"),
    ],
)
def test_file_that_cannot_be_loaded_says_why(
    text: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "answers.py"
    path.write_text(text)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setitem(sys.modules, "answers", sys)  # what loading puts there is taken out again
    module, found = load(str(path))
    assert module is None
    assert told in found["trouble"]


@pytest.mark.thorough
def test_file_with_some_answers_is_marked(tmp_path: Path) -> None:
    path = hand_out(ROTATIONS, tmp_path / "new" / "folder")
    text = path.read_text()
    here = 'raise Unsolved("hat")'
    assert here in text
    turned = "return np.array([[0, w[2], -w[1]], [-w[2], 0, w[0]], [w[1], -w[0], 0]])"
    path.write_text(
        text.replace(here, turned).replace('raise Unsolved("shorter")', "return hat(w)")
    )
    found = grade(ROTATIONS, path)
    states = {name: {m.state for m in results} for name, results in found.exercises.items()}
    assert states.pop("hat") == {CheckState.FAILED}
    assert states.pop("shorter") == {CheckState.FAILED}
    assert set.union(*states.values()) == {CheckState.NOT_ATTEMPTED}
    (one,) = found.exercises["hat"]
    assert "v x w" in one.hint
    with pytest.raises(BadFile, match="exists already and was left as it is"):
        hand_out(ROTATIONS, path.parent)
    assert turned in path.read_text()


@pytest.mark.parametrize("number", few([2, 1, 8, 14, 19], 1))
def test_solutions_reach_all_points_in_a_process_of_their_own(number: int) -> None:
    """Functions that an exercise hands out are sent there, without any of our answers in them."""
    one = lecture(number)
    found = grade(one, one.folder / "solutions.py", ProcessLimits(600))
    assert [m for m in found.results if m.state is not CheckState.PASSED] == []
    assert found.points == found.of


@pytest.mark.thorough
def test_expected_answer_may_be_an_array(tmp_path: Path) -> None:
    """A check that expects one once ended the process, and its exercise lost all points."""
    path = tmp_path / "answers.py"
    path.write_text(
        "import numpy as np\n"
        "def ratios(times):\n"
        "    least = times.min(axis=1, keepdims=True)\n"
        "    with np.errstate(invalid='ignore'):\n"
        "        return np.where(np.isinf(least), 1.0, times / least)\n"
    )
    best, nobody = grade(lecture(11), path).exercises["ratios"]
    assert best.state is CheckState.PASSED
    assert "[inf inf inf]" in nobody.expected
    assert "infinity over infinity is not 1 there" in nobody.hint


def test_imaginary_parts_beyond_rounding_fail(tmp_path: Path) -> None:
    for imaginary, states in ((1e-17, {CheckState.PASSED}), (0.5, {CheckState.FAILED})):
        found = marks_of(2, hat=lambda w, i=imaginary: np.cross(np.eye(3), -w).T + 1j * i)
        assert {m.state for m in found} == states


def test_grade_refuses_missing_files_and_lectures(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="there is no file"):
        grade(ROTATIONS, tmp_path / "nothing.py")
    with pytest.raises(BadArgument, match="above 0"):
        ProcessLimits(float("nan"))
    with pytest.raises(
        UnknownName, match=r"no lecture is called '99'; there are 1, 2, .*`workbench lec"
    ):
        lecture(99)
