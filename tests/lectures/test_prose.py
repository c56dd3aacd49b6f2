"""What lectures say of their runs is so; what they would say wrongly is noticed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lectures.numerals import Numeral, above, below, numerals, printed_numbers, right
from tests.lectures.prose import (
    Claims,
    Run,
    absent,
    claims_of,
    disagreements,
    loose_comparisons,
    loose_numbers,
    quoted,
    run_of,
)
from workbench.course.outline import Lecture, course

pytestmark = pytest.mark.thorough

THERE = [one for one in course() if one.there]
EACH = pytest.mark.parametrize("lecture", THERE, ids=lambda one: one.folder_name)


@EACH
def test_prose_agrees_with_the_run_and_holds_every_number(lecture: Lecture) -> None:
    """One test, so that each lecture runs once, and not in every process of a test run."""
    run, claims = run_of(lecture.number), claims_of(lecture)
    assert not disagreements(run, claims)
    assert not loose_numbers(run, claims)
    assert not loose_comparisons(run, claims)
    for phrases in (claims.given, claims.general):
        assert not absent(run, phrases), "a phrase of GIVEN or GENERAL does not stand in the prose"
    assert len(claims.says) >= 10, "enter at least ten sentences that speak of the run into SAYS"
    changed_numbers_are_noticed(run, claims)


def changed_numbers_are_noticed(run: Run, claims: Claims) -> None:
    """Two units of the last digit are enough, in the prose alone or in the table as well."""
    for phrase, of in claims.says.items():
        begin = run.prose.index(phrase)
        for k, one in enumerate(quoted(run.prose, phrase)):
            noticed = []
            for other in altered(one, bound=is_bound(of(run), k)):
                a, b = one.begin - begin, one.end - begin
                changed = f"{phrase[:a]}{other}{phrase[b:]}"
                wrong = replace(run, prose=run.prose.replace(phrase, changed))
                assert disagreements(wrong, Claims({phrase: of}))
                noticed.append(bool(disagreements(wrong, Claims({changed: of}))))
            assert any(noticed), f"{phrase!r}: {one.text} could be any number"


def altered(one: Numeral, bound: bool) -> tuple[str, ...]:
    """The number with another last digit; a bound much larger, and much smaller."""
    if bound:
        return f"{3 * one.value:.15g}", f"{one.value / 3:.15g}"
    mantissa, e, _ = one.text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    form = "e" if e and mantissa[0].isdigit() else "f"
    return (f"{one.value + 4 * one.rounding:.{decimals}{form}}",)


def is_bound(answer: object, k: int) -> bool:
    values = answer if isinstance(answer, tuple) else (answer,)
    return isinstance(
        [one for one in values if not isinstance(one, bool | np.bool_)][k], above | below
    )


@pytest.mark.parametrize(
    ("number", "printed", "instead", "phrase"),
    [
        (9, "surface off by 18 mm", "surface off by 21 mm", "The surface is hardly closer"),
        (
            3,
            "surface 12.0 mm from the truth",
            "surface 20.0 mm from the truth",
            "Fewer numbers, and a better answer",
        ),
    ],
)
def test_comparison_that_the_run_reverses_is_noticed(
    number: int, printed: str, instead: str, phrase: str
) -> None:
    one = next(one for one in THERE if one.number == number)
    run = run_of(number)
    assert printed in run.printed
    wrong = replace(run, printed=run.printed.replace(printed, instead))
    told = disagreements(wrong, claims_of(one))
    assert any(phrase in sentence for sentence in told), told


@pytest.mark.parametrize(
    ("number", "phrase", "instead"),
    [
        (3, "Fewer numbers, and a better answer", "Fewer numbers, and a worse answer"),
        (9, "The surface is hardly closer", "The surface is much closer"),
    ],
)
def test_comparison_that_the_prose_reverses_is_noticed(
    number: int, phrase: str, instead: str
) -> None:
    one = next(one for one in THERE if one.number == number)
    run = run_of(number)
    assert phrase in run.prose
    assert disagreements(replace(run, prose=run.prose.replace(phrase, instead)), claims_of(one))


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (8, "It tells a shoulder to ten."),
        (9, "Two cameras end it: 188 mm become 6."),
        (11, "Brown-dennis makes up 43 % of the mean."),
    ],
)
def test_number_without_a_claim_is_noticed(number: int, sentence: str) -> None:
    one = next(one for one in THERE if one.number == number)
    run = run_of(number)
    assert loose_numbers(replace(run, prose=f"{run.prose} {sentence}"), claims_of(one))


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (9, "Two cameras are twice as good."),
    ],
)
def test_comparison_without_a_claim_is_noticed(number: int, sentence: str) -> None:
    one = next(one for one in THERE if one.number == number)
    run = run_of(number)
    assert not loose_comparisons(run, claims_of(one))
    assert loose_comparisons(replace(run, prose=f"{run.prose} {sentence}"), claims_of(one))


@pytest.mark.parametrize(
    ("number", "phrase", "planted"),
    [
        (8, "It is 35 and not 40", "It is 38 and not 40"),
        (9, "are now off by 6 mm", "are now off by 16 mm"),
    ],
)
def test_changed_number_of_the_prose_is_noticed(number: int, phrase: str, planted: str) -> None:
    """As when somebody changes the lecture's file alone."""
    one = next(one for one in THERE if one.number == number)
    run = run_of(number)
    assert run.prose.count(phrase) == 1
    wrong = replace(run, prose=run.prose.replace(phrase, planted))
    told = disagreements(wrong, claims_of(one)) + loose_numbers(wrong, claims_of(one))
    assert any(phrase[:12] in sentence for sentence in told), told


def test_numerals_are_read_as_they_stand() -> None:
    said = "Of 2,200 two thirds, forty, twenty-one and three hundred; tenfold, 5e-9, -0.5, 16.5%."
    assert [one.value for one in numerals(said)] == [2200, 40, 21, 300, 10, 5e-9, -0.5, 16.5]
    assert [one.value for one in numerals("with $F = 1000$ px and $x_1^2 + 3$")] == [1000]
    assert not numerals("Lectures 2 and 6, `f(3)`, (Powell, 1970), x2 and $$ a = 4 $$")
    assert printed_numbers("osborne-1: 57, [1. -2e-3], 1,024 of 3.5 m^2") == [
        57,
        1,
        -2e-3,
        1024,
        3.5,
    ]


@pytest.mark.parametrize(
    ("text", "value", "so"),
    [
        ("230", 233.4, True),  # a zero at the end is no digit that is vouched for
        ("230", 236.0, False),
        ("100", 108.0, False),  # but at most 5 % are allowed for it
        ("1.3", 1.26, True),
        ("1.3", 1.24, False),
        ("0", 0.4, True),
        ("369", 369, True),
        ("370", 369, False),  # a whole number of the run is quoted exactly
        ("5e-9", 5.4e-9, True),
        ("5e-9", 6e-9, False),
        ("forty", 40, True),
        ("10", above(10.5), True),
        ("10", above(9.5), False),
        ("1", below(0.9), True),
        ("1", below(1.1), False),
    ],
)
def test_number_is_right_to_the_digits_quoted(text: str, value: float, so: bool) -> None:
    (one,) = numerals(text)
    assert right(one, value) is so


def test_claim_answers_a_value_for_each_number() -> None:
    run = Run("It takes 7 steps, fewer than before.", "7 steps\n9 steps", {}, (), 0.0)
    assert not disagreements(
        run, Claims({"takes 7 steps, fewer": lambda run: (run.lines()[0][0], True)})
    )
    assert disagreements(run, Claims({"takes 7 steps, fewer": lambda run: True}))
    assert disagreements(run, Claims({"takes 7 steps, fewer": lambda run: (7, False)}))
    assert disagreements(run, Claims({"takes 8 steps": lambda run: 8}))
    assert loose_numbers(run, Claims({"fewer than before": lambda run: True}))
    assert not loose_numbers(run, Claims({}, ("It takes 7 steps",)))
    with pytest.raises(AssertionError, match="2 printed lines"):
        run.line("steps")
