"""Every lecture runs; every solution passes; every stub and every known mistake does not."""

import ast
import inspect
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tiers import few
from workbench.course.cells import cells, run_cells
from workbench.course.grading import CheckState, grade_exercise
from workbench.course.outline import FILES, Lecture, lecture
from workbench.course.showing import Picture, Source
from workbench.errors import BadFile
from workbench.lectures.outline import COURSE

THERE = COURSE
IN_BROWSERS = 8  # lectures 1 to 8 also run there
MOVING = (1, 2, 4, 7, 8, 9, 11, 12, 14)  # lectures with a figure that answers to the hand
HEAVIEST = 700_000  # bytes of such a figure
REQUESTS = re.compile(r"""(?:src|href)=["']https?:|@import|fetch\(|import\(""")
RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"
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


@pytest.mark.parametrize("lecture", slow_but(2, 6))
def test_lecture_runs_and_shows_figures(lecture: Lecture) -> None:
    """It also holds what the prose says: a field that is false stops the lecture."""
    ran = list(run_cells(lecture.folder / "lecture.py"))
    pictures = [value for _, value, _ in ran if isinstance(value, Picture)]
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
    assert any(isinstance(value, Source) for _, value, _ in ran), "no line of the library is shown"
    assert any(printed for _, _, printed in ran), "numbers are printed"


@pytest.mark.parametrize("lecture", quick())
def test_lecture_solutions_pass_and_stubs_are_unsolved(lecture: Lecture) -> None:
    begins_with_its_title(lecture)
    hands_out_its_exercises(lecture)
    checks_have_names(lecture)
    for exercise in lecture.exercises:
        for one in grade_exercise(lecture, exercise, lecture.solution(exercise)):
            assert one.state is CheckState.PASSED, (exercise, one)
        for one in grade_exercise(
            lecture, exercise, getattr(lecture.module("exercises"), exercise)
        ):
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
    mistakes_are_rejected_with_their_hints(lecture)


def mistakes_are_rejected_with_their_hints(lecture: Lecture) -> None:
    rejected = {(check.exercise, check.name): 0 for check in lecture.checks}
    for mistake in lecture.mistakes:
        name = mistake.answer.__name__
        failed = [
            one
            for one in grade_exercise(lecture, mistake.exercise, mistake.answer)
            if one.state is not CheckState.PASSED
        ]
        assert failed, f"no check rejects {name}"
        for one in failed:
            assert one.hint == mistake.hint, f"{name} is told {one.hint!r} by {one.check!r}"
            assert one.what
            rejected[mistake.exercise, one.check] += 1
    weak = {name: count for name, count in rejected.items() if count < 2}
    assert not weak, f"checks that reject fewer than two known mistakes: {weak}"


NUMBER = re.compile(r"(?<![\w.^-])\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w^])")
NO_PROSE = re.compile(
    r"\{\{.*?\}\}|\$\$.*?\$\$|\$[^$]*\$|`[^`]*`|[Ll]ectures? \d+(?:(?:,| to| and|, and) \d+)*"
    r"|\b(?:1[89]|20)\d\d\b(?=[):,.;])|sections? [\d.]+",  # years and sections of sources
    re.S,
)


def numbers_are_those_of_the_code(path: Path) -> None:
    """A number in digits is small, or stands in code or a formula, in some unit; else in a field.

    So a number that the run computed cannot be typed: it would not change with the run.
    """
    prose = "\n".join(one.text for one in cells(path, slides=True) if one.prose)
    prose = re.sub(r"\]\(http[^)]*\)", "]", prose)  # addresses of sources
    code = "\n".join(one.text for one in cells(path) if not one.prose)
    said = " ".join(NO_PROSE.findall(prose)) + code
    known = {float(k) for k in range(13)} | {float(k) for k in re.findall(r"\d+(?:\.\d+)?", said)}
    known |= {float(k.replace("_", "")) for k in re.findall(r"\d[\d_]*(?:\.\d+)?(?:e-?\d+)?", code)}
    units = {round(k * by, 9) for k in known for by in (1e-3, 1e-2, 1, 10, 100, 1e3)}
    for number in NUMBER.findall(NO_PROSE.sub(" ", prose)):
        found = round(float(number.replace(",", "")), 9)
        assert found in units, f"{path.parent.name}: write {{{{ ... }}}} in place of {number}"


def test_numbers_of_prose_are_those_of_the_code_or_of_the_run() -> None:
    for one in THERE:
        numbers_are_those_of_the_code(one.folder / "lecture.py")


def test_paragraphs_are_short_and_minutes_follow_their_length() -> None:
    """At most 150 words; 50 words and 20 lines of code a minute, to a quarter."""
    for one in THERE:
        words = lines = 0
        for cell in cells(one.folder / "lecture.py"):
            if not cell.prose:
                lines += cell.text.count("\n") + 1
                continue
            for part in re.split(r"\n\s*\n|\n(?=- |\d\. )", re.sub(r"\{\{.*?\}\}", "0", cell.text)):
                if not part.lstrip().startswith(("|", "#", "$$")):
                    words += len(part.split())
                    assert len(part.split()) <= 150, f"{one.folder_name}: {part[:60]} ..."
        assert one.minutes == pytest.approx(words / 50 + lines / 20, rel=0.25), one.folder_name


def test_numbers_of_benchmarks_are_those_that_are_stored() -> None:
    """Those that lectures 16, 17 and 19 quote; they cannot run what took hours."""
    images, tissue = (
        json.loads((RESULTS / f"accuracy_{name}.json").read_text())["found"]
        for name in ("images", "soft_tissue")
    )
    ways = ("as before", "regressed start", "from the truth")
    quoted = {
        16: [images["images"][of][way]["MPJPE"] for of in ("people", "outliers") for way in ways],
        17: [
            np.mean([one[way]["mpjpe"] for one in images["videos"]])
            for way in ("together", "apart", "independent")
        ],
        19: [
            100 * share
            for plan in ("as embedded", "no forces on parts")
            for share in (
                tissue[plan]["together"]["explained"],
                *tissue[plan]["together"]["interval_95"][: 2 * (plan == "as embedded")],
            )
        ],
    }
    for number, values in quoted.items():
        text = (lecture(number).folder / "lecture.py").read_text()
        places = [text.find(f"{{{{ {value:.1f} }}}}") for value in values]
        assert places == sorted(places), (number, values)
        assert places[0] > 0


@pytest.mark.parametrize(
    ("right", "planted"),
    [
        ("(1 - np.cos(t)) * n @ n\n\n\nw =", "np.cos(t) * n @ n\n\n\nw ="),  # a formula
        ("0.005 * rng.standard", "0.05 * rng.standard"),  # a number
    ],
)
def test_planted_fault_stops_a_lecture(right: str, planted: str, tmp_path: Path) -> None:
    text = (lecture(2).folder / "lecture.py").read_text()
    assert text.count(right) == 1
    path = tmp_path / "lecture.py"
    path.write_text(text.replace(right, planted))
    with pytest.raises(BadFile, match=r"line \d+: "):
        for _ in run_cells(path):
            pass


def test_planted_hint_that_nobody_gets_is_noticed() -> None:
    broken = replace(lecture(2))
    first = lecture(2).mistakes[0]
    other = replace(first, answer=lecture(2).solution(first.exercise))
    vars(broken)["mistakes"] = (other, *lecture(2).mistakes[1:])
    with pytest.raises(AssertionError, match="no check rejects"):
        mistakes_are_rejected_with_their_hints(broken)
