"""Whether the end of a run is no minimum: a saddle, or a cost that falls for ever.

At a minimum the Hessian H of the cost has no negative eigenvalue on the directions that bounds
leave free (Nocedal and Wright, Numerical Optimization, 2006, theorem 12.5). At most minima H is
nearly M = J'J + 1e-4 D^2, D the lengths of J's columns, so that M^-1 H has eigenvalues near 1 and a
negative one would lie apart. Lanczos' method finds such a one in a few steps, each of which takes
one gradient (Golub and Van Loan, Matrix Computations, 2013, sections 10.1 and 11.5).

exp(-x) has no least square. A run shows this if some unknowns grew to its last iterates without
slowing down, or a thousandfold in all. Then they are taken further and further; the one that grew
most is held there, the others follow by Gauss-Newton steps, and there is no finite minimum if the
cost never rises.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Mask
from workbench.problem import Linearization, Problem
from workbench.problem.optimality import ROUNDING_FACTOR, Rounding, decrease, half_squared
from workbench.problem.steps import EPS, factor_of
from workbench.solvers.limits import GUARDED
from workbench.solvers.solution import Evaluations, Iterate

CLEAR_FALL = 10.0  # times the tolerance's share of the cost: a fall by less is none
DAMPING_OF_M = 1e-4  # of D^2: directions that J does not notice are looked at first
DIFFERENCE_STEP = 1e-6  # of the terms of the residual: how far apart two gradients are taken
FLAT_EIGENVALUE = 0.1  # of M^-1 H: a smaller one is worth looking at
FURTHER_GRADIENTS = 20  # once an eigenvalue is negative
CLEAR_VECTOR = 0.1  # of an eigenvalue: how well it and its vector must be known
FIRST_DISTANCE = 1e-3  # of |r|, along columns of length 1: where the cost is tried first
LAST_DISTANCE = 0.1  # of an unknown's size, or of 1: where it is tried last
NEARLY_ZERO = 1e-9  # a number whose size says nothing of its unit
DOUBLINGS = 10  # of the step to a lower point, as long as the cost falls on
EVERY_DIRECTION_UP_TO = 20  # unknowns: every direction is looked at, by gradients to both sides
FEWEST_GRADIENTS = 2  # for more unknowns
EVALUATIONS_PER_GRADIENT = 10  # of the run, for each gradient beyond these
DENSE_UP_TO = 3000  # unknowns: an array M is factorized

FEWEST_ITERATES = 5  # fewer show no tendency
NOTABLE_GROWTH = 0.02  # of an unknown's size, in the last quarter of a run
STILL_GROWING = 0.3  # of the growth in the quarter before: at a minimum it is much less
GROWN_TO = 3.0  # times its value at the start, at least: how large such an unknown has become
THOUSANDFOLD = 1e3  # the size of an unknown over that at the start, or over 1: it may run off
# Distances in the way so far. At a minimum in between, the cost rises at one of them; it shows
# most cheaply far out, which is therefore tried before all others.
FAR_OUT = 100.0
DISTANCES = (0.01, 0.1, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0, 8.0, 15.0, 30.0, 100.0, 1e4, 1e6, 1e8)
FEWEST_DISTANCES = 8  # to be tried at least; beyond, the residual may be infinite
FOLLOWING_STEPS = 5  # Gauss-Newton steps of the other unknowns at each of them
FOLLOWING_ERROR = 1e-6  # of the cost: what these steps may leave above the least
STEP_SHARES = (1.0, 0.25, 0.06)  # parts of such a step that are tried

Product = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class EndPoint:
    """The point where a run ended. What is evaluated to judge it is counted apart from the run.

    Attributes:
        problem: the problem that was solved, by `Problem.for_judging`, so that a metered one takes
            none of these points for the best of the run.
        fixed: its fixed numbers.
        x: (n,) the point.
        here: the linearization there.
        rounding: the rounding errors of the residual there.
        start: (n,) where the run began.
        tolerance: the `Problem.optimality` up to which points count as stationary.
        check: called before every evaluation; it raises Stop if nobody wants to wait any longer.
        counts: how often the methods evaluated the problem, by kind.
    """

    problem: Problem
    fixed: Array
    x: Array
    here: Linearization
    rounding: Rounding
    start: Array
    tolerance: float
    check: Callable[[], object]
    counts: dict[str, int] = field(default_factory=lambda: asdict(Evaluations()))

    @property
    def size(self) -> Array:
        """The size of each unknown (n,): its own, or how far it is from the start; 1 for zero."""
        size = np.maximum(np.abs(self.x), np.abs(self.x - self.start))
        return np.where(size > NEARLY_ZERO, size, 1.0)

    @property
    def noise(self) -> float:
        """By how much rounding may have changed the cost."""
        return self.rounding.of_cost(self.here.residual)

    @property
    def worth(self) -> float:
        """By how much the cost must fall so that neither rounding nor the tolerance explains it."""
        return self.noise + CLEAR_FALL * self.tolerance**2 * self.here.cost

    def residual(self, x: Array) -> Array:
        """The residual at another point, (m,)."""
        self._count("residual")
        with GUARDED:
            return self.problem.residual(x, self.fixed)

    def gradient(self, x: Array) -> Array:
        """The gradient of the cost at another point, (n,)."""
        self._count("gradient")
        with GUARDED:
            return self.problem.cost_and_gradient(x, self.fixed)[1]

    def linearize(self, x: Array) -> Linearization:
        """The linearization at another point."""
        self._count("jacobian")
        with GUARDED:
            return self.problem.linearize_at(x, self.fixed)

    def _count(self, kind: str) -> None:
        self.check()
        self.counts[kind] += 1


class Saddle(NamedTuple):
    """What shows that a point is no minimum.

    Attributes:
        to: (n,) a point where the cost is lower.
        fall: by how much it is lower there.
    """

    to: Array
    fall: float


def most_gradients(n: int, evaluations: int) -> int:
    """How many gradients a search among n unknowns may take after so many evaluations."""
    if n <= EVERY_DIRECTION_UP_TO:
        return n
    return max(FEWEST_GRADIENTS, evaluations // EVALUATIONS_PER_GRADIENT)


def saddle(end: EndPoint, most: int) -> Saddle | None:
    """A direction along which the cost falls from a stationary point; None if none is found.

    At most `most` gradients are evaluated, and 20 more once a negative eigenvalue has shown. If
    they are fewer than the unknowns, a saddle may be missed. No minimum is taken for a saddle: the
    cost falls by more than rounding, the gradient that is left and the tolerance explain. With
    constraints other than bounds nothing is looked for.
    """
    here, x = end.here, end.x
    if here.constraints is not None or here.cost <= end.worth:
        return None
    D = np.maximum(here.column_norms, np.linalg.norm(here.residual) / end.size)
    held = _held(end, D)
    inverse = None if held.all() else _inverse(here, D, held)
    if inverse is None:
        return None
    step = DIFFERENCE_STEP * end.rounding.norm / (ROUNDING_FACTOR * EPS)

    def hessian_product(v: Array) -> Array:
        h = step / float(np.linalg.norm(v))
        ahead = (end.gradient(x + h * v / D) - here.gradient) / (h * D)
        if len(x) > EVERY_DIRECTION_UP_TO and np.isfinite(ahead).all():
            return np.where(held, 0.0, ahead)
        behind = (here.gradient - end.gradient(x - h * v / D)) / (h * D)
        sides = [side for side in (ahead, behind) if np.isfinite(side).all()]
        return np.where(held, 0.0, np.mean(sides or [ahead], axis=0))

    def falls(v: Array) -> Saddle | None:
        return _falls(end, v / float(np.linalg.norm(v)), D)

    return _searched(hessian_product, inverse, falls, held, most)


def _held(end: EndPoint, D: Array) -> Mask:
    """Unknowns that a bound holds, (n,): they are on it, and the cost falls towards it."""
    problem, x, slope = end.problem, end.x, end.here.gradient / D
    least = end.tolerance * float(np.linalg.norm(end.here.residual))
    low, high = x <= problem.lower, x >= problem.upper
    held = (low & (slope > least)) | (high & (slope < -least)) | (low & high)
    return np.asarray(held | ~problem.support.read)


def _inverse(here: Linearization, D: Array, held: Mask) -> Product | None:
    """The product of M^-1 and a vector, of the unknowns D x; None if that is not affordable."""
    normal, n = here.normal, len(D)
    if not isinstance(normal, np.ndarray):
        factor = factor_of(normal, np.where(held, 1.0, DAMPING_OF_M) * D**2)
        return None if factor is None else lambda v: np.where(held, 0.0, D * factor.solve(D * v))
    if n > DENSE_UP_TO:
        return None
    M = normal / np.outer(D, D)
    if held.any():
        M[held], M[:, held] = 0.0, 0.0
    M[np.diag_indices(n)] += DAMPING_OF_M
    L, failed = scipy.linalg.lapack.dpotrf(M, lower=True)
    if failed:
        return None
    return lambda v: np.asarray(scipy.linalg.lapack.dpotrs(L, v, lower=True)[0])


@lru_cache(maxsize=4)
def random_vector(n: int) -> Array:
    """Random numbers (n,), normally distributed and always the same; they cannot be written to."""
    vector = np.random.default_rng(0).standard_normal(n)
    vector.setflags(write=False)
    return vector


def _searched(
    hessian_product: Product,
    inverse: Product,
    falls: Callable[[Array], Saddle | None],
    held: Mask,
    most: int,
) -> Saddle | None:
    """Lanczos' method for the least eigenvalue of M^-1 H, and whether the cost falls along it."""
    n, size = len(held), int((~held).sum())
    u = np.where(held, 0.0, random_vector(n))
    w = inverse(u)
    beta = float(np.sqrt(u @ w))
    dual, primal = np.zeros((n, 0)), np.zeros((n, 0))
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    most, tried = min(most, size), False
    most_if_negative = min(most + FURTHER_GRADIENTS, size)
    for k in range(1, size + 1):
        dual = np.concatenate([dual, (u / beta)[:, None]], axis=1)
        primal = np.concatenate([primal, (w / beta)[:, None]], axis=1)
        u = hessian_product(primal[:, -1])
        if not np.isfinite(u).all():
            return None
        diagonal.append(float(u @ primal[:, -1]))
        T = np.diag(diagonal) + np.diag(off_diagonal, -1) + np.diag(off_diagonal, 1)
        values, vectors = np.linalg.eigh(T)
        for _ in range(2):  # twice, so that rounding does not bring the same vectors back
            u = u - dual @ (primal.T @ u)
        w = inverse(u)
        beta = float(np.sqrt(max(float(u @ w), 0.0)))
        off_diagonal.append(beta)
        least = float(values[0])
        negative = least < -FLAT_EIGENVALUE
        if negative and not tried:
            most = most_if_negative
        last = k >= most or beta <= EPS * float(np.abs(values).max())
        clear = beta * abs(float(vectors[-1, 0])) <= CLEAR_VECTOR * abs(least)
        if (last and least < FLAT_EIGENVALUE) or (negative and clear and not tried):
            beside, tried = falls(primal @ vectors[:, 0]), True
            if beside is not None:
                return beside
        if last:
            return None
    return None


def _falls(end: EndPoint, d: Array, D: Array) -> Saddle | None:
    """Whether the cost falls along d (n,), of length 1, to one of its sides, and how far it does.

    It is tried at growing distances until it changes by more than rounding.
    """
    here, x = end.here, end.x
    low, high = end.problem.lower, end.problem.upper
    farthest = LAST_DISTANCE / float(np.max(np.abs(d) / D / end.size))

    def fall_at(distance: float) -> tuple[float, float]:
        """By how much the cost is lower there, and how much of that may be rounding."""
        r = end.residual(np.clip(x + distance * d / D, low, high))
        fall = decrease(here.residual, r)
        noise = end.rounding.of_decrease(here.residual, r != here.residual)
        return (fall if np.isfinite(fall) else -np.inf), noise

    distance = FIRST_DISTANCE * float(np.linalg.norm(here.residual))
    while distance <= farthest:
        (ahead, noise_ahead), (behind, noise_behind) = fall_at(distance), fall_at(-distance)
        curved, noise = ahead + behind, noise_ahead + noise_behind
        best, fall = (distance, ahead) if ahead >= behind else (-distance, behind)
        by_gradient = 2 * distance * abs(float(here.gradient @ (d / D)))
        if curved > noise or fall > noise + by_gradient:
            for _ in range(DOUBLINGS):
                further, _ = fall_at(2 * best)
                if further <= fall:
                    break
                best, fall = 2 * best, further
            to = np.clip(x + best * d / D, low, high)
            return Saddle(to, fall) if fall > end.worth else None
        if curved < -noise:
            return None
        distance *= 10
    return None


def diverging(end: EndPoint, trace: Sequence[Iterate], noticed: Mask, converged: bool) -> Mask:
    """The unknowns (n,) that run off while the cost falls.

    Candidates have grown to the end (`_growing`), or have become a thousand times as large as they
    were, or as 1; and they changed the residual by more than rounding: `noticed` (n,).
    """
    last, none = len(trace) - 1, np.zeros(len(end.x), dtype=bool)
    if last < 1 or not trace[last // 2].cost > end.here.cost + end.noise:
        return none
    growing = none
    if last + 1 >= FEWEST_ITERATES:
        growing = _growing(end, trace, converged) & noticed
    limit = np.where(end.x > 0, end.problem.upper, end.problem.lower)
    large = (_growth(end) > THOUSANDFOLD) & ~np.isfinite(limit)
    running = (growing | large) & noticed & (end.x != end.start)
    return running if running.any() and _never_rises(end, running, growing) else none


def _growth(end: EndPoint) -> Array:
    """How many times as large as at the start, or as 1, the unknowns have become, (n,)."""
    return np.asarray(np.abs(end.x) / np.maximum(np.abs(end.start), 1.0))


def _never_rises(end: EndPoint, running: Mask, growing: Mask) -> bool:
    """Whether the cost never rises as the `running` unknowns (n,) are taken far out, and falls.

    The one that has grown most is held at each distance, and all others follow. What is still
    `growing` (n,), or has become a million times as large, need not show again that the cost falls.
    """
    growth = np.where(running, _growth(end), 0.0)
    leading = np.arange(len(growth)) == np.argmax(growth)
    displacement, noise = np.where(running, end.x - end.start, 0.0), end.noise

    def farther(distance: float, x: Array, r: Array) -> tuple[Array, Array, bool]:
        """The next point after x (n,), its residual (m,), and whether it costs no more."""
        to = np.where(running, end.x + distance * displacement, x)
        to = _others_followed(end, to, leading, noise)
        r_to = end.residual(to)
        with GUARDED:
            rounding = end.problem.rounding(to, end.fixed, r_to, 0.0)  # of terms that have grown
        unexplained = FOLLOWING_ERROR * half_squared(r) + rounding.of_decrease(r_to, r_to != r)
        return to, r_to, not decrease(r, r_to) < -unexplained

    x = _others_followed(end, end.x, leading, noise)
    first = r = end.residual(x)
    if not farther(FAR_OUT, x, r)[2]:
        return False
    tried = 0
    for distance in DISTANCES:
        x, r_to, no_higher = farther(distance, x, r)
        if not np.isfinite(r_to).all():
            break
        if not no_higher:
            return False
        r, tried = r_to, tried + 1
    falls = growing.any() or growth.max() > THOUSANDFOLD**2 or decrease(first, r) > end.worth
    return bool(tried >= FEWEST_DISTANCES and falls)


def _growing(end: EndPoint, trace: Sequence[Iterate], converged: bool) -> Mask:
    """The unknowns (n,) that grew as fast in the last quarter of the run as before."""
    last, pack = len(trace) - 1, end.problem.free.pack
    quarter = (3 * last) // 4
    middle, late, final = (pack(trace[k].values) for k in (last // 2, quarter, last))
    growing = _grown(end, middle, late, end.x)
    if trace[last].cost <= end.here.cost + end.noise:  # the best may be one of several at its cost
        growing |= _grown(end, middle, late, final)
    if converged:
        step = np.abs(final - pack(trace[last - 1].values))
        growing &= step > STILL_GROWING * np.abs(final - late) / (last - quarter)
    return growing


def _grown(end: EndPoint, middle: Array, late: Array, final: Array) -> Mask:
    """The unknowns (n,) that grew as fast from `late` to `final` (n,) as from `middle` to `late`.

    They are away from zero and from the start, and no bound is ahead.
    """
    before, now = late - middle, final - late
    size = np.abs(final)
    grown = (size >= GROWN_TO * np.abs(end.start)) & (np.abs(now) > NOTABLE_GROWTH * size)
    grown &= np.abs(now) > STILL_GROWING * np.abs(before)
    grown &= (now * before > 0) & (now * final > 0)
    limit = np.where(now > 0, end.problem.upper, end.problem.lower)
    return np.asarray(grown & ~np.isfinite(limit))


def _others_followed(end: EndPoint, x: Array, held: Mask, noise: float) -> Array:
    """The point after the unknowns that are not `held` (n,) followed, by Gauss-Newton steps.

    They stop where the cost does not fall by more than the `noise`, or the linearization is not
    finite.
    """
    others = np.flatnonzero(~held)
    for _ in range(FOLLOWING_STEPS if others.size else 0):
        here = end.linearize(x)
        if not here.finite:
            return x
        step = np.zeros(len(x))
        step[others] = here.columns(others).step()
        lower = _first_lower(end, x, step, here.cost - noise)
        if lower is None:
            return x
        x = lower
    return x


def _first_lower(end: EndPoint, x: Array, step: Array, cost: float) -> Array | None:
    """The first point along a step (n,) at which the cost is lower than this one, if there is."""
    for share in STEP_SHARES:
        to = np.clip(x + share * step, end.problem.lower, end.problem.upper)
        if half_squared(end.residual(to)) < cost:
            return to
    return None
