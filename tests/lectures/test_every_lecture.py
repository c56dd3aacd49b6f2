"""Every lecture runs; every solution passes; every stub and every known mistake does not."""

import ast
import inspect
import re

import pytest

from tests.lectures.answered import marks_here
from tests.lectures.prose import run_of
from workbench.course.answers import Raised, formed, outcome
from workbench.course.cells import cells
from workbench.course.grades import CheckState
from workbench.course.outline import FILES, Lecture
from workbench.course.picture import Picture, Source
from workbench.lectures.outline import COURSE

THERE = [one for one in COURSE if one.there]
IN_BROWSERS = 8  # lectures 1 to 8 also run there


def marks(lecture: Lecture) -> tuple[pytest.MarkDecorator, ...]:
    return (pytest.mark.browser,) if lecture.number <= IN_BROWSERS else ()


EACH = pytest.mark.parametrize(
    "lecture", [pytest.param(one, marks=marks(one), id=one.folder_name) for one in THERE]
)
EACH_EXERCISE = pytest.mark.parametrize(
    ("lecture", "exercise"),
    [
        pytest.param(one, exercise, marks=marks(one), id=f"{one.number}-{exercise}")
        for one in THERE
        for exercise in one.exercises
    ],
)
MOVING = (2, 4, 7, 8, 9, 11, 12, 14)  # lectures with a figure that answers to the hand
HEAVIEST = 700_000  # bytes of such a figure
REQUESTS = re.compile(r"""(?:src|href)=["']https?:|@import|fetch\(|import\(""")
LONGEST = 45.0  # s of one core, top to bottom: 30 where it was written, and slower machines differ


def functions(lecture: Lecture, name: str) -> dict[str, object]:
    module = lecture.module(name)
    return {
        key: value
        for key, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__ == module.__name__
    }


def test_the_outline_counts() -> None:
    assert [one.number for one in COURSE] == list(range(1, len(COURSE) + 1))
    folders = {one.folder_name for one in COURSE}
    for folder in COURSE[0].folder.parent.glob("lec*"):
        files = {path.name for path in folder.glob("*.py")}
        files -= {"variants.py"}  # a lecture may have exercises whose numbers vary
        assert not files or (folder.name in folders and files == set(FILES)), folder


@EACH
def test_it_runs_and_shows(lecture: Lecture) -> None:
    run = run_of(lecture.number)
    assert run.seconds < LONGEST
    pictures = [value for value in run.shown if isinstance(value, Picture)]
    assert pictures, "a lecture watches something fail in a figure"
    for picture in pictures:
        assert len(picture.caption) > 40, "a caption says what to see, in a sentence"
        assert len(picture.png) > 5_000
    moving = [picture.page for picture in pictures if picture.page is not None]
    assert bool(moving) is (lecture.number in MOVING)
    for page in moving:
        assert len(page.caption) > 40, "it says what to do with it"
        assert not REQUESTS.search(page.html), "a page holds everything it needs"
        assert len(page.html) < HEAVIEST
    assert any(isinstance(value, Source) for value in run.shown), (
        "the library's own lines are shown"
    )
    assert run.printed, "numbers are printed"


@EACH
def test_it_begins_with_its_title_and_question(lecture: Lecture) -> None:
    first = next(iter(cells(lecture.folder / "lecture.py")))
    assert first.prose
    assert first.text.startswith(f"# {lecture.title}\n")
    assert f"**{lecture.question}**" in first.text
    assert all((lecture.minutes, lecture.assumes, lecture.teaches))


@EACH
def test_there_are_exercises_and_every_one_is_checked(lecture: Lecture) -> None:
    stubs = functions(lecture, "exercises")
    unsolved = [name for name, stub in stubs.items() if "raise Unsolved" in inspect.getsource(stub)]
    assert 3 <= len(unsolved) <= 7, "a lecture has three to seven exercises"
    assert tuple(unsolved) == lecture.exercises  # in the order in which they are handed out
    for name in unsolved:
        assert inspect.signature(stubs[name]) == inspect.signature(lecture.solution(name)), name
        doc = inspect.getdoc(stubs[name]) or ""
        assert "->" in doc, f"{name} does not say what goes in and comes out"
        assert f'Unsolved("{name}")' in inspect.getsource(stubs[name])


@EACH
def test_no_name_is_taken_twice(lecture: Lecture) -> None:
    """The second function of a name would hide the first check or mistake."""
    tree = ast.parse((lecture.folder / "checks.py").read_text())
    names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert len(names) == len(set(names))
    known = {mistake.exercise for mistake in lecture.mistakes}
    assert known == set(lecture.exercises)
    assert all(check.points > 0 and check.name for check in lecture.checks)
    labels = [(check.exercise, check.name) for check in lecture.checks]
    assert len(labels) == len(set(labels))


@EACH_EXERCISE
def test_the_solution_passes_and_the_stub_is_unsolved(lecture: Lecture, exercise: str) -> None:
    for one in marks_here(lecture, exercise, lecture.solution(exercise)):
        assert one.state is CheckState.PASSED, one
    for one in marks_here(lecture, exercise, getattr(lecture.module("exercises"), exercise)):
        assert one.state is CheckState.NOT_ATTEMPTED
        assert one.points == 0


@EACH_EXERCISE
def test_every_mistake_is_rejected_by_its_name(lecture: Lecture, exercise: str) -> None:
    rejected = {check.name: 0 for check in lecture.checks if check.exercise == exercise}
    for mistake in lecture.mistakes:
        if mistake.exercise != exercise:
            continue
        name = mistake.answer.__name__
        failed = [
            one
            for one in marks_here(lecture, exercise, mistake.answer)
            if one.state is not CheckState.PASSED
        ]
        assert failed, f"no check rejects {name}"
        for one in failed:
            assert one.hint == mistake.hint, f"{name} is told {one.hint!r} by {one.check!r}"
            assert one.what
            rejected[one.check] += 1
    few = {name: count for name, count in rejected.items() if count < 2}
    assert not few, f"checks of {exercise} that reject fewer than two known mistakes: {few}"


@EACH_EXERCISE
def test_nonsense_is_rejected_fairly(lecture: Lecture, exercise: str) -> None:
    """None, a string and what has no shape come back with a sentence, not with a traceback."""
    for nonsense in (None, "42", object(), float("nan"), [], lambda *_: 0):
        for one in marks_here(lecture, exercise, lambda *_, it=nonsense: it):
            assert one.state is CheckState.FAILED
            assert one.what
            assert one.came


def test_answers_take_the_form_of_the_solution() -> None:
    import numpy as np

    assert formed([[1, 2], [3, 4]], np.eye(2), "it").shape == (2, 2)
    assert formed(np.array([3.0]), 2, "it") == 3
    assert isinstance(outcome(lambda: 1 / 0, ()), Raised)
