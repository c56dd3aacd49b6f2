"""What to measure next: optimal design of experiments by the linear model at a point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Layout, Values
from workbench.blocks.layout import entries
from workbench.diagnostics.active_set import check_finite, linearized
from workbench.diagnostics.design.candidates import (
    SCALES,
    Candidate,
    Criterion,
    Given,
    checked,
    d_optimal,
    rows_of,
)
from workbench.diagnostics.design.search import (
    Board,
    Progress,
    Score,
    State,
    Uncertainty,
    combinations_left,
    directions_left,
    null,
    searched,
)
from workbench.diagnostics.diagnosis import Diagnosis, diagnose
from workbench.errors import BadArgument, some_of
from workbench.problem import Problem

MOST_SHOWN = 12  # candidates in the text


@dataclass(frozen=True)
class Ranked:
    """One candidate by itself.

    Attributes:
        name: its name.
        score: the criterion after it was measured.
        nats: the information that it adds on what was determined before, a mean over the points.
        sees: how many null directions it closes, summed over the points.
    """

    name: str
    score: Score
    nats: float
    sees: int

    @property
    def sd(self) -> float:
        """The criterion as a standard deviation; infinite if what matters stays undetermined."""
        return self.score.sd


@dataclass(frozen=True, eq=False)
class MeasurementDesign:
    """Which candidates to measure next, and what is known before and after.

    Attributes:
        criterion: the name of the criterion.
        unit: the unit of the criterion.
        scale_words: what the characteristic scales are at the first point, block by block.
        points: how many points were averaged over.
        before: the criterion before any candidate is measured.
        ranking: every candidate by itself, the best first.
        chosen: the names of the chosen ones, best first.
        steps: the criterion after the first chosen one, the first two, and so on.
        search: what the search did, in a sentence.
        undetermined: the names of the null directions before, at the first point.
        free: the layout of the unknowns.
        scales: (T, n) of the unknowns at each point.
        known_before: what is known at each point.
        known_after: the same after all chosen ones.
    """

    criterion: str
    unit: str
    scale_words: str
    points: int
    before: Score
    ranking: tuple[Ranked, ...]
    chosen: tuple[str, ...]
    steps: tuple[Score, ...]
    search: str
    undetermined: tuple[str, ...]
    free: Layout = field(repr=False)
    scales: Array = field(repr=False)
    known_before: State = field(repr=False)
    known_after: State = field(repr=False)

    @property
    def best(self) -> str:
        """The name of the best candidate by itself."""
        return self.ranking[0].name

    @property
    def after(self) -> Score:
        """The criterion after all chosen ones."""
        return self.steps[-1]

    @property
    def gain(self) -> float:
        """How many times smaller the standard deviation becomes; infinite where it had no limit."""
        if self.before.open and not self.after.open:
            return float("inf")
        return float(np.exp(self.before.log_sd - self.after.log_sd))

    @property
    def sd_before(self) -> Array:
        """(n,) the standard deviation of each unknown in its unit, rms over the points."""
        return _sds(self.known_before, self.scales)

    @property
    def sd_after(self) -> Array:
        """(n,) the same after all chosen ones were measured."""
        return _sds(self.known_after, self.scales)

    def sds(self, name: str) -> tuple[float, float]:
        """The sd of a block or entry before and after, rms over its entries. Raises UnknownName."""
        at = entries(self.free, name)
        before, after = (np.sqrt(np.mean(s[at] ** 2)) for s in (self.sd_before, self.sd_after))
        return float(before), float(after)

    def report(self) -> str:
        """The design as text."""
        averaged = f", averaged over {self.points} points" if self.points > 1 else ""
        lines = [
            f"WHAT TO MEASURE NEXT: {len(self.chosen)} of {len(self.ranking)} candidates",
            f"by {self.criterion}{averaged}",
            f"  before: {self._in_words(self.before)}",
        ]
        if self.unit == SCALES:
            lines.append("  the characteristic scales are")
            lines += [f"    {one}" for one in self.scale_words.split("; ")]
        if self.undetermined:
            lines.append(f"  nothing determines {some_of(self.undetermined)}")
        lines += [f"EACH CANDIDATE BY ITSELF ({self.unit}; gain in nats)"]
        width = max(len(one.name) for one in self.ranking)
        for place, ranked in enumerate(self.ranking[:MOST_SHOWN], 1):
            sees = f", sees {ranked.sees} undetermined directions" if ranked.sees else ""
            sd = self._in_words(ranked.score)
            lines.append(
                f"  {place:3}. {ranked.name:{width}}  {sd}  ({ranked.nats:.2f} nats{sees})"
            )
        if len(self.ranking) > MOST_SHOWN:
            last = self.ranking[-1]
            lines.append(f"  ... and {len(self.ranking) - MOST_SHOWN} more")
            lines.append(
                f"  {len(self.ranking):3}. {last.name:{width}}  {self._in_words(last.score)}"
            )
        lines.append(f"THE CHOICE ({self.search})")
        for name, score in zip(self.chosen, self.steps, strict=True):
            lines.append(f"  + {name:{width}}  {self._in_words(score)}")
        lines.append("STANDARD DEVIATIONS by block, before and after (rms of the entries)")
        for block in self.free.blocks:
            before, after = self.sds(block.name)
            lines.append(f"  {block.name}: {before:.3g} -> {after:.3g} {block.unit}")
        return "\n".join(lines)

    def data(self) -> dict[str, Any]:
        """The design as plain values, for JSON; what is infinite is None."""

        def number(value: float) -> float | None:
            return value if np.isfinite(value) else None

        return {
            "criterion": self.criterion,
            "unit": self.unit,
            "points": self.points,
            "before": number(self.before.sd),
            "after": number(self.after.sd),
            "gain": number(self.gain),
            "search": self.search,
            "chosen": list(self.chosen),
            "steps": [number(score.sd) for score in self.steps],
            "undetermined": list(self.undetermined),
            "ranking": [
                {"name": r.name, "sd": number(r.sd), "nats": r.nats, "sees": r.sees}
                for r in self.ranking
            ],
            "blocks": {
                block.name: [number(sd) for sd in self.sds(block.name)]
                for block in self.free.blocks
            },
        }

    def _in_words(self, score: Score) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if score.open:
            return f"{score.open} undetermined"
        return f"{score.sd:.4g}{unit}"


def _sds(known: State, scales: Array) -> Array:
    each = np.stack([u.sds for u in known]) * scales
    return np.asarray(np.sqrt(np.mean(each**2, axis=0)))


def design(
    problem: Problem,
    candidates: Given,
    values: Mapping[str, ArrayLike] | Sequence[Mapping[str, ArrayLike]],
    *,
    choose: int = 1,
    criterion: Criterion = d_optimal,
    progress: Progress = lambda done, of: None,
) -> MeasurementDesign:
    """The `choose` of the candidates after which most is known, and how well it is known then.

    `candidates` are residuals (or several of them, or a Candidate) by their names; each can be
    measured once. `values` is the point at which the problem is linearized, or several of them,
    such as frames or draws of a prior. With several, the mean of the logarithm of the criterion
    counts (Chaloner and Verdinelli, Bayesian experimental design: a review, 1995).

    The problem's own residuals, its priors and what has been observed already, count as known.
    Where they leave null directions, candidates that determine more of what matters come first,
    then those that determine more of all. Equations among the constraints and equal bounds hold
    exactly. Other bounds and constraints do not count, as an estimate may leave them: standard
    deviations are too large if the true values lie on them. Kernels count as they are at the point.
    Raises BadArgument, UnknownName for a candidate that reads an unknown block, NotFinite,
    TooLarge, and what `Problem.split` raises for the values.
    """
    if not isinstance(problem, Problem):
        raise BadArgument(f"a design is for a Problem, not a {type(problem).__name__}")
    if not isinstance(criterion, Criterion):
        raise BadArgument(
            "the criterion is an object such as d_optimal or sd_of('trans[z]'), not "
            f"{criterion!r:.60}"
        )
    known, several = checked(candidates), _points(values)
    if not isinstance(choose, (int, np.integer)) or not 1 <= choose <= len(known):
        raise BadArgument(f"1 to {len(known)} of the candidates can be chosen, not {choose}")
    names, sizes, words, unit = tuple(known), [], "", ""
    before, gradients, rows = [], [], []
    known_problems: dict[object, Problem] = {}
    for at in several:
        point = _point(problem, at)
        scales, words = point.scales.sizes, words or str(point.scales)
        gradient, unit = _gradients(problem, criterion, at, scales, known_problems)
        seen = rows_of(problem, known, at, known_problems)
        left = directions_left(point, scales)
        if left is not None:
            gradient = combinations_left(gradient, left)
            if not gradient.shape[1]:
                raise BadArgument(
                    "equations hold all that matters, so that no candidate adds to it"
                )
        before.append(Uncertainty.of(point.here.scaled(scales), left))
        gradients.append(gradient)
        rows.append({name: A * scales for name, A in seen.items()})
        sizes.append(scales)
    board = Board(
        tuple(before),
        tuple(gradients),
        criterion.size,
        tuple(tuple(each[name] for each in rows) for name in names),
    )
    chosen, how = searched(board, int(choose), progress)
    directions = diagnose(problem, several[0]).null_directions if null(board.before) else ()
    return MeasurementDesign(
        criterion.name,
        unit,
        words,
        len(several),
        board.score(board.before),
        _ranking(board, names),
        tuple(names[i] for i in chosen),
        tuple(board.score(board.measuring(chosen[: k + 1])) for k in range(len(chosen))),
        how,
        tuple(direction.name for direction in directions),
        problem.free,
        np.stack(sizes),
        board.before,
        board.measuring(chosen),
    )


def _points(values: object) -> list[Values]:
    several = [values] if isinstance(values, Mapping) else values
    if not isinstance(several, Sequence) or isinstance(several, str) or not several:
        raise BadArgument("the values are a dict of arrays by block, or a list of such dicts")
    return list(several)


def _point(problem: Problem, at: Values) -> Diagnosis:
    held = problem.frozen(at)
    here = linearized(held, at)
    check_finite(here)
    return Diagnosis(held, held.read(at), here)


def _gradients(
    problem: Problem,
    criterion: Criterion,
    at: Values,
    scales: Array,
    known_problems: dict[object, Problem],
) -> tuple[Array, str]:
    """Columns (n, q) of what matters, by unknowns in their scales, and their unit."""
    quantity = criterion.quantity
    if quantity is None:
        return criterion.gradients(problem.free, scales)
    one = {quantity.name: Candidate((quantity.residual,))}
    rows = rows_of(problem, one, at, known_problems)[quantity.name]
    if not rows.any():
        raise BadArgument(
            f"no free number changes {quantity.name} here, so no candidate can tell more about it"
        )
    return (rows * scales).T, quantity.unit


def _ranking(board: Board, names: tuple[str, ...]) -> tuple[Ranked, ...]:
    """Every candidate by itself, best first; equal ones as they were given."""
    ranking = []
    for i, name in enumerate(names):
        state = board.after(board.before, i)
        sees = null(board.before) - null(state)
        nats = [u.nats(A) for u, A in zip(board.before, board.rows[i], strict=True)]
        ranking.append(Ranked(name, board.score(state), float(np.mean(nats)), sees))
    return tuple(sorted(ranking, key=lambda one: one.score))
