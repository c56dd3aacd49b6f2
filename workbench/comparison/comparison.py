"""Solvers compared on problems: the records of all runs, and what follows from them."""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np

from workbench.arrays import Array
from workbench.comparison import statistics
from workbench.comparison.design import Design, Instance
from workbench.comparison.ends import EndAnalysis
from workbench.comparison.record import KINDS, Description, Record, RunEnding, ended
from workbench.comparison.statistics import PairedTest, holm_corrected, paired_test
from workbench.comparison.targets import (
    AT_LOWEST,
    TAUS,
    ReferenceCosts,
    TargetOutcome,
    prices,
    target_outcome,
    units,
)
from workbench.experiments.running import share_left

NO_ANSWER = (  # however near the lowest cost these ends are
    TargetOutcome.OTHER_BASIN,
    TargetOutcome.SADDLE,
    TargetOutcome.ALONE,
)
Pairs = dict[tuple[str, str], PairedTest]  # by two names, both ways round
MAIN_TAU = 1e-5  # the target by which solvers are told apart where one number has to do


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every run by instance and solver; what follows from them is computed when asked for.

    Attributes:
        design: what was to be run.
        instances: the instances that could be built.
        unbuilt: why the others could not be built, by their names.
        described: the description of each instance, by its name.
        records: the record of each run, by the names of the instance and the solver.
        groups: the names of the instances of one problem, which differ only in the start.
        end_analyses: the analysis of the ends of each group.
        taus: the targets.
    """

    design: Design = field(repr=False)
    instances: tuple[Instance, ...]
    unbuilt: dict[str, str]
    described: dict[str, Description] = field(repr=False)
    records: dict[tuple[str, str], Record] = field(repr=False)
    groups: tuple[tuple[str, ...], ...]
    end_analyses: tuple[EndAnalysis, ...] = field(repr=False)
    taus: tuple[float, ...] = TAUS

    @property
    def solvers(self) -> tuple[str, ...]:
        """The names of the solvers, in the order in which they were given."""
        return tuple(named.name for named in self.design.named_solvers)

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Names of the problems, each once."""
        return tuple(dict.fromkeys(instance.problem for instance in self.instances))

    def instances_of(self, problem: str) -> tuple[Instance, ...]:
        """The instances of a problem."""
        return tuple(i for i in self.instances if i.problem == problem)

    # What an evaluation costs.

    @cached_property
    def unknowns(self) -> dict[str, int]:
        """The number of free numbers of each problem, the largest one if starts differ in it."""
        return {
            p: max(self.described[i.name].unknowns for i in self.instances_of(p))
            for p in self.problems
        }

    @cached_property
    def prices(self) -> dict[str, dict[str, float]]:
        """The price of each kind of evaluation on each problem, in evaluations of the residual."""
        return {problem: prices(n) for problem, n in self.unknowns.items()}

    def units(self, problem: str, counts: Array) -> Array:
        """The effort of evaluations (..., kinds): counts times prices."""
        return units(counts, self.unknowns[problem])

    # By which everybody is measured.

    @cached_property
    def references(self) -> dict[str, ReferenceCosts]:
        """The cost at the start and the lowest cost known, by instance."""
        references = {}
        for group, end_analysis in zip(self.groups, self.end_analyses, strict=True):
            runs = [self.records[name, s] for name in group for s in self.solvers]
            known_costs = [self.described[name].known_cost for name in group]
            costs = [self.records[key].cost for key in ended(group, self.solvers, self.records)]
            candidates = {
                "the lowest end, polished": min((*end_analysis.costs, *costs), default=np.inf),
                "the lowest point that a run visited": min(r.lowest for r in runs),
                self.described[group[0]].known_source: float(np.nanmin([np.inf, *known_costs])),
            }
            origin = min(candidates, key=lambda name: candidates[name])
            best = candidates[origin]
            end = min(costs, default=np.inf)
            reached_it = sum(r.lowest <= end for r in runs)  # the run that ended there among them
            is_alone = len(costs) == 1 and reached_it <= 1 and not np.isfinite(known_costs).any()
            for name in group:
                references[name] = ReferenceCosts(
                    self.described[name].start_cost,
                    best if np.isfinite(best) else np.nan,
                    "the only end: nothing to compare it with" if is_alone else origin,
                    is_alone,
                )
        return references

    @cached_property
    def comparable(self) -> tuple[Instance, ...]:
        """The instances that say something about a solver, because more than one run ended on the
        problem or a cost is known beforehand. All shares, efforts and pairs are over these.
        """
        return tuple(i for i in self.instances if not self.references[i.name].alone)

    @cached_property
    def compared(self) -> tuple[str, ...]:
        """The problems of the comparable instances, each once."""
        return tuple(dict.fromkeys(i.problem for i in self.comparable))

    @cached_property
    def basins(self) -> dict[tuple[str, str], int]:
        """The basin of each end that was analysed, by instance and solver; 0 is the lowest."""
        basins: dict[tuple[str, str], int] = {}
        for group, analysis in zip(self.groups, self.end_analyses, strict=True):
            keys = ended(group, self.solvers, self.records)
            basins |= zip(keys, analysis.where, strict=False)  # and of a point that none returned
        return basins

    def end_analysis(self, instance: str) -> EndAnalysis:
        """The analysis of the ends on the problem of an instance."""
        k = next(k for k, group in enumerate(self.groups) if instance in group)
        return self.end_analyses[k]

    @cached_property
    def outcomes(self) -> dict[tuple[str, str], TargetOutcome]:
        """The target outcome of each run, by instance and solver."""
        outcomes = {}
        for (instance, solver), record in self.records.items():
            reference, basin = self.references[instance], self.basins.get((instance, solver))
            lowest, at_saddle = None, False
            if basin is not None:
                ends = self.end_analysis(instance)
                lowest, at_saddle = reference.is_lowest(ends.costs[basin]), ends.at_saddle(basin)
            outcomes[instance, solver] = target_outcome(
                record, reference, lowest, self.design.budget.stationary, at_saddle
            )
        return outcomes

    # What it took.

    def reached_at(self, instance: str, solver: str, tau: float) -> Array | None:
        """Evaluations by kind, seconds and cost at which a run met a target, or None."""
        return self.references[instance].reached_at(self.records[instance, solver], tau)

    def solved(self, instance: str, solver: str, tau: float) -> bool:
        """Whether a run visited a point that meets a target, or ended at one."""
        reference, record = self.references[instance], self.records[instance, solver]
        return reference.reached_at(record, tau) is not None or reference.ends_below(record, tau)

    def returned_within(self, instance: str, solver: str, tau: float) -> bool:
        """Whether a run returned a point that meets a target, at no saddle, in no other basin."""
        record = self.records[instance, solver]
        meets = self.references[instance].ends_below(record, tau)
        fine = self.outcomes[instance, solver] not in NO_ANSWER
        return record.ending is RunEnding.RETURNED and meets and fine

    def uncounted(self, instance: str, solver: str, tau: float = MAIN_TAU) -> bool:
        """Whether it is not known what a run needed to meet a target: it evaluated the graph in its
        own code, or ended at a point that meets it without asking the problem about such a point.
        """
        if self.records[instance, solver].observed.taken:
            return True
        return self.solved(instance, solver, tau) and self.reached_at(instance, solver, tau) is None

    def run_effort(self, instance: Instance, solver: str, tau: float) -> float:
        """What a run needed to meet a target, in evaluations of the residual at published prices;
        infinite if it never met it, NaN if it did and not everything was counted.
        """
        if not self.solved(instance.name, solver, tau):
            return np.inf
        row = self.reached_at(instance.name, solver, tau)
        if row is None or self.records[instance.name, solver].observed.taken:
            return np.nan
        return float(self.units(instance.problem, row[: len(KINDS)]))

    def needed(self, tau: float) -> Array:
        """(P, S) the `run_effort` until the target, by comparable instance and solver."""
        if tau not in self._needed:
            each = [[self.run_effort(i, s, tau) for s in self.solvers] for i in self.comparable]
            self._needed[tau] = np.array(each).reshape(len(self.comparable), len(self.solvers))
        return self._needed[tau]

    @cached_property
    def _needed(self) -> dict[float, Array]:
        return {}

    def all_counted(self, tau: float) -> tuple[str, ...]:
        """The solvers whose effort until the target is known from every start."""
        columns = zip(self.solvers, self.needed(tau).T, strict=True)
        return tuple(solver for solver, column in columns if not np.isnan(column).any())

    def starts(self, problem: str | None = None) -> tuple[Instance, ...]:
        """The comparable instances of one problem, or of all."""
        return tuple(i for i in self.comparable if problem in (None, i.problem))

    def trace(self, instance: Instance, solver: str) -> Array:
        """(k, 3) effort, seconds and (f - f*) / (f_0 - f*) of the best point so far; the last row
        is the end of the run, whose effort is NaN if not everything was counted.
        """
        record, reference = self.records[instance.name, solver], self.references[instance.name]
        rows, lowest = record.observed.trace, record.lowest
        end = record.cost if record.at_end else np.inf
        whole = max(reference.start - reference.best, 0.0)
        hidden = record.observed.taken or lowest - end > AT_LOWEST * whole
        if np.isinf(min(lowest, end)):
            return np.zeros((0, 3))
        last = (*record.observed.counts, record.observed.seconds, end if hidden else lowest)
        rows = np.vstack([rows, last])
        gap = share_left(np.minimum.accumulate(rows[:, -1]), reference.best, reference.start)
        effort = self.units(instance.problem, rows[:, : len(KINDS)])
        if hidden:
            effort[-1] = np.nan
        seconds = np.maximum.accumulate(rows[:, -2])
        return np.column_stack([effort, seconds, np.maximum(gap, 0.0)])

    def success(self, solver: str, tau: float, problem: str | None = None) -> statistics.Interval:
        """The share of comparable instances, of one problem or of all, on which it met a target.

        Several starts of several problems are not independent of each other, and then the share
        has no interval; `solved_problems` has one.
        """
        starts = self.starts(problem)
        return self._share(sum(self.solved(i.name, solver, tau) for i in starts), starts)

    def solved_problems(self, solver: str, tau: float) -> statistics.Interval:
        """The share of problems of which it met a target from every comparable start."""
        all_met: dict[str, bool] = {}
        for i in self.comparable:
            met = self.solved(i.name, solver, tau)
            all_met[i.problem] = all_met.get(i.problem, True) and met
        return statistics.rate(sum(all_met.values()), len(all_met))

    def effort(self, solver: str, tau: float, problem: str | None = None) -> statistics.Interval:
        """The median effort until a target, failures infinite: over the starts of one problem, or,
        if there are several problems, over the medians of each, for starts of one problem are not
        independent of each other.
        """
        column = self.needed(tau)[:, self.solvers.index(solver)]
        if problem is not None:
            rows = [p for p, i in enumerate(self.comparable) if i.problem == problem]
            return statistics.median(column[rows])
        if len(self.compared) == 1:
            return statistics.median(column)
        return statistics.median([self.effort(solver, tau, p).value for p in self.compared])

    @staticmethod
    def _share(successes: int, instances: tuple[Instance, ...]) -> statistics.Interval:
        """A share of instances; its interval only where they are independent of each other."""
        share = statistics.rate(successes, len(instances))
        problems = {i.problem for i in instances}
        independent = len(problems) in (1, len(instances))
        return share if independent else statistics.Interval(share.value)

    def outcome_counts(self, solver: str) -> Counter[TargetOutcome]:
        """How many runs of a solver came to each outcome."""
        return Counter(v for (_, name), v in self.outcomes.items() if name == solver)

    def reached(self, solver: str) -> statistics.Interval:
        """The share of a solver's comparable runs that ended at the lowest cost known."""
        outcomes = [self.outcomes[i.name, solver] for i in self.comparable]
        return self._share(outcomes.count(TargetOutcome.REACHED), self.comparable)


def by_effort(comparison: Comparison, tau: float = MAIN_TAU) -> Pairs:
    """All pairs of solvers by effort until a target; the tests are corrected for their number."""
    problems, names = [i.problem for i in comparison.comparable], comparison.solvers
    amounts, pairs = comparison.needed(tau), list(combinations(range(len(names)), 2))
    tests = [paired_test(amounts[:, i], amounts[:, j], problems) for i, j in pairs]
    both_ways: Pairs = {}
    for (i, j), test in zip(pairs, holm_corrected(tests), strict=True):
        both_ways[names[i], names[j]], both_ways[names[j], names[i]] = test, test.turned
    return both_ways
