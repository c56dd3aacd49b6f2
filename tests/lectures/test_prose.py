"""What lectures say of their runs is so; what they would say wrongly is noticed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lectures.numerals import Numeral, above, below
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
