"""The same comparison again: the same ranking and the same advice, whatever the clock says."""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.comparison.problems import LINE, SLIDE
from workbench.comparison import Budget, Comparison, compare, worker
from workbench.comparison.jobs import Answer, Job, Solve
from workbench.comparison.pairs import duels
from workbench.comparison.tidy import deterministic, rows
from workbench.comparison.words import advice

SOLVERS = {
    "levenberg-marquardt": wb.LevenbergMarquardt(),
    "gauss-newton": wb.GaussNewton(),
    "l-bfgs": wb.SOLVERS["nlopt-lbfgs"],
}
BUDGET = Budget(max_evaluations=300)


def ranking(found: Comparison) -> list[tuple[float, str]]:
    return sorted((found.effort(s, 1e-5).value, s) for s in found.solvers)


def table(found: Comparison) -> list[dict[str, object]]:
    """What a repetition gives again, effort with it."""
    names = deterministic(found)
    assert "units to 1e-5" in names
    return [{name: row.get(name) for name in names} for row in rows(found)]


def alike(found: list[Comparison]) -> None:
    first, *others = found
    for other in others:
        assert ranking(other) == ranking(first)
        assert advice(other) == advice(first)
        assert duels(other) == duels(first)
        assert table(other) == table(first)


def test_three_times_the_same_comparison_gives_three_times_the_same_advice() -> None:
    """The measured prices of 0.1 ms evaluations changed efforts by tenths, and turned ranks."""
    found = [compare((LINE, SLIDE), SOLVERS, seeds=2, budget=BUDGET) for _ in range(3)]
    alike(found)
    assert {f.records["line, seed 0", "gauss-newton"].observed.seconds for f in found}  # measured


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[int], Comparison]:
    """A comparison in this process, by a clock that goes on by random amounts."""
    numbers = count()

    def answered(job: Job) -> Answer:
        if isinstance(job, Solve):
            job = replace(job, log=str(tmp_path / f"log-{next(numbers)}"), rehearse=False)
        return worker._answered(job, job.experiment().setup(), lambda *_: None)

    def compared(seed: int) -> Comparison:
        clock = lying(seed)
        with monkeypatch.context() as patched:
            patched.setattr(sys.modules["workbench.comparison.compare"], "answered", answered)
            patched.setattr(time, "perf_counter", lambda: next(clock))
            return compare((LINE, SLIDE), SOLVERS, seeds=2, budget=BUDGET)

    return compared


def lying(seed: int) -> Iterator[float]:
    rng, now = np.random.default_rng(seed), 0.0
    while True:
        now += float(1e-4 * rng.lognormal(sigma=2))
        yield now


def test_a_clock_that_lies_changes_nothing_but_the_times(
    here: Callable[[int], Comparison],
) -> None:
    found = [here(seed) for seed in range(3)]
    alike(found)
    runs = [f.records["line, seed 0", "gauss-newton"].observed.seconds for f in found]
    assert len(set(runs)) == 3  # it did lie
