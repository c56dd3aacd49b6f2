"""Files of answers that forge their marks: each gets the points that it earned, and no others."""

import json
import socket
import threading
from pathlib import Path

import pytest

from tests.tiers import few
from workbench.course import grading
from workbench.course.channel import receive_answer
from workbench.course.checks import legible
from workbench.course.grades import CheckState, Grade
from workbench.course.grading import Ended
from workbench.course.outline import lecture
from workbench.course.plain import Malformed
from workbench.course.student_process import grade
from workbench.processes import Channel

ROTATIONS = lecture(2)
EARNED = 2  # by the honest answer below, where the process lives long enough to give it

HONEST = """
import numpy as np

def angle_between(A, B):
    return 2 * np.arcsin(min(1.0, np.linalg.norm(A - B) / np.sqrt(8)))
"""

NAMES = """
NAMES = ("hat", "rodrigues", "shorter", "nearest_rotation", "mean_rotation", "third")
POINTS = {"hat": 1, "rodrigues": 4, "angle_between": 2, "shorter": 2, "nearest_rotation": 2,
          "mean_rotation": 3, "third": 2}
"""

TELL = """
import json, os, struct

def everywhere(data, handles=range(64)):
    for handle in handles:
        try:
            os.write(handle, data)
        except OSError:
            pass

def lines():
    yield {"loaded": ""}
    for name, of in POINTS.items():
        mark = {"exercise": name, "check": "all of it", "of": of, "state": "passed"}
        yield {"begun": name}
        yield {"exercise": name, "marks": [mark], "printed": ""}
    yield {"done": True}

def frame(number, data):
    text = json.dumps([number, data]).encode()
    return struct.pack("!Q", len(text)) + text

LINES = "".join(json.dumps(line) + "\\n" for line in lines()).encode()
FRAMES = frame(1, {"loaded": ""}) + b"".join(
    frame(n, {"unfit": None, "value": True, "marks": "all", "state": "passed", "points": 16})
    for n in range(2, 500))
"""

ALL_ANSWER = """
def answer_with(value):
    for name in NAMES:
        globals()[name] = lambda *_, value=value: value
"""

FORGERIES = {
    "the marks to every handle, while loading": (TELL + "everywhere(LINES); os._exit(0)", 0),
    "answers to questions that were not asked": (TELL + "everywhere(FRAMES)", 0),
    "the marks from within an answer": (
        TELL + "def hat(w):\n    everywhere(LINES)\n    return w",
        EARNED,
    ),
    "the end after a print": (
        "import os\ndef hat(w):\n    print('16 of 16 points', flush=True)\n    os._exit(0)",
        EARNED,
    ),
    "a thread that writes for ever": (
        TELL + "import threading\n"
        "def hat(w):\n"
        "    def on():\n"
        "        while True: everywhere(FRAMES + LINES, range(3, 64))\n"
        "    threading.Thread(target=on, daemon=True).start()\n"
        "    return w",
        EARNED,
    ),
    "at the exit": (
        TELL + "import atexit, sys\natexit.register(everywhere, LINES)\nsys.exit(0)",
        EARNED,
    ),
    "a NumPy that finds all alike": (
        ALL_ANSWER + "answer_with(0.0)\n"
        "import numpy, numpy.testing\n"
        "true = lambda *_, **__: True\n"
        "def hat(w):\n"
        "    for name in ('allclose', 'isclose', 'array_equal', 'all'):\n"
        "        setattr(numpy, name, true)\n"
        "    numpy.abs = numpy.maximum = lambda *_, **__: numpy.zeros(())\n"
        "    numpy.linalg.norm = lambda *_, **__: 0.0\n"
        "    numpy.testing.assert_allclose = true\n"
        "    return w\n"
        "def angle_between(A, B):\n    return 0.0",
        0,
    ),
    "a course without checks": (
        ALL_ANSWER + "answer_with(True)\n"
        "from workbench.course import checks, grades, grading, student_process\n"
        "checks.equal = checks.holds = lambda *_, **__: None\n"
        "checks.same = checks.formed = lambda came, *_: True\n"
        "grades.CheckState._value2member_map_['failed'] = grades.CheckState.PASSED\n"
        "grades.CheckResult.points = property(lambda self: self.of)\n"
        "grading._tried = lambda check, witness: grades.CheckResult(\n"
        "    check.exercise, check.name, check.points, grades.CheckState.PASSED)\n"
        "student_process.grade = lambda *_, **__: None",
        EARNED,
    ),
    "other modules in their places": (
        ALL_ANSWER + "answer_with(1)\nimport sys, types\n"
        "class All(types.ModuleType):\n"
        "    def __getattr__(self, name): return lambda *_, **__: {'unfit': None, 'value': True}\n"
        "for name in [n for n in sys.modules if n.startswith('workbench.course')]:\n"
        "    sys.modules[name] = All(name)",
        EARNED,
    ),
    "frames above": (
        "import sys\n"
        "def hat(w):\n"
        "    frame = sys._getframe()\n"
        "    while frame is not None:\n"
        "        for name, one in list(frame.f_locals.items()) + list(frame.f_globals.items()):\n"
        "            if 'solution' in name or 'lecture' in name or name == 'checks':\n"
        "                return one.solution('hat')(w)\n"
        "        frame = frame.f_back\n"
        "    return w",
        EARNED,
    ),
    "builtins that find all alike": (
        ALL_ANSWER + "import builtins\n"
        "def hat(w):\n"
        "    builtins.abs = builtins.max = builtins.min = lambda *_, **__: 0.0\n"
        "    builtins.all = builtins.any = builtins.isinstance = lambda *_, **__: True\n"
        "    return w\n"
        "def angle_between(A, B):\n    return 0.0",
        0,
    ),
    "a liar that equals everything": (
        ALL_ANSWER + "class Liar:\n"
        "    shape, dtype, ndim, size = (3, 3), float, 2, 9\n"
        "    def yes(self, *_, **__): return True\n"
        "    __eq__ = __le__ = __ge__ = __lt__ = __gt__ = __bool__ = yes\n"
        "    __hash__ = None\n"
        "    def me(self, *_, **__): return self\n"
        "    __add__ = __sub__ = __mul__ = __matmul__ = __rsub__ = __rmatmul__ = __abs__ = me\n"
        "    __getitem__ = __getattr__ = __call__ = T = me\n"
        "answer_with(Liar())",
        EARNED,
    ),
    "an array that agrees with everything": (
        ALL_ANSWER + "import numpy as np\n"
        "class Agrees(np.ndarray):\n"
        "    def __array_ufunc__(self, ufunc, method, *given, **_):\n"
        "        return np.True_ if ufunc.__name__ in ('less_equal', 'equal') else self\n"
        "    def __array_function__(self, function, *_): return np.True_\n"
        "    def __eq__(self, other): return np.True_\n"
        "    def all(self, *_, **__): return True\n"
        "answer_with(np.zeros((3, 3)).view(Agrees))",
        EARNED,
    ),
    "messages of the course's own": (
        ALL_ANSWER + "from workbench.course.checks import Raised\n"
        "from workbench.course.checks import Missed\n"
        "from workbench.course.grading import Ended, Unanswered\n"
        "from workbench.course.checks import Described\n"
        "def hat(w):\n    return Described('passed', 'passed')\n"
        "def rodrigues(w):\n    raise Unanswered('passed')\n"
        "def shorter(w):\n    raise Ended('passed')\n"
        "def nearest_rotation(M):\n    raise Missed('passed', 'passed', 'passed')\n"
        "def mean_rotation(rotations):\n    return Raised('passed', 'passed')\n"
        "def third(s):\n    raise BaseException('passed')",
        EARNED,
    ),
    "a fork that goes on": (
        TELL + "import time\n"
        "def hat(w):\n"
        "    if os.fork():\n"
        "        os._exit(0)\n"
        "    os.setsid()\n"
        "    everywhere(FRAMES)\n"
        "    time.sleep(4)\n"
        "    os._exit(0)",
        EARNED,
    ),
    "all handles closed": ("import os\nos.closerange(3, 256)", 0),
}


LATE = ("a thread that writes for ever",)  # on a busy machine it delays its own honest answers


def found(text: str, folder: Path, seconds: float = 30) -> Grade:
    path = folder / "answers.py"
    path.write_text(text)
    return grade(ROTATIONS, path, seconds)


@pytest.mark.parametrize("forgery", few(FORGERIES, 1))
def test_forgeries_get_what_they_earned(forgery: str, tmp_path: Path) -> None:
    text, earned = FORGERIES[forgery]
    came = found(NAMES + HONEST + text + "\n", tmp_path, seconds=3)
    late = came.points == 0 and forgery in LATE
    assert came.points == earned or late
    assert came.of == 16
    assert not came.passed
    assert len(came.results) == len(ROTATIONS.checks)
    others = [one for one in came.results if one.exercise != "angle_between"]
    assert {one.state for one in others} <= {CheckState.FAILED, CheckState.NOT_ATTEMPTED}


def framed(text: bytes) -> bytes:
    return len(text).to_bytes(8, "big") + text


def array(*parts: object) -> bytes:
    return framed(json.dumps([5, {"value": {"array": parts}}]).encode())


GARBLED = {
    "no JSON": framed(b"\xff\xfe{]"),
    "a length of billions of gigabytes": b"\xff" * 8 + b"[" * 1000,
    "lists a million deep": framed(b"[" * 1_000_000),
    "an integer of three million digits": framed(b'[5, {"value": ' + b"9" * 3_000_000 + b"}]"),
    "an integer above 64 bits": framed(b'[5, {"value": ' + b"9" * 400 + b"}]"),
    "a shape of 10^27 entries": array("f", [0, 10**9, 10**9, 10**9], ""),
    "a shape below zero": array("f", [-1], ""),
    "more numbers than the shape": array("f", [1], "AAAAAAAAAAAAAAAAAAAAAA=="),
    "an array of objects": array("O", [1], "AAAAAAAAAAA="),
    "numbers that are no base64": array("f", [1], "\u00e9?"),
    "a list longer than any": framed(b'[5, {"value": {"list": [' + b"0," * 200_000 + b"0]}}]"),
    "a form that does not exist": framed(b'[5, {"value": {"pickle": "gASVAA=="}}]'),
    "a dict that is none": framed(b'[5, {"value": {"dict": [1]}}]'),
    "a complex number of texts": framed(b'[5, {"value": {"complex": ["1", "2"]}}]'),
    "an error without a text": framed(b'[5, {"raised": [1, 2, 3]}]'),
    "an answer to another question": framed(b'[4, {"value": 1}]'),
    "marks": framed(b'[5, {"marks": [{"state": "passed", "of": 16}]}]'),
}


@pytest.mark.parametrize("garbled", few(GARBLED, ()))
def test_garbled_answers_are_refused(garbled: str) -> None:
    garbled_answer_is_refused(GARBLED[garbled])


def garbled_answer_is_refused(message: bytes) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        sender = threading.Thread(target=theirs.sendall, args=(message,))
        sender.start()  # a large message waits for its reader
        with pytest.raises((Malformed, Ended)):
            grading.received(receive_answer(Channel(ours), 5, seconds=60))
        ours.close()
        sender.join()


@pytest.mark.thorough
def test_answers_are_never_unpickled(tmp_path: Path) -> None:
    came = found(
        HONEST
        + TELL.replace("POINTS", "{}")
        + f"import pickle\nMADE = {str(tmp_path / 'made')!r}\n"
        "class Bomb:\n"
        "    def __reduce__(self): return open, (MADE, 'w')\n"
        "data = pickle.dumps(Bomb())\n"
        "everywhere(struct.pack('!Q', len(data)) + data)\n"
        "everywhere(data)\n",
        tmp_path,
    )
    assert came.points == 0
    assert not (tmp_path / "made").exists()


@pytest.mark.thorough
def test_answers_beyond_all_bounds_are_described(tmp_path: Path) -> None:
    came = found(
        HONEST + "def hat(w):\n    return np.zeros((3000, 3000))\n"
        "def shorter(w):\n    return [0.0] * 1_000_000\n"
        "def third(s):\n"
        "    inside = [0.0]\n"
        "    for _ in range(5000):\n"
        "        inside = [inside]\n"
        "    return inside\n"
        "def rodrigues(w):\n    return 10**400\n"
        "def nearest_rotation(M):\n    return {1: M}\n"
        "def mean_rotation(rotations):\n    return 'x' * 10_000_000\n",
        tmp_path,
    )
    said = {name: marks[0].came for name, marks in came.exercises.items()}
    for name in ("hat", "shorter", "third", "mean_rotation"):
        assert "to be graded" in said[name], said[name]
    assert said["rodrigues"].startswith("a number: 10000")
    assert said["nearest_rotation"].startswith("a dict of length 1: {1: array(")
    assert came.points == EARNED


@pytest.mark.thorough
def test_control_characters_are_not_shown(tmp_path: Path) -> None:
    """What a file prints, raises or answers is shown without control characters."""
    paint = "\\x1b[2J\\x1b[H16 of 16 points\\x9b\\u202e\\ud800"
    came = found(
        HONEST + f"PAINT = '{paint}'\nprint(PAINT)\n"
        "def hat(w):\n    print(PAINT)\n    raise ValueError(PAINT)\n"
        "def shorter(w):\n    return PAINT\n"
        "def third(s):\n    return type(PAINT.replace('\\ud800', ''), (), {})()\n",
        tmp_path,
    )
    shown = str(came.data()["exercises"]) + "".join(came.printed.values())
    shown += "".join(m.what + m.expected + m.came for m in came.results)
    assert all(one.isprintable() or one in "\n\t" for one in shown)
    assert "\\x1b[2J" in came.printed[""]
    assert came.points == EARNED
    (trouble,) = [found(f"raise ValueError('{paint}')\n", tmp_path).trouble]
    assert trouble.startswith("line 1: ValueError: \\x1b[2J")
    assert legible("two\nlines\tand a tab") == "two\nlines\tand a tab"
