"""Files that students hand in: what each gets is fair, and nothing else is harmed."""

import os
import time
from pathlib import Path

import pytest

from workbench.course.marks import Marked, State
from workbench.course.outline import lecture
from workbench.course.starting import start
from workbench.course.supervision import marked
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


def said(found: Marked, exercise: str) -> str:
    return " ".join(f"{m.what} {m.expected} {m.came}" for m in found.exercises[exercise])


def test_whatever_one_answer_does_the_others_are_marked(tmp_path: Path) -> None:
    path = tmp_path / "answers.py"
    path.write_text(HOSTILE)
    began = time.perf_counter()
    found = marked(ROTATIONS, path, seconds=2)
    assert time.perf_counter() - began < 60
    assert "stopped after 2 s" in said(found, "hat")
    assert "sys.exit(3)" in said(found, "rodrigues")
    assert [m.state for m in found.exercises["angle_between"]] == [State.PASSED] * 2
    assert "characters more" in found.printed["angle_between"]
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
        ("while True:\n    pass\n", "stopped after 2 s"),
        ("\x00", "SyntaxError"),
    ],
)
def test_a_file_that_cannot_be_loaded(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "answers.py"
    path.write_text(text)
    found = marked(ROTATIONS, path, seconds=2)
    assert told in found.trouble
    assert found.points == 0
    assert found.of == sum(check.points for check in ROTATIONS.checks)
    assert {m.state for m in found.marks} == {State.FAILED}


def test_a_file_that_answers_a_part(tmp_path: Path) -> None:
    path = start(ROTATIONS, tmp_path / "new" / "folder")
    text = path.read_text()
    here = 'raise Unsolved("hat")'
    assert here in text
    turned = "return np.array([[0, w[2], -w[1]], [-w[2], 0, w[0]], [w[1], -w[0], 0]])"
    path.write_text(
        text.replace(here, turned).replace('raise Unsolved("shorter")', "return hat(w)")
    )
    found = marked(ROTATIONS, path)
    states = {name: {m.state for m in marks} for name, marks in found.exercises.items()}
    assert states.pop("hat") == {State.FAILED}
    assert states.pop("shorter") == {State.FAILED}
    assert set.union(*states.values()) == {State.NOT_ATTEMPTED}
    (one,) = found.exercises["hat"]
    assert "v x w" in one.hint
    with pytest.raises(BadFile, match="is there already and was left as it is"):
        start(ROTATIONS, path.parent)
    assert turned in path.read_text()


def test_the_solutions_reach_all_points_in_a_process_of_their_own() -> None:
    found = marked(ROTATIONS, ROTATIONS.folder / "solutions.py")
    assert found.passed
    assert found.points == found.of


def test_an_answer_may_not_reach_into_the_next_one(tmp_path: Path) -> None:
    """What is changed in the arguments, or printed to the process's own output, stays there."""
    path = tmp_path / "answers.py"
    path.write_text(
        HEAD + "import os\n"
        "def hat(w):\n"
        "    os.write(1, b'{\"done\": true}\\n')\n"
        "    x, y, z = w\n"
        "    w[:] = 0\n"
        "    return [[0, -z, y], [z, 0, -x], [-y, x, 0]]\n"
    )
    found = marked(ROTATIONS, path)
    assert [m.state for m in found.exercises["hat"]] == [State.PASSED]
    assert "no such name in the file" in said(found, "shorter")


def test_bad_questions(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="there is no file"):
        marked(ROTATIONS, tmp_path / "nothing.py")
    with pytest.raises(BadArgument, match="above 0"):
        marked(ROTATIONS, tmp_path, seconds=float("nan"))
    with pytest.raises(UnknownName, match=r"no lecture is called '99'; there are .*2 rotations"):
        lecture(99)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="everything may be written")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(BadFile, match="cannot write"):
        start(ROTATIONS, tmp_path)
