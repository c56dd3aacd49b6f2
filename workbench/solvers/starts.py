"""Several starts by one solver: the lowest end, and all minima that were found as hypotheses."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument, check_known, listed
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.processes import forked
from workbench.solvers.abilities import Abilities
from workbench.solvers.limits import Stop, stop_asked
from workbench.solvers.run import INTERRUPTED
from workbench.solvers.solution import (
    Callback,
    Evaluations,
    Hypothesis,
    Iterate,
    Solution,
    Solver,
    Status,
    checked,
)
from workbench.solvers.trust_region import TrustRegion

AS_GOOD = 1e-6  # of the cost: residuals that differ by less, as a cost, are those of one minimum
FAR_ABOVE_ROUNDING = 1e3  # of |r|
NEGLIGIBLE = 1e-12  # of the largest cost at a start: two ends without noise differ by as much
Draw = Callable[[Problem, Values, np.random.Generator], Values]


@dataclass(frozen=True)
class Spread:
    """Starts about the given one: independent normal noise is added to each number.

    Attributes:
        sigmas: the standard deviation of the noise by the name of a block, in its unit, such as
            `{"pose": 0.3, "trans": 0.1}`; other blocks stay. Between bounds, numbers are moved
            inside.
    """

    sigmas: Mapping[str, float]

    def __call__(self, problem: Problem, start: Values, rng: np.random.Generator) -> Values:
        """A start. Raises UnknownName for a block that the problem does not leave free."""
        free = {block.name: block for block in problem.free.blocks}
        for name in self.sigmas:
            check_known("free block", name, free)
        x, fixed = problem.split(start)
        sigma = problem.free.pack(
            {n: np.full(block.shape, self.sigmas.get(n, 0.0)) for n, block in free.items()}
        )
        moved = x + sigma * rng.standard_normal(len(x))
        return problem.values(np.clip(moved, problem.lower, problem.upper), fixed)


def within_bounds(problem: Problem, start: Values, rng: np.random.Generator) -> Values:
    """A start whose free numbers are drawn uniformly between their bounds.

    Raises BadArgument for a number without two finite bounds.
    """
    open_ended = ~(np.isfinite(problem.lower) & np.isfinite(problem.upper))
    if open_ended.any():
        labels = problem.free.labels_of(np.flatnonzero(open_ended))
        raise BadArgument(
            f"starts are drawn between two bounds, but {listed(labels[:6])} "
            f"{'has' if len(labels) == 1 else 'have'} not both; bound them, or draw by Spread"
        )
    _, fixed = problem.split(start)
    return problem.values(rng.uniform(problem.lower, problem.upper), fixed)


@dataclass(frozen=True)
class Starts:
    """Solve from several starts, and keep every minimum that was found.

    A run that ends at a saddle goes on once from the `lower` point beside it. The solution is the
    lowest end. Its `hypotheses` are the minima, the lowest first, each with the starts that led to
    it; ends whose residuals cannot be told apart are one minimum. The message says how likely it is
    that no further minimum exists (`all_seen`); a run that ended at a limit, away from all other
    ends, counts as a minimum of its own. The trace is that of the best start's run, evaluations and
    seconds are those of all runs, and the limits of the solver apply to each run by itself.

    Attributes:
        starts: the values of blocks at each start, in which what is left out stays as it is given
            to `solve`; or a number of starts, of which the first is the given one and the others
            are drawn.
        solver: what solves from each start; by default the solver of `solve`.
        draw: how further starts are drawn, if `starts` is a number: `Spread({"pose": 0.3})` about
            the given one, `within_bounds`, or a function of your own.
        seed: of the draws. Start k depends on the seed and k alone.
        workers: how many copies of this process solve at the same time. The result is the same.
    """

    starts: int | Sequence[Mapping[str, Any]]
    solver: Solver = field(default_factory=TrustRegion)
    draw: Draw = within_bounds
    seed: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        checked(self.solver)
        count = self.starts if isinstance(self.starts, int) else len(self.starts)
        for name, number in (("starts", count), ("workers", self.workers)):
            if number < 1:
                raise BadArgument(f"`{name}` must be 1 or more, not {number}")

    @property
    def abilities(self) -> Abilities | None:
        """The abilities of the solver, if it has any to tell."""
        return getattr(self.solver, "abilities", None)

    def drawn(self, problem: Problem, start: Values) -> list[Values]:
        """The values of all blocks at each start. Raises what `draw` raises."""
        if not isinstance(self.starts, int):
            return [{**start, **values} for values in self.starts]
        further = range(1, self.starts)
        draws = [self.draw(problem, start, np.random.default_rng((self.seed, k))) for k in further]
        return [{**start}, *({**start, **values} for values in draws)]

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from every start; see `Solver`.

        With several workers, `callback` gets the iterates of a run when the run has ended. An
        interrupt, or a callback that returns True, ends all runs; what was found is returned.
        """
        began, starts = time.perf_counter(), self.drawn(problem, start)
        ends: dict[int, Solution] = {}
        stops: list[Stop] = []  # that the callback has asked for
        reason, in_this_process = "", self.workers == 1

        def report(iterate: Iterate) -> bool:
            """Whether the callback has asked to stop, by now."""
            stop = None if callback is None else stop_asked(callback(iterate))
            if stop is not None:
                stops.append(stop)
            return bool(stops)

        def run(k: int) -> Solution:
            during = report if in_this_process else None
            first = self.solver.solve(problem, starts[k], callback=during)
            return beyond_saddle(first, self.solver, problem, starts[k], during)

        with Interrupts() as interrupts, closing(forked(run, len(starts), self.workers)) as runs:
            for k, end in runs:
                ends[k] = end
                if not in_this_process:
                    any(map(report, end.trace))  # up to the first at which it asks to stop
                if stops or end.status is Status.STOPPED or interrupts.pressed:
                    reason = stops[0].message if stops else end.message
                    break
        reason = INTERRUPTED if interrupts.pressed else reason
        cut = len(ends) < len(starts) or end.status is Status.STOPPED or interrupts.pressed
        numbered = dict(sorted(ends.items()))
        hypotheses = _hypotheses(problem, starts, numbered)
        best = numbered[hypotheses[0].starts[0]]
        whole = replace(
            best,
            solver=f"{len(starts)} starts of {best.solver}",
            message=f"{best.message}; {_in_words(hypotheses, len(ends))}",
            evaluations=sum((end.evaluations for end in ends.values()), Evaluations()),
            seconds=time.perf_counter() - began,
            hypotheses=hypotheses,
        )
        if cut:
            says_so = best.message.startswith(reason)
            message = whole.message if says_so else f"{reason}; {whole.message}"
            return replace(whole, status=Status.STOPPED, message=message)
        return whole


def _order(end: Solution) -> tuple[bool, float]:
    return end.violation > 1, end.cost if np.isfinite(end.cost) else np.inf


def _hypotheses(
    problem: Problem, starts: Sequence[Values], ends: Mapping[int, Solution]
) -> tuple[Hypothesis, ...]:
    """The minima among the ends, the lowest first; an end without a cost is one by itself."""
    finite = [k for k, end in ends.items() if np.isfinite(end.cost)]
    fixed: Array = problem.split(starts[0])[1]
    points = [problem.free.pack(ends[k].values) for k in finite]
    highest = max((ends[k].trace[0].cost for k in finite if ends[k].trace), default=0.0)
    least = NEGLIGIBLE * highest if np.isfinite(highest) else 0.0
    groups = [tuple(finite[i] for i in group) for group in clusters(problem, fixed, points, least)]
    groups += [(k,) for k in ends if k not in finite]
    minima = []
    for group in groups:
        in_order = tuple(sorted(group, key=lambda k: _order(ends[k])))
        end = ends[in_order[0]]
        minima.append(Hypothesis(end.values, end.cost, end.status, in_order, end.violation))
    return tuple(sorted(minima, key=lambda minimum: _order(ends[minimum.starts[0]])))


def _in_words(hypotheses: Sequence[Hypothesis], starts: int) -> str:
    """How many starts led to the best, and how sure it is that there are no other minima."""
    to_best, minima = len(hypotheses[0].starts), len(hypotheses)
    led_here = f"{to_best} of {starts} starts led here"
    if minima == 1:
        return f"{led_here}, and none elsewhere"
    others = f"the others to {minima - 1} other end{'s' if minima > 2 else ''}"
    return f"{led_here}, {others}; {further_minima(starts, minima)}"


def one_minimum(
    problem: Problem, fixed: Array, x: Array, r: Array, other: Array, least: float = 0.0
) -> bool:
    """Whether residuals (m,) at two points, the first at x (n,), cannot be told apart.

    1/2 |r - other|^2 is then at most a millionth of their cost, what rounding explains, or
    `least`. So what lies along null directions, or a full turn away, counts as the same minimum.
    """
    rounding = FAR_ABOVE_ROUNDING * problem.rounding(x, fixed, r).norm
    cost = 0.5 * max(float(r @ r), float(other @ other))
    difference = r - other
    return 0.5 * float(difference @ difference) <= AS_GOOD * cost + 0.5 * rounding**2 + least


def clusters(
    problem: Problem, fixed: Array, ends: Sequence[Array], least: float = 0.0
) -> tuple[tuple[int, ...], ...]:
    """The numbers of the ends (n,) that belong to one minimum, for each minimum, in their order.

    Residuals that differ by no more than `least`, as a cost, are those of one minimum.
    """
    residuals = [problem.residual(x, fixed) for x in ends]
    minima: list[list[int]] = []
    for k, (x, r) in enumerate(zip(ends, residuals, strict=True)):
        for members in minima:
            if any(one_minimum(problem, fixed, x, r, residuals[j], least) for j in members):
                members.append(k)
                break
        else:
            minima.append([k])
    return tuple(map(tuple, minima))


def all_seen(starts: int, minima: int) -> float:
    """The probability that there are no other minima than those seen.

    Starts are drawn independently; beforehand, every number of minima is equally likely, and
    nothing is known of the sizes of basins. NaN where there are too few starts to tell. Boender
    and Rinnooy Kan, Bayesian stopping rules for multistart global optimization methods, 1987.
    """
    if not starts > minima + 1:
        return np.nan
    return prod((starts - 1 - i) / (starts - 1 + i) for i in range(1, minima + 1))


def further_minima(starts: int, minima: int) -> str:
    """What `all_seen` gives, as a sentence without its capital and its full stop."""
    probability = all_seen(starts, minima)
    if np.isnan(probability):
        return "these are too few starts to say whether there are further minima"
    return f"the probability that there are no further minima is {probability:.2g}"


def beyond_saddle(
    first: Solution, solver: Solver, problem: Problem, start: Values, callback: Callback
) -> Solution:
    """Go on from the lower point beside a saddle, if that is where the `first` run ended.

    The lower of both ends counts, with its own trace and with the evaluations and the time of both.
    """
    if first.status is not Status.SADDLE or first.lower is None:
        return first

    def after(iterate: Iterate) -> Iterate:
        counts, seconds = first.evaluations + iterate.evaluations, first.seconds + iterate.seconds
        return replace(iterate, evaluations=counts, seconds=seconds)

    def report(iterate: Iterate) -> object:
        return None if callback is None else callback(after(iterate))

    second = solver.solve(problem, {**start, **first.lower}, callback=report)
    best = first
    if second.cost < first.cost:
        message = f"{second.message}; it went on from a saddle at a cost of {first.cost:.6g}"
        best = replace(second, trace=tuple(map(after, second.trace)), message=message)
    if second.status is Status.STOPPED:
        best = replace(best, status=Status.STOPPED, message=second.message)
    return replace(
        best,
        evaluations=first.evaluations + second.evaluations,
        seconds=first.seconds + second.seconds,
        judging=first.judging + second.judging,
    )
