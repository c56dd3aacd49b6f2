"""Every lecture runs; every solution passes; every stub and every known mistake does not."""

import ast
import inspect
import re

import numpy as np
import pytest

from tests.lectures.answered import marks_here
from tests.lectures.prose import run_of
from tests.tiers import few
from workbench.course.cells import cells
from workbench.course.checks import Raised, formed, outcome
from workbench.course.grading import CheckState
from workbench.course.outline import FILES, Lecture
from workbench.course.showing import Picture, Source
from workbench.lectures.outline import COURSE

THERE = [one for one in COURSE if one.there]
IN_BROWSERS = 8  # lectures 1 to 8 also run there
MOVING = (2, 4, 7, 8, 9, 11, 12, 14)  # lectures with a figure that answers to the hand
HEAVIEST = 700_000  # bytes of such a figure
REQUESTS = re.compile(r"""(?:src|href)=["']https?:|@import|fetch\(|import\(""")
WITH_SLOW_ANSWERS = (6, 12, 15)  # answers to these take a second or more


def lectures() -> list:
    """Parameters, each with the name of its folder."""
    browser = {one.number: [pytest.mark.browser] for one in THERE if one.number <= IN_BROWSERS}
    return [
        pytest.param(one, marks=browser.get(one.number, ()), id=one.folder_name) for one in THERE
    ]


def slow_but(*numbers: int) -> list:
    """Of all lectures these are in the default run."""
    return few(lectures(), [one.folder_name for one in THERE if one.number in numbers])


def quick() -> list:
    """Of all lectures those are in the default run whose answers are marked in no time."""
    return slow_but(*(one.number for one in THERE if one.number not in WITH_SLOW_ANSWERS))


def test_outline_counts_lectures_and_their_files() -> None:
    assert [one.number for one in COURSE] == list(range(1, len(COURSE) + 1))
    folders = {one.folder_name for one in COURSE}
    for folder in COURSE[0].folder.parent.glob("lec*"):
        files = {path.name for path in folder.glob("*.py")}
        files -= {"variants.py"}  # a lecture may have exercises whose numbers vary
        assert not files or (folder.name in folders and files == set(FILES)), folder


@pytest.mark.parametrize("lecture", slow_but(2, 3, 6, 8, 9, 11))
def test_lecture_runs_and_shows_figures(lecture: Lecture) -> None:
    run = run_of(lecture.number)
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
    assert any(isinstance(value, Source) for value in run.shown), "no line of the library is shown"
    assert run.printed, "numbers are printed"


@pytest.mark.parametrize("lecture", quick())
def test_lecture_solutions_pass_and_stubs_are_unsolved(lecture: Lecture) -> None:
    begins_with_its_title(lecture)
    hands_out_its_exercises(lecture)
    checks_have_names(lecture)
    for exercise in lecture.exercises:
        for one in marks_here(lecture, exercise, lecture.solution(exercise)):
            assert one.state is CheckState.PASSED, (exercise, one)
        for one in marks_here(lecture, exercise, getattr(lecture.module("exercises"), exercise)):
            assert one.state is CheckState.NOT_ATTEMPTED
            assert one.points == 0


def begins_with_its_title(lecture: Lecture) -> None:
    first = next(iter(cells(lecture.folder / "lecture.py")))
    assert first.prose
    assert first.text.startswith(f"# {lecture.title}\n")
    assert f"**{lecture.question}**" in first.text
    assert all((lecture.minutes, lecture.assumes, lecture.teaches))


def hands_out_its_exercises(lecture: Lecture) -> None:
    module = lecture.module("exercises")
    stubs = {
        name: value
        for name, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__ == module.__name__
    }
    unsolved = [name for name, stub in stubs.items() if "raise Unsolved" in inspect.getsource(stub)]
    assert 3 <= len(unsolved) <= 7, "a lecture has three to seven exercises"
    assert tuple(unsolved) == lecture.exercises  # in the order in which they are handed out
    for name in unsolved:
        assert inspect.signature(stubs[name]) == inspect.signature(lecture.solution(name)), name
        doc = inspect.getdoc(stubs[name]) or ""
        assert "->" in doc, f"{name} does not say what goes in and comes out"
        assert f'Unsolved("{name}")' in inspect.getsource(stubs[name])


def checks_have_names(lecture: Lecture) -> None:
    """The second function of a name would hide the first check or mistake."""
    tree = ast.parse((lecture.folder / "checks.py").read_text())
    names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert len(names) == len(set(names))
    assert {mistake.exercise for mistake in lecture.mistakes} == set(lecture.exercises)
    assert all(check.points > 0 and check.name for check in lecture.checks)
    labels = [(check.exercise, check.name) for check in lecture.checks]
    assert len(labels) == len(set(labels))


@pytest.mark.parametrize("lecture", quick())
def test_lecture_checks_reject_every_known_mistake(lecture: Lecture) -> None:
    rejected = {(check.exercise, check.name): 0 for check in lecture.checks}
    for mistake in lecture.mistakes:
        name = mistake.answer.__name__
        failed = [
            one
            for one in marks_here(lecture, mistake.exercise, mistake.answer)
            if one.state is not CheckState.PASSED
        ]
        assert failed, f"no check rejects {name}"
        for one in failed:
            assert one.hint == mistake.hint, f"{name} is told {one.hint!r} by {one.check!r}"
            assert one.what
            rejected[mistake.exercise, one.check] += 1
    weak = {name: count for name, count in rejected.items() if count < 2}
    assert not weak, f"checks that reject fewer than two known mistakes: {weak}"


@pytest.mark.parametrize("lecture", slow_but(2))
def test_lecture_checks_reject_nonsense_with_a_sentence(lecture: Lecture) -> None:
    """None, a string and what has no shape come back with a sentence, not with a traceback."""
    for exercise in lecture.exercises:
        for nonsense in (None, "42", float("nan"), lambda *_: 0):
            for one in marks_here(lecture, exercise, lambda *_, it=nonsense: it):
                assert one.state is CheckState.FAILED
                assert one.what
                assert one.came


def test_answers_take_the_form_of_the_solution() -> None:
    assert formed([[1, 2], [3, 4]], np.eye(2), "it").shape == (2, 2)
    assert formed(np.array([3.0]), 2, "it") == 3
    assert isinstance(outcome(lambda: 1 / 0, ()), Raised)
