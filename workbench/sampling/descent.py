"""A minimum of the cost in what is sampled, and Laplace's approximation there."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
import scipy.special

from workbench.arrays import Array, Index
from workbench.errors import WorkbenchError
from workbench.sampling.feasible import violation_in_words
from workbench.sampling.log_density import LogDensity
from workbench.sampling.subspace import svd_of_full_rank

Vector = Callable[[Array], Array]
SETTLED = 0.1  # of the predicted decrease of the cost: at a minimum it is less
AT_A_BOUND = 1e-6  # of the scale of an entry: it is held there
INSIDE = 1e-9  # of the scale of a bound: where a search for a minimum stops in front of it
BISECTIONS = 50  # of the way out of a domain: what is left of it is no more than rounding
ROUNDED = 1e-12  # of the largest entry of a direction: zero, but for rounding


class NoMinimum(WorkbenchError):
    """A search that ended where constraints are violated."""


@dataclass(frozen=True, eq=False)
class Mode:
    """A minimum of the cost in z, and Laplace's approximation there.

    Attributes:
        z: (k,) where the cost is least.
        cost: the cost there.
        half: (k, k) such that half @ half.T is the covariance.
        log_mass: the log of its integral, up to a constant that all modes share.
        share: its share of the mass of all modes.
        found: how many searches ended here.
        settled: whether the linear model predicts almost no further decrease of the cost.
    """

    z: Array
    cost: float
    half: Array
    log_mass: float
    share: float = 1.0
    found: int = 1
    settled: bool = True

    def of_entries(self, at: Index) -> "Mode":
        """The same minimum in some entries (m,): the marginal of its Gaussian."""
        half = np.asarray(np.asarray(np.linalg.qr(self.half[at].T, mode="r")).T)
        return replace(self, z=self.z[at], half=half)

    def away(self, z: Array) -> float:
        """How many standard deviations a point is away, as a root mean square over entries."""
        return float(np.linalg.norm(np.linalg.solve(self.half, z - self.z)) / np.sqrt(len(z)))


def mode_from(target: LogDensity, start: Array) -> Mode:
    """The minimum that least squares reaches from z = start, inside bounds and constraints.

    It takes no step that leads out of the domain of a residual, such as one behind a camera. Raises
    Improper where a direction is held by nothing, and NoMinimum where no point that meets the
    constraints is reached.
    """
    problem, space = target.problem, target.subspace

    def residual(z: Array) -> Array:
        return problem.residual(_x(target, z), target.fixed)

    def limited_residual(z: Array) -> Array:
        """Infinite outside of a domain, so that no step leads there."""
        r = residual(z)
        return r if target.in_domain(z[None])[0] else np.full_like(r, np.inf)

    def jacobian(z: Array) -> Array:
        return problem.linearize_at(_x(target, z), target.fixed).jacobian @ space.along

    low, high = bounds_of(target)
    gap = 1e-10 * np.maximum(1.0, abs(start))
    thin = high - low <= 4 * gap  # trf wants room
    start = np.where(thin, start, np.clip(start, low + gap, high - gap))
    wide = np.where(thin, -np.inf, low), np.where(thin, np.inf, high)
    ended = scipy.optimize.least_squares(
        limited_residual, start, jacobian, bounds=wide, x_scale="jac", max_nfev=200
    )
    z, settled = np.asarray(ended.x), True
    limited = problem.stacked_constraints is not None or len(dependent_bounds(target)[0])
    if not limited or target.allows(space.points(z[None]))[0]:
        settled = _predicted_decrease(residual(z), jacobian(z), z, low, high) < SETTLED
    else:
        z, settled = _constrained(target, start, residual, jacobian)
    half = covariance_half(target, jacobian(z))
    cost = 0.5 * float(np.sum(residual(z) ** 2))
    log_det = np.linalg.slogdet(half)[1] + _cut_off(jacobian(z), residual(z), z, low, high)
    return Mode(z, cost, half, float(log_det - cost), settled=settled)


def _cut_off(J: Array, r: Array, z: Array, low: Array, high: Array) -> float:
    """The log of the share of Laplace's Gaussian at z that bounds leave, where z is on bounds.

    For an entry on a bound let g be the slope with which the cost rises away from the bound, and
    sigma its standard deviation if the entries on no bound are free. The share is
    exp((g sigma)^2 / 2) Phi(-g sigma): the integral of exp(-g t - t^2 / (2 sigma^2)) over t > 0,
    divided by that of exp(-t^2 / (2 sigma^2)) over all t. The shares of several such entries are
    multiplied.
    """
    near = AT_A_BOUND * np.maximum(1.0, abs(z))
    at_low, at_high = z - low <= near, high - z <= near
    held = (at_low | at_high) & (high > low)
    if not held.any():
        return 0.0
    slope = np.where(at_low, J.T @ r, -(J.T @ r))[held]
    rest, _ = np.linalg.qr(J[:, ~held])
    across = J[:, held] - rest @ (rest.T @ J[:, held])
    lengths = np.linalg.norm(across, axis=0)  # 0 where bounds alone hold an entry
    reach = np.divide(slope, lengths, out=np.zeros_like(slope), where=lengths > 0)
    return float(np.sum(log_scaled_tail(reach)))


def log_scaled_tail(u: Array) -> Array:
    """log of exp(u^2 / 2) Phi(-u), which is erfcx(u / sqrt 2) / 2."""
    return np.asarray(np.log(scipy.special.erfcx(u / np.sqrt(2)) / 2))


def bounds_of(target: LogDensity) -> tuple[Array, Array]:
    """The bounds of z, (k,) each; infinite if z are directions and not entries."""
    space, problem = target.subspace, target.problem
    if space.entries is None:
        return np.full(space.size, -np.inf), np.full(space.size, np.inf)
    return problem.lower[space.entries], problem.upper[space.entries]


def dependent_bounds(target: LogDensity) -> tuple[Array, Array, Array]:
    """Bounds on numbers that move with z without being among its entries: low <= A z <= high.

    Such are all numbers where z are directions, and those on the ridge of what is integrated out.
    A is (c, k), low and high (c,); c is 0 where z are entries and the rest stays where it is.
    """
    space, problem = target.subspace, target.problem
    bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
    if space.entries is not None:
        bounded[space.entries] = False
    size = abs(space.along).max(axis=0, initial=0.0)  # what rounding moves does not move
    bounded &= (abs(space.along) > ROUNDED * size).any(axis=1)
    A = space.along[bounded]
    there = space.origin[bounded] - A @ space.centre
    return A, problem.lower[bounded] - there, problem.upper[bounded] - there


def covariance_half(target: LogDensity, J: Array) -> Array:
    """A square root of (J'J)^-1.

    The variance of an entry with two bounds is at most that of a uniform distribution.
    """
    return inverse_half(target, np.vstack([J, rows_between(*bounds_of(target), np.sqrt(12))]))


def rows_between(low: Array, high: Array, scale: float) -> Array:
    """For every entry with two bounds, a row that weighs it by `scale` over their distance."""
    width = high - low
    known = np.isfinite(width) & (width > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.diag(np.where(known, scale / width, 0.0))[known])


def inverse_half(target: LogDensity, J: Array) -> Array:
    """A half (k, k) with half half' = (J'J)^-1. Raises Improper if J has no full rank."""
    labels = target.subspace.labels

    def named(direction: Array) -> str:
        return f"a direction with {labels[int(np.argmax(abs(direction)))]}"

    lengths, s, V = svd_of_full_rank(J, named)
    return np.asarray(V / s / lengths[:, None])


def into_bounds(target: LogDensity, allowed: Array, z: Array) -> Array:
    """z, or so much of the way to it from an allowed point that it has a density."""
    for _ in range(60):
        if np.isfinite(target(z[None])[0]):
            return z
        z = allowed + 0.5 * (z - allowed)
    return allowed.copy()


def _x(target: LogDensity, z: Array) -> Array:
    return np.asarray(target.subspace.points(z[None])[0])


def _constrained(
    target: LogDensity, start: Array, residual: Vector, jacobian: Vector
) -> tuple[Array, bool]:
    """The minimum from there by SciPy's SLSQP, in units of the Jacobian's columns.

    SLSQP may end outside of the domain of a residual. Then the point is the last one in the domains
    on the straight way to that end, and False says that it is no minimum.
    """
    space, there = target.subspace, target.problem.stacked_constraints
    lengths = np.linalg.norm(jacobian(start), axis=0)
    scale = 1 / np.where(lengths > 0, lengths, 1.0)
    G, low, high = dependent_bounds(target)
    low, high = low + _inside(low), high - _inside(high)
    moving = np.zeros(0, dtype=bool)
    if there is not None:
        moving = ~there.equal  # an equation between numbers that stay is no matter of z
        low = np.concatenate([there.lower[moving], low])
        high = np.concatenate([there.upper[moving], high])
    below, above = np.isfinite(low), np.isfinite(high)

    def margins(u: Array) -> Array:
        z = start + scale * u
        c = G @ z
        if there is not None:
            c = np.concatenate([there.values(_x(target, z), target.fixed)[moving], c])
        return np.concatenate([(c - low)[below], (high - c)[above]])

    def slopes(u: Array) -> Array:
        A = G * scale
        if there is not None:
            seen = there.linearize(_x(target, start + scale * u), target.fixed)
            A = np.vstack([seen.along(space.along)[moving] * scale, A])
        return np.concatenate([A[below], -A[above]])

    def cost(u: Array) -> float:
        z = start + scale * u
        inside = target.in_domain(z[None])[0]
        return 0.5 * float(np.sum(residual(z) ** 2)) if inside else np.inf

    def gradient(u: Array) -> Array:
        z = start + scale * u
        return np.asarray(scale * (jacobian(z).T @ residual(z)))

    least, most = ((side - start) / scale for side in bounds_of(target))
    ended = scipy.optimize.minimize(
        cost,
        np.zeros(len(start)),
        method="SLSQP",
        jac=gradient,
        bounds=scipy.optimize.Bounds(least, most),
        constraints=scipy.optimize.NonlinearConstraint(margins, 0.0, np.inf, jac=slopes),
        options={"maxiter": 500, "ftol": 1e-10},
    )
    end = np.asarray(start + scale * ended.x)
    z = _into_domain(target, start, end)
    if not target.allows(space.points(z[None]))[0]:
        why = violation_in_words(target.problem, target.fixed, _x(target, z))
        raise NoMinimum(
            f"no point near the start meets the bounds and constraints ({why}); solve the problem "
            "with a solver that takes constraints, and start at its answer"
        )
    return z, z is end


def _into_domain(target: LogDensity, start: Array, end: Array) -> Array:
    """The end (k,), or the last point in the domains on the way to it from a start in them."""
    if target.in_domain(end[None])[0]:
        return end
    inside, outside = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (inside + outside)
        if target.in_domain((start + middle * (end - start))[None])[0]:
            inside = middle
        else:
            outside = middle
    return np.asarray(start + inside * (end - start))


def _inside(limit: Array) -> Array:
    """How far inside of a limit a search is to stay."""
    return INSIDE * np.maximum(1.0, np.where(np.isfinite(limit), abs(limit), 0.0))


def _predicted_decrease(r: Array, J: Array, z: Array, low: Array, high: Array) -> float:
    """By how much the linear model predicts that the cost can fall, entries at bounds fixed."""
    near = AT_A_BOUND * np.maximum(1.0, abs(z))
    free = (z - low > near) & (high - z > near)
    if not free.any() or not np.isfinite(J).all():
        return 0.0 if not free.any() else np.inf
    step = np.linalg.lstsq(J[:, free], -r)[0]
    return 0.5 * float(np.sum((J[:, free] @ step) ** 2))
