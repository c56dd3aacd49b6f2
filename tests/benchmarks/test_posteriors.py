"""What the benchmark of posteriors counts, and the made-up truths that it counts on."""

from typing import Any

import numpy as np
import pytest
import scipy.stats

from benchmarks.posterior import counted, held_out, page
from benchmarks.posterior.held_out import Seen, by_laplace, frames, simulated


def test_the_band_holds_all_entries_together() -> None:
    for count, entries in ((40, 16), (200, 16), (40, 1)):
        low, high = counted.band(count, entries)
        chance = scipy.stats.binom(count, held_out.LEVEL)
        outside = chance.cdf(low - 1) + chance.sf(high)
        assert outside * entries <= counted.UNLIKELY
        assert (chance.cdf(low) + chance.sf(high)) * entries > counted.UNLIKELY / 2  # not too wide


def test_made_up_truths_are_the_models() -> None:
    """At the truth, all that is whitened is standard normal: data and priors."""
    squares: dict[str, float] = {}
    count: dict[str, int] = {}
    for case in simulated(frames(6)):
        x, given = case.problem.split(case.truth)
        here = case.problem.linearize_at(x, given)
        some = abs(here.jacobian).any(axis=1)  # a keypoint of no confidence says nothing
        for name, rows in case.problem.rows.items():
            r = here.residual[rows][some[rows]]
            squares[name] = squares.get(name, 0.0) + float(r @ r)
            count[name] = count.get(name, 0) + r.size
    assert len(count) == 5
    for name, n in count.items():
        assert abs(squares[name] - n) < 4 * np.sqrt(2 * n), name


def test_laplaces_interval_is_about_the_answer() -> None:
    case = next(simulated([40]))
    found = by_laplace(case)
    ends, sd = np.array(found["ends"]), np.array(found["sd"])
    np.testing.assert_allclose(ends.mean(axis=0), found["mean"])
    np.testing.assert_allclose(np.ptp(ends, axis=0), 2 * 1.6448536 * sd)
    right = case.problem.free.pack(case.truth)[case.places]
    assert abs((right - found["mean"]) / sd).max() < 5


def test_the_sigma_that_residuals_ask_for() -> None:
    """Of a linear model with 40 rows, 10 of them spent."""
    rng = np.random.default_rng(0)
    J = rng.standard_normal((40, 10))
    left = np.eye(40) - J @ np.linalg.pinv(J)
    seen = [Seen(3.0 * left @ rng.standard_normal(40), 40, 10.0, np.ones(10)) for _ in range(400)]
    assert held_out.implied(seen) == pytest.approx(3.0, rel=0.03)


def case_of(truth: float, usable: bool = True) -> dict[str, Any]:
    one = {"ends": [[-1.0], [1.0]], "mean": [0.0], "sd": [0.5], "usable": usable}
    return {
        "case": f"at {truth}",
        "truth": [truth],
        "emcee": one,
        "Laplace": one | {"usable": True},
    }


def test_what_is_covered_is_counted() -> None:
    cases = [case_of(0.0), case_of(2.0), case_of(-0.5), case_of(0.0, usable=False)]
    found = {"labels": ["x"], "sigma": 4.0, "cases": cases}
    assert counted.held(found, "emcee").tolist() == [2]
    assert counted.number(found, "emcee") == 3
    assert counted.held(found, "Laplace").tolist() == [3]
    assert counted.scores(found, "Laplace").ravel().tolist() == [0.0, 4.0, -1.0, 0.0]
    said = page.text({"simulated": {"found": found, "machine": MACHINE}})
    assert "| x | 67% | 75% |" in said
    assert "not counted: at 0.0" in said


MACHINE = {
    "processor": "a made-up one",
    "cores": 2,
    "cores used": 1,
    "system": "none",
    "python": "3",
    "versions": {},
    "date": "2026-01-01T00:00",
    "load": [0.0],
    "load after": [0.0],
}


@pytest.mark.thorough
def test_made_up_truths_are_covered() -> None:
    """Nine tenths of the intervals hold them, in each entry within its binomial band."""
    cases = list(simulated(frames(40)))
    found = {"cases": [held_out.asked(case, 1, ("emcee",)) for case in cases]}
    low, high = counted.band(counted.number(found, "emcee"), 16)
    covered = counted.held(found, "emcee")
    assert counted.number(found, "emcee") >= 38
    assert ((covered >= low) & (covered <= high)).all(), covered
