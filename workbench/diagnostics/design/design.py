"""What to measure next: optimal design of experiments by the linear model at a point.

A candidate's residuals have a whitened Jacobian J_c. After it has been measured the information on
the unknowns is J'J + J_c'J_c, whatever is observed (Pukelsheim, Optimal Design of Experiments,
2006); so it is known beforehand, up to curvature, how uncertain they will be.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics.design.candidates import Candidate, Given, checked, rows_of
from workbench.diagnostics.design.criteria import Criterion, d_optimal
from workbench.diagnostics.design.held import (
    active_inequalities,
    combinations_left,
    directions_left,
)
from workbench.diagnostics.design.measurement_design import MeasurementDesign, Ranked
from workbench.diagnostics.design.search import Board, Progress, Search, automatic, null
from workbench.diagnostics.design.uncertainty import Uncertainty
from workbench.diagnostics.diagnose import diagnose
from workbench.diagnostics.linearized import check_finite, linearized
from workbench.diagnostics.point import Point
from workbench.errors import BadArgument
from workbench.problem import Problem


def design(
    problem: Problem,
    candidates: Given,
    values: Mapping[str, ArrayLike] | Sequence[Mapping[str, ArrayLike]],
    *,
    choose: int = 1,
    criterion: Criterion = d_optimal,
    search: Search = automatic,
    progress: Progress = lambda done, of: None,
) -> MeasurementDesign:
    """The `choose` of the candidates after which most is known, and how well it is known then.

    `candidates` are residuals (or several of them, or a Candidate) by their names; each can be
    measured once. `values` is the point at which the problem is linearized, or several of them,
    such as frames or draws of a prior. With several, the mean of the logarithm of the criterion
    counts (Chaloner and Verdinelli, Bayesian experimental design: a review, 1995), and the result
    says at how many points the choice is the one that is best there.

    The problem's own residuals, its priors and what has been observed already, count as known.
    Where they leave null directions, candidates that determine more of what matters come first,
    then those that determine more of all. Equations among the constraints and equal bounds hold
    exactly. Other bounds and constraints do not count, as an estimate may leave them; those that
    are active at a point are named in the result (`uncounted`), because standard deviations are
    then too large where the true values lie there as well. Kernels count as they are at the point.
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
    uncounted: dict[str, None] = {}
    made: dict[object, Problem] = {}
    for at in several:
        point = _point(problem, at)
        size, words = point.yardsticks.sizes, words or str(point.yardsticks)
        gradient, unit = _gradients(problem, criterion, at, size, made)
        seen = rows_of(problem, known, at, made)
        left = directions_left(point, size)
        if left is not None:
            gradient = combinations_left(gradient, left)
            if not gradient.shape[1]:
                raise BadArgument(
                    "equations hold all that matters, so that no candidate adds to it"
                )
        before.append(Uncertainty.of(point.here.scaled(size), left))
        uncounted |= dict.fromkeys(active_inequalities(point))
        gradients.append(gradient)
        rows.append({name: A * size for name, A in seen.items()})
        sizes.append(size)
    board = Board(
        tuple(before),
        tuple(gradients),
        criterion.size,
        tuple(tuple(each[name] for each in rows) for name in names),
    )
    found = search(board, int(choose), progress)
    single = _single(board, search, int(choose), found.candidates)
    directions = diagnose(problem, several[0]).null_directions if null(board.before) else ()
    return MeasurementDesign(
        criterion.name,
        unit,
        words,
        len(several),
        board.score(board.before),
        _ranking(board, names),
        tuple(names[i] for i in found.candidates),
        tuple(
            board.score(board.measuring(found.candidates[: k + 1]))
            for k in range(len(found.candidates))
        ),
        found.how,
        {tuple(names[i] for i in some): count for some, count in single.items()},
        tuple(direction.name for direction in directions),
        tuple(uncounted),
        problem.free,
        np.stack(sizes),
        board.before,
        board.measuring(found.candidates),
    )


def _points(values: object) -> list[Values]:
    several = [values] if isinstance(values, Mapping) else values
    if not isinstance(several, Sequence) or isinstance(several, str) or not several:
        raise BadArgument("the values are a dict of arrays by block, or a list of such dicts")
    return list(several)


def _point(problem: Problem, at: Values) -> Point:
    held = problem.frozen(at)
    here = linearized(held, at)
    check_finite(here)
    return Point(held, held.read(at), here)


def _gradients(
    problem: Problem,
    criterion: Criterion,
    at: Values,
    yardsticks: Array,
    made: dict[object, Problem],
) -> tuple[Array, str]:
    """Columns (n, q) of what matters, by unknowns in yardsticks, and their unit."""
    quantity = criterion.quantity
    if quantity is None:
        return criterion.gradients(problem.free, yardsticks)
    one = {quantity.name: Candidate((quantity.residual,))}
    rows = rows_of(problem, one, at, made)[quantity.name]
    if not rows.any():
        raise BadArgument(
            f"no free number changes {quantity.name} here, so no candidate can tell more about it"
        )
    return (rows * yardsticks).T, quantity.unit


def _ranking(board: Board, names: tuple[str, ...]) -> tuple[Ranked, ...]:
    """Every candidate by itself, best first; equal ones as they were given."""
    found = []
    for i, name in enumerate(names):
        state = board.after(board.before, i)
        sees = null(board.before) - null(state)
        nats = [u.nats(A) for u, A in zip(board.before, board.rows[i], strict=True)]
        found.append(Ranked(name, board.score(state), float(np.mean(nats)), sees))
    return tuple(sorted(found, key=lambda one: one.score))


def _single(
    board: Board, search: Search, choose: int, found: tuple[int, ...]
) -> dict[tuple[int, ...], int]:
    """The choices that are best at single points, and at how many of them."""
    if len(board.before) == 1:
        return {found: 1}
    counted: Counter[tuple[int, ...]] = Counter()
    for point in range(len(board.before)):
        best = search(board.at(point), choose, lambda done, of: None).candidates
        counted[tuple(sorted(best))] += 1
    return dict(counted)
