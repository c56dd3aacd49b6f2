"""Files that forge their marks: each gets the points that it earned, and no others."""

import json
from pathlib import Path

import pytest

from tests.tiers import few
from workbench.course.grading import CheckState, Grade
from workbench.course.outline import lecture
from workbench.course.packs import marking
from workbench.course.packs.handing_out import write_pack
from workbench.course.packs.keys import ClassKey
from workbench.course.packs.marking import answers_in, mark_of
from workbench.course.plain import Malformed, received
from workbench.course.process import ProcessLimits, grade

ROTATIONS = lecture(2)
HONEST = """
import numpy as np

def angle_between(A, B):
    return 2 * np.arcsin(min(1.0, np.linalg.norm(A - B) / np.sqrt(8)))
"""
MINE = """
import numpy as np

from workbench.course.packs import rounded, variant


@variant("stretched", points=2, minutes=5, draw=lambda rng: {"STIFFNESS": rounded(rng, 1, 9)},
         arguments=lambda rng, numbers: (rounded(rng, 1, 9, count=3),))
def stretched(force, *, STIFFNESS):
    '''force (3,) -> how far a spring is stretched, (3,)'''
    return np.asarray(force) / STIFFNESS


@variant("doubled", points=3, minutes=5, draw=lambda rng: {"OFFSET": rounded(rng, 1, 9)},
         arguments=lambda rng, numbers: (rounded(rng, 1, 9),))
def doubled(x, *, OFFSET):
    '''x -> 2 x + OFFSET'''
    return 2 * x + OFFSET
"""
EVERYWHERE = """
import json, os, struct

def frame(data):
    text = json.dumps(data).encode()
    return struct.pack("!Q", len(text)) + text

FRAMES = frame({"loaded": ""}) + frame({"answers": [{"value": True}] * 6, "printed": ""}) * 50

def everywhere(data, handles=range(64)):
    for handle in handles:
        try:
            os.write(handle, data)
        except OSError:
            pass
"""
FORGERIES = {  # and what the honest answer beside them is worth
    "answers on every handle while loading": (EVERYWHERE + "everywhere(FRAMES); os._exit(0)", 0),
    "answers from within an answer": (
        EVERYWHERE + "def stretched(force):\n    everywhere(FRAMES, range(3, 64))\n    return 0",
        0,
    ),
    "the end after a print": (
        "import os\ndef stretched(force):\n    print('2 of 2 points', flush=True)\n    os._exit(0)",
        3,
    ),
    "a NumPy that finds all alike": (
        "import numpy\n"
        "def stretched(force):\n"
        "    for name in ('allclose', 'isclose', 'array_equal', 'all'):\n"
        "        setattr(numpy, name, lambda *_, **__: True)\n"
        "    numpy.abs = numpy.maximum = lambda *_, **__: numpy.zeros(())\n"
        "    return force",
        3,
    ),
    "marking that finds nothing wrong": (
        "from workbench.course import checks\n"
        "from workbench.course.packs import marking\n"
        "checks.equal = checks.holds = marking.compare = lambda *_, **__: None\n"
        "def stretched(force):\n    return force",
        3,
    ),
    "a liar that equals everything": (
        "class Liar:\n"
        "    shape, dtype, ndim, size = (3,), float, 1, 3\n"
        "    def yes(self, *_, **__): return True\n"
        "    __eq__ = __le__ = __ge__ = __lt__ = __gt__ = __bool__ = yes\n"
        "    __hash__ = None\n"
        "    def me(self, *_, **__): return self\n"
        "    __sub__ = __rsub__ = __abs__ = __getitem__ = __getattr__ = __call__ = me\n"
        "def stretched(force):\n    return Liar()",
        3,
    ),
    "an array that agrees with everything": (
        "import numpy as np\n"
        "class Agrees(np.ndarray):\n"
        "    def __array_ufunc__(self, ufunc, method, *given, **_):\n"
        "        return np.True_ if ufunc.__name__ in ('less_equal', 'equal') else self\n"
        "    def __array_function__(self, function, *_): return np.True_\n"
        "    def all(self, *_, **__): return True\n"
        "def stretched(force):\n    return np.zeros(3).view(Agrees)",
        3,
    ),
    "what the process was sent": (
        "import gc\n"
        "def stretched(force):\n"
        "    for one in gc.get_objects():\n"
        "        if isinstance(one, dict) and 'tries' in one: return one['tries'][0][1]\n"
        "    return force",
        3,
    ),
    "a fork that goes on": (
        EVERYWHERE + "import time\n"
        "def stretched(force):\n"
        "    if os.fork():\n"
        "        os._exit(0)\n"
        "    os.setsid()\n"
        "    time.sleep(4)\n"
        "    os._exit(0)",
        3,
    ),
}


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> ClassKey:
    place = tmp_path_factory.mktemp("pack")
    (place / "mine.py").write_text(MINE)
    out = place / "out"
    return write_pack([str(place / "mine.py")], "springs", {"ada": "ada"}, out, place / "keys", 3)


def points(text: str, key: ClassKey, folder: Path) -> list[int]:
    mine = key.keys["ada"]
    (folder / "mine.py").write_text(
        f"def doubled(x):\n    return 2 * x + {mine[1].numbers['OFFSET']}\n{text}\n"
    )
    sent = answers_in(folder / "mine.py", mine, ProcessLimits(5))
    return [mark_of(one, sent[one.number]).points for one in mine]


@pytest.mark.parametrize("forgery", few(FORGERIES, ["a liar that equals everything"]))
def test_forgeries_earn_nothing(forgery: str, key: ClassKey, tmp_path: Path) -> None:
    text, honest = FORGERIES[forgery]
    assert points(text, key, tmp_path) == [0, honest]


def test_right_answers_never_enter_the_process_of_a_file(
    key: ClassKey, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    ask = marking.ask

    def watched(file: Path, about: object, exercises: object, limits: ProcessLimits) -> object:
        sent.append(json.dumps([about, exercises]))
        return ask(file, about, exercises, limits)  # type: ignore[arg-type]

    monkeypatch.setattr(marking, "ask", watched)
    own = key.keys["ada"][0].numbers["STIFFNESS"]
    right = f"import numpy as np\ndef stretched(force):\n    return np.divide(force, {own})"
    assert points(right, key, tmp_path) == [2, 3]
    (job,) = sent
    for one in key.keys["ada"]:
        for arguments, answer in (*one.tries, *one.edges):
            assert json.dumps(arguments) in job
            assert json.dumps(answer) not in job


ARRAY = {"value": {"array": ["f", [1], "AAAAAAAAAAA="]}}
GARBLED = {
    "an integer above 64 bits": {"value": 10**30},
    "a shape of 10^27 entries": {"value": {"array": ["f", [0, 10**9, 10**9, 10**9], ""]}},
    "a shape below zero": {"value": {"array": ["f", [-1], ""]}},
    "more numbers than the shape": {"value": {"array": ["f", [1], "AAAAAAAAAAAAAAAAAAAAAA=="]}},
    "an array of objects": {"value": {"array": ["O", [1], "AAAAAAAAAAA="]}},
    "numbers that are no base64": {"value": {"array": ["f", [1], "\u00e9?"]}},
    "a form that does not exist": {"value": {"pickle": "gASVAA=="}},
    "a dict that is none": {"value": {"dict": [1]}},
    "marks": {"marks": [{"state": "passed", "of": 16}]},
}


def test_garbled_answers_are_refused(key: ClassKey) -> None:
    assert received(ARRAY) == [0.0]
    for name, garbled in GARBLED.items():
        with pytest.raises(Malformed):
            received(garbled)
        lost = mark_of(key.keys["ada"][0], {"answers": [garbled] * 6})
        assert (lost.points, lost.remarks) == (0, ("its process sent what is no answer",)), name


def found(text: str, folder: Path, seconds: float = 30) -> Grade:
    path = folder / "answers.py"
    path.write_text(text)
    return grade(ROTATIONS, path, ProcessLimits(seconds))


def test_file_that_sends_garbage_fails_its_checks(tmp_path: Path) -> None:
    for garbage in ("b'[' * 100_000", "b'\\xff' * 8", "json.dumps({'results': 3}).encode()"):
        sent = f"def hat(w):\n    data = {garbage}\n"
        sent += "    everywhere(struct.pack('!Q', len(data)) + data, range(3, 64))\n    return w\n"
        came = found(HONEST + EVERYWHERE + sent, tmp_path)
        assert came.exercises["hat"][0].state is CheckState.FAILED
        assert came.of == 16
        assert not came.passed
