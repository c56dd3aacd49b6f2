"""Gauges and least remedies of problems for which both are known beforehand."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from tests.diagnostics.eighth_zoo import EIGHTH_ZOO
from tests.diagnostics.fifth_zoo import FIFTH_ZOO
from tests.diagnostics.fourth_zoo import FOURTH_ZOO
from tests.diagnostics.ninth_zoo import NINTH_ZOO
from tests.diagnostics.second_zoo import SECOND_ZOO
from tests.diagnostics.seventh_zoo import SEVENTH_ZOO
from tests.diagnostics.sixth_zoo import SIXTH_ZOO
from tests.diagnostics.third_zoo import THIRD_ZOO
from tests.diagnostics.zoo import ZOO, Specimen
from workbench import Diagnosis, diagnose

GAUGES = ("translation", "rotation", "scale", "offset", "mixing", "projective", "gauge")
BLIND = (*EIGHTH_ZOO, *NINTH_ZOO)
WITH_TRADE_OFFS = (*FIFTH_ZOO, *SIXTH_ZOO, *SEVENTH_ZOO, *BLIND)  # which say how many there are
ROWS = ("tucker_factors", "tilt_series", "cables_in_the_plane")  # of one number: one thing or not
OTHERS = [one for one in BLIND if one.name not in ROWS]
CHOSEN = [one for one in BLIND if one.name in ROWS]
FEW = (*ZOO, *SECOND_ZOO, *THIRD_ZOO, *FOURTH_ZOO, *SEVENTH_ZOO, *CHOSEN)
MORE = (*FIFTH_ZOO, *SIXTH_ZOO, *OTHERS)


def of(
    specimens: Sequence[Specimen], more: Sequence[Specimen] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A test of each of these specimens, and of more in the long run."""
    marked = [pytest.param(one, id=one.name, marks=pytest.mark.thorough) for one in more]
    few = [pytest.param(one, id=one.name) for one in specimens]
    return pytest.mark.parametrize("specimen", [*few, *marked])


@cache
def diagnosed(specimen: Specimen) -> Diagnosis:
    found = diagnose(*specimen.build())
    assert isinstance(found, Diagnosis)
    return found


@of((*ZOO, *SECOND_ZOO, *THIRD_ZOO, *FOURTH_ZOO, *WITH_TRADE_OFFS))
def test_every_gauge_is_named(specimen: Specimen) -> None:
    d = diagnosed(specimen)
    assert d.shape[1] - d.rank == specimen.numbers
    kinds = Counter(direction.kind for direction in d.null_directions)
    told = (*GAUGES, "trade-off") if specimen in WITH_TRADE_OFFS else GAUGES
    assert {kind: kinds[kind] for kind in told if kinds[kind]} == specimen.gauges
    assert len(d.null_directions) == specimen.numbers
    for direction in d.null_directions:
        J = d.problem.linearize(d.values).jacobian
        assert np.linalg.norm(J @ direction.vector) <= d.tolerance, direction.name


@of(FEW, MORE)
def test_the_first_advice_is_a_least_remedy(specimen: Specimen) -> None:
    d = diagnosed(specimen)
    if not specimen.numbers:
        assert not any(suggestion.kind == "least" for suggestion in d.suggestions)
        return
    first = next(s for s in d.suggestions if s.kind == "least")
    assert first is d.suggestions[0] or first.acts > 5 > d.suggestions[0].acts
    assert (first.kind, first.acts, first.numbers) == ("least", specimen.acts, specimen.numbers)
    for suggestion in d.suggestions:
        if suggestion.kind != "least":
            continue
        after = diagnose(suggestion.problem, suggestion.values)
        assert after.rank == after.shape[1], suggestion.what
        assert suggestion.numbers == specimen.numbers
        # no more was held than was unknown: the data lose no direction
        measured = len(suggestion.problem.constraints) - len(d.problem.constraints)
        assert d.shape[1] - after.shape[1] == specimen.numbers - measured


@of((*FEW, *OTHERS), (*FIFTH_ZOO, *SIXTH_ZOO))
def test_what_can_be_exchanged_is_said(specimen: Specimen) -> None:
    said = [f.text for f in diagnosed(specimen).findings if "exchange" in f.text]
    assert bool(said) == bool(specimen.exchanged), said
    assert all(name in text for name in specimen.exchanged for text in said)


def test_half_of_the_zoo_is_held_out() -> None:
    held_out = [specimen for specimen in ZOO if specimen.held_out]
    assert len(ZOO) >= 15
    assert abs(len(ZOO) - 2 * len(held_out)) <= 1
