"""Exercises with numbers of each student's own: numbers matter, and every mistake is wrong."""

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

from tests.tiers import few
from workbench.course.checks import Missed, outcome
from workbench.course.outline import course, lecture
from workbench.course.packs.keys import OF_THE_LECTURE, ClassKey, ExerciseKey, make_keys
from workbench.course.packs.marking import compare
from workbench.course.packs.variants import PackExercise, chosen_exercises, variants_of
from workbench.course.plain import decode
from workbench.errors import BadArgument, UnknownName

STUDENTS = {name: name for name in ("ada", "ben", "cleo", "dora")}
NUMBERS = [one.number for one in course()]


@cache
def keys() -> ClassKey:
    """Of every exercise that has numbers of a student's own."""
    every = [one for number in NUMBERS for one in variants_of(lecture(number))]
    return make_keys("a class", 5, STUDENTS, every)


def key_of(one: PackExercise, student: str) -> ExerciseKey:
    return next(key for key in keys().keys[student] if key.number == one.number)


def wrong(answer: Callable[..., Any], numbers: dict[str, Any], key: ExerciseKey, pairs: Any) -> int:
    count = 0
    for arguments, expected in pairs:
        came = outcome(lambda *a: answer(*a, **numbers), tuple(decode(arguments)))
        try:
            compare(came, decode(expected), key.exercise, key.within)
        except Missed:
            count += 1
    return count


@pytest.mark.parametrize("number", few(NUMBERS, [4]))
def test_numbers_of_a_student_matter_and_mistakes_are_wrong(number: int) -> None:
    for one in variants_of(lecture(number)):
        numbers_matter_and_mistakes_are_wrong(one)


def numbers_matter_and_mistakes_are_wrong(one: PackExercise) -> None:
    variant = one.variant
    for student, other in zip(STUDENTS, (*list(STUDENTS)[1:], "ada"), strict=True):
        key, theirs = key_of(one, student), key_of(one, other).numbers
        assert list(key.numbers) == variant.constants
        assert key.numbers != theirs
        right = [*key.tries, *key.edges, *key.examples]
        assert wrong(variant.solution, key.numbers, key, right) == 0
        assert len({json.dumps(answer) for _, answer in key.tries}) > 3, "one answer fits all"
        assert wrong(variant.solution, theirs, key, key.tries), "the numbers change no answer"
        for mistake in one.mistakes:
            assert wrong(mistake.answer, key.numbers, key, key.tries), mistake.hint
        assert one.published is not None
        assert wrong(one.published.solution(variant.exercise), {}, key, key.tries)
    assert one.mistakes, "a variant has a likely mistake"
    assert "->" in variant.task


def test_seed_decides_the_numbers_of_students() -> None:
    some = chosen_exercises(["4.2", "7"])
    again, other = make_keys("a class", 5, STUDENTS, some), make_keys("a class", 6, STUDENTS, some)
    mine = key_of(some[0], "ada")
    assert again.keys["ada"][0] == mine
    assert other.keys["ada"][0].numbers != mine.numbers
    assert make_keys("b", 5, STUDENTS, some).keys["ada"][0].numbers != mine.numbers
    more = make_keys("a class", 5, {**STUDENTS, "emil": "emil"}, some)
    assert more.keys["ada"] == again.keys["ada"]  # who comes later changes nobody's numbers
    assert OF_THE_LECTURE in [hint for hint, _ in mine.mistakes]


def test_chosen_refuses_what_is_no_exercise() -> None:
    with pytest.raises(UnknownName, match=r"called '4\.9'; there are 4\.2, 4\.3, 4\.4"):
        chosen_exercises(["4.9"])
    with pytest.raises(BadArgument, match="neither a lecture"):
        chosen_exercises(["four"])
    assert [one.number for one in chosen_exercises(["4", "4.2"])] == ["4.2", "4.3", "4.4"]
    assert lecture(4).exercise_minutes == 140
