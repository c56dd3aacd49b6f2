"""Solvers compared on problems: the records of all runs, and what follows from them."""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench.comparison import statistics
from workbench.comparison.description import Description
from workbench.comparison.entrants import Entrant
from workbench.comparison.judgement import Judgement
from workbench.comparison.plan import Instance, Plan
from workbench.comparison.record import Record
from workbench.comparison.targets import TAUS, Verdict, Yardstick, verdict
from workbench.comparison.watch import KINDS
from workbench.experiments.comparison import way_left
from workbench.solvers import Evaluations

Array = NDArray[np.float64]
MAIN = 1e-5  # the target by which solvers are told apart where one number has to do


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every run by instance and solver; derived things are computed as they are asked for."""

    plan: Plan = field(repr=False)
    instances: tuple[Instance, ...]  # that could be built
    unbuilt: dict[str, str]  # names of those that could not, and why
    described: dict[str, Description] = field(repr=False)
    records: dict[tuple[str, str], Record] = field(repr=False)  # by instance and solver
    groups: tuple[tuple[str, ...], ...]  # instances of one problem, which differ in the start
    judgements: tuple[Judgement, ...] = field(repr=False)  # by group
    taus: tuple[float, ...] = TAUS

    @property
    def solvers(self) -> tuple[str, ...]:
        """Their names, in the order in which they were given."""
        return tuple(entrant.name for entrant in self.plan.entrants)

    @property
    def entrants(self) -> tuple[Entrant, ...]:
        """The solvers themselves."""
        return self.plan.entrants

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Names of the problems, each once."""
        return tuple(dict.fromkeys(instance.problem for instance in self.instances))

    def of(self, problem: str) -> tuple[Instance, ...]:
        """The instances of a problem."""
        return tuple(i for i in self.instances if i.problem == problem)

    # What an evaluation costs.

    @cached_property
    def prices(self) -> dict[str, dict[str, float]]:
        """By problem and kind: seconds of one evaluation over those of a residual, as measured.

        Of the Hessian, over all runs that asked for one; NaN if none did.
        """
        found = {}
        for problem in self.problems:
            seconds = [self.described[i.name].seconds for i in self.of(problem)]
            residual = float(np.median([s["residual"] for s in seconds]))
            prices = {
                kind: float(np.median([s[kind] / s["residual"] for s in seconds]))
                for kind in KINDS[:3]
            }
            seen = [self.records[i.name, s].seen for i in self.of(problem) for s in self.solvers]
            count = sum(s.evaluations.hessian for s in seen)
            spent = sum(s.spent[3] for s in seen)
            prices["hessian"] = spent / count / residual if count else np.nan
            found[problem] = prices
        return found

    def units(self, problem: str, counts: Array) -> Array:
        """Evaluations (..., 4) by kind in units of one residual."""
        prices = np.array([self.prices[problem][kind] for kind in KINDS])
        return np.asarray(np.nansum(np.asarray(counts) * np.nan_to_num(prices), axis=-1))

    # By which everybody is measured.

    @cached_property
    def yardsticks(self) -> dict[str, Yardstick]:
        """By instance."""
        found = {}
        for group, judgement in zip(self.groups, self.judgements, strict=True):
            runs = [self.records[name, s] for name in group for s in self.solvers]
            known = [self.described[name].known_cost for name in group]
            candidates = {
                "the lowest end, polished": min(judgement.costs, default=np.inf),
                "the lowest point that a run visited": min(r.lowest for r in runs),
                self.described[group[0]].known_source: float(np.nanmin([np.inf, *known])),
            }
            origin = min(candidates, key=lambda name: candidates[name])
            best = candidates[origin]
            for name in group:
                found[name] = Yardstick(
                    self.described[name].start_cost, best if np.isfinite(best) else np.nan, origin
                )
        return found

    @cached_property
    def basins(self) -> dict[tuple[str, str], int]:
        """The basin of each end that has one, by instance and solver; 0 is the lowest."""
        found: dict[tuple[str, str], int] = {}
        for group, judgement in zip(self.groups, self.judgements, strict=True):
            found |= dict(
                zip(ended(group, self.solvers, self.records), judgement.where, strict=False)
            )
        return found

    def judgement(self, instance: str) -> Judgement:
        """Of the problem that an instance is of."""
        k = next(k for k, group in enumerate(self.groups) if instance in group)
        return self.judgements[k]

    @cached_property
    def verdicts(self) -> dict[tuple[str, str], Verdict]:
        """What became of each run."""
        found = {}
        for (instance, solver), record in self.records.items():
            yardstick, basin = self.yardsticks[instance], self.basins.get((instance, solver))
            costs = self.judgement(instance).costs
            lowest = None if basin is None else yardstick.near(costs[basin])
            found[instance, solver] = verdict(
                record, yardstick, lowest, self.plan.budget.stationary
            )
        return found

    # What it took.

    def met(self, instance: str, solver: str, tau: float) -> Array | None:
        """Evaluations by kind, seconds and cost at which a run met a target, or None."""
        return self.yardsticks[instance].met(self.records[instance, solver], tau)

    def needed(self, tau: float) -> Array:
        """(P, S) cost units until the target, by instance and solver; infinite if never."""
        return self._needed[tau] if tau in self._needed else self._units_to(tau)

    @cached_property
    def _needed(self) -> dict[float, Array]:
        return {tau: self._units_to(tau) for tau in self.taus}

    def _units_to(self, tau: float) -> Array:
        found = np.full((len(self.instances), len(self.solvers)), np.inf)
        for p, instance in enumerate(self.instances):
            for s, solver in enumerate(self.solvers):
                row = self.met(instance.name, solver, tau)
                if row is not None:
                    found[p, s] = self.units(instance.problem, row[:4])
        return found

    def needed_seconds(self, tau: float) -> Array:
        """(P, S) seconds until the target; infinite if never."""
        return np.array(
            [
                [
                    np.inf if (row := self.met(i.name, s, tau)) is None else row[4]
                    for s in self.solvers
                ]
                for i in self.instances
            ]
        ).reshape(len(self.instances), len(self.solvers))

    def trace(self, instance: Instance, solver: str) -> Array:
        """(k, 3) cost units, seconds and (f - f*) / (f_0 - f*) of the best point so far; the last
        row is the end of the run.
        """
        record, yardstick = self.records[instance.name, solver], self.yardsticks[instance.name]
        rows = record.seen.trace
        if not len(rows):
            return np.zeros((0, 3))
        counts = [getattr(record.evaluations, kind) for kind in KINDS]
        last = np.array([*counts, max(record.seen.seconds, rows[-1, 4]), rows[-1, 5]])
        rows = np.vstack([rows, last])
        gap = way_left(rows[:, 5], yardstick.best, yardstick.start)
        units = self.units(instance.problem, rows[:, :4])
        return np.column_stack([units, rows[:, 4], np.maximum(gap, 0.0)])

    def success(self, solver: str, tau: float, problem: str | None = None) -> statistics.Interval:
        """The share of instances, of one problem or of all, on which it met a target."""
        chosen = self.instances if problem is None else self.of(problem)
        met = [self.met(i.name, solver, tau) is not None for i in chosen]
        return statistics.rate(sum(met), len(met))

    def effort(self, solver: str, tau: float, problem: str | None = None) -> statistics.Interval:
        """The median of cost units until a target, failures infinite."""
        chosen = [p for p, i in enumerate(self.instances) if problem in (None, i.problem)]
        return statistics.median(self.needed(tau)[chosen, self.solvers.index(solver)])

    def counted(self, solver: str) -> Counter[Verdict]:
        """How many of its runs came to what."""
        return Counter(v for (_, name), v in self.verdicts.items() if name == solver)

    def reached(self, solver: str) -> statistics.Interval:
        """The share of its runs that ended at the lowest cost known."""
        counts = self.counted(solver)
        return statistics.rate(counts[Verdict.REACHED], counts.total())

    def evaluations(self, solver: str) -> Evaluations:
        """All that it asked for, over all runs."""
        every = [r.evaluations for (_, name), r in self.records.items() if name == solver]
        return Evaluations(*(sum(getattr(e, kind) for e in every) for kind in KINDS))

    def digits(self, solver: str) -> Array:
        """Digits that agree with the certified answer, run by run; 0 of a run without an end."""
        return np.array(
            [
                float(np.nan_to_num(self.records[i.name, solver].digits))
                for i in self.instances
                if self.described[i.name].certified
            ]
        )

    def duel(self, a: str, b: str, tau: float = MAIN) -> statistics.Duel:
        """Two solvers on the same starts."""
        needed, names = self.needed(tau), self.solvers
        return statistics.duel(needed[:, names.index(a)], needed[:, names.index(b)])

    def surer(self, a: str, b: str, tau: float = MAIN) -> statistics.Duel:
        """The same by success alone: a win is a target that only one of them met."""
        met = np.where(np.isfinite(self.needed(tau)), 1.0, np.inf)
        names = self.solvers
        return statistics.duel(met[:, names.index(a)], met[:, names.index(b)])


def ended(
    group: tuple[str, ...], solvers: tuple[str, ...], records: dict[tuple[str, str], Record]
) -> list[tuple[str, str]]:
    """The runs of a group that ended at a point that can be looked at, in a fixed order."""
    keys = [(name, solver) for name in group for solver in solvers]
    return [key for key in keys if records[key].finite and records[key].inside]
