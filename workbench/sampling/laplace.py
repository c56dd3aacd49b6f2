"""Laplace's approximation as draws: the Gaussian with the cost's curvature at its minimum.

Bounds and inequality constraints cut it off (`TruncatedGaussian`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.errors import BadArgument, NotSupported
from workbench.problem import Problem
from workbench.problem.costs import compiled
from workbench.sampling.conditioning import conditioning
from workbench.sampling.ensembles import SamplerSettings
from workbench.sampling.importance import compared, of_laplace
from workbench.sampling.log_density import LogDensity, refuse_flat, refuse_undefined
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import (
    Mode,
    bounds_of,
    dependent_bounds,
    inverse_half,
    mode_from,
    modes,
    rows_between,
)
from workbench.sampling.posterior import Posterior
from workbench.sampling.sample import drawn_with_the_rest, jointly, named
from workbench.sampling.subspace import MOST, Names, Rest, Subspace, fixed, integrated, subspace_of
from workbench.threads import limited_threads

LOOKED_AT = 2000  # draws, for what linear constraints cut away
ENOUGH = 100  # of them that must be allowed, so that a share of 0.05 is seen
ON_LIMIT = 1e-6  # of the largest value of a linear limit
WIDE = 1 / 30  # over the distance of two bounds: a Gaussian that is flat between them to 0.06 %
PARTICLES = 1000  # side by side
WARM_UP = 40  # flights before the first that counts
FLIGHTS_APART = 10  # from one that counts to the next: in a tail, one alone does not forget
MOST_ROUNDS = 30  # of draws that replace those outside of the domains of residuals
MOST_REFLECTIONS = 2000  # of a flight; one with more is undone, which is as likely both ways
MOST_UNDONE = 0.01  # of all flights
TOUCHING = 1e-12  # of the size of the terms: on the limit, but for rounding
MOST_LIMITED = 200  # numbers that limits cut the Gaussian off in
CHAINS = 4  # as many as there are ensembles, so that both are looked at alike
WALKERS, STEPS = 64, 20_000  # of the draws that it is compared with, as `sample` makes them
SHIFTED = 0.3  # of Laplace's standard deviation
WIDER, NARROWER = 1.15, 0.87  # standard deviation over Laplace's
SKEWED = 0.5  # third moment over the cube of the standard deviation


@dataclass(frozen=True, eq=False)
class TruncatedGaussian:
    """z = mean + half w, w standard normal where F w + g >= 0; `start` is a w that meets it."""

    mean: Array  # (k,)
    half: Array  # (k, k) a square root of the covariance
    F: Array  # (c, k) the gradients of the limits
    g: Array  # (c,) their offsets
    start: Array  # (k,) a w that meets all limits
    cost: float  # the cost at the start
    boxed: int = 0  # how many rows of F are bounds; the others are linearized constraints


def truncated_laplace(target: LogDensity, mode: Mode) -> TruncatedGaussian:
    """The linear model at a mode, r + J (z - z*), restricted to bounds and linearized constraints.

    Its mean is the point where the model is least, z* - (J'J)^-1 J'r, wherever that lies: at a
    minimum on a bound it is beyond the bound. An entry that bounds alone hold is uniform there.
    """
    k, constraints = len(mode.z), target.problem.stacked_constraints
    own_low, own_high = bounds_of(target)
    A, other_low, other_high = dependent_bounds(target)
    B = np.vstack([np.eye(k), A])
    low, high = np.concatenate([own_low, other_low]), np.concatenate([own_high, other_high])
    below, above = np.isfinite(low), np.isfinite(high)
    if constraints is None and not (below.any() or above.any()):
        return TruncatedGaussian(
            mode.z, mode.half, np.empty((0, k)), np.empty(0), np.zeros(k), mode.cost
        )
    space = target.subspace
    x = space.points(mode.z[None])[0]
    here = target.problem.linearize_at(x, target.fixed)
    J = here.jacobian @ space.along
    half = inverse_half(target, np.vstack([J, rows_between(own_low, own_high, WIDE)]))
    mean = mode.z - half @ (half.T @ (J.T @ here.residual))
    rows = [(B @ half)[below], -(B @ half)[above]]
    margins = [(B @ mean - low)[below], (high - B @ mean)[above]]
    if constraints is not None:
        linear = constraints.linearize(x, target.fixed)
        A = linear.along(space.along)
        c = linear.values + A @ (mean - mode.z)
        for side, limit in ((1.0, linear.lower), (-1.0, linear.upper)):
            limited = np.isfinite(limit) & ~constraints.equal
            rows.append(side * (A @ half)[limited])
            margins.append(side * (c - limit)[limited])
    start = np.asarray(np.linalg.solve(half, mode.z - mean), dtype=float)
    return TruncatedGaussian(
        mean,
        half,
        np.vstack(rows),
        np.concatenate(margins),
        start,
        mode.cost,
        int(below.sum() + above.sum()),
    )


def share_cut_off(
    target: LogDensity, gaussian: TruncatedGaussian, rng: np.random.Generator
) -> float:
    """The share of the Gaussian that constraints allow and their linearization does not.

    0 where constraints are linear. Importance weights cannot see it: no draw is there to weigh.
    1 where bounds alone leave too few allowed draws to tell.
    """
    F, g, boxed = gaussian.F, gaussian.g, gaussian.boxed
    if target.problem.stacked_constraints is None or boxed == len(F):
        return 0.0
    z = draws_from(replace(gaussian, F=F[:boxed], g=g[:boxed]), LOOKED_AT, rng)[0]
    w = (z - gaussian.mean) @ np.linalg.inv(gaussian.half).T
    margins = w @ F[boxed:].T + g[boxed:]
    allowed = target.allows(target.subspace.points(z))
    kept = (margins >= -ON_LIMIT * abs(margins).max()).all(axis=1)
    if (allowed == kept).all():
        return 0.0
    return float(np.mean(~kept[allowed])) if allowed.sum() >= ENOUGH else 1.0


def draws_in_domain(
    target: LogDensity, gaussian: TruncatedGaussian, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draws z (count, k) of the Gaussian, cut off where a residual means nothing; see `draws_from`.

    Draws outside of the domains of residuals are replaced by others. Raises NotSupported if nearly
    all are outside.
    """
    z, log_q = np.empty((0, len(gaussian.mean))), np.empty(0)
    for _ in range(MOST_ROUNDS):
        more, log_more = draws_from(gaussian, count, rng)
        inside = target.in_domain(more)
        z, log_q = np.concatenate([z, more[inside]]), np.concatenate([log_q, log_more[inside]])
        if len(z) >= count:
            return z[:count], log_q[:count]
    raise NotSupported(
        "nearly all of Laplace's Gaussian is where a residual means nothing, as behind a camera; "
        "draw with `sample`"
    )


def draws_from(
    gaussian: TruncatedGaussian, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draws z (count, k), and their log density up to a constant, (count,)."""
    w = rng.standard_normal((count, len(gaussian.mean)))
    if not (w @ gaussian.F.T + gaussian.g >= 0).all():
        w = truncated_normal(gaussian.F, gaussian.g, gaussian.start, count, rng)
    log_q = -gaussian.cost - 0.5 * (np.sum(w**2, axis=1) - np.sum(gaussian.start**2))
    return gaussian.mean + w @ gaussian.half.T, log_q


def truncated_normal(
    F: Array, g: Array, start: Array, count: int, rng: np.random.Generator
) -> Array:
    """`count` draws (count, k) of w ~ N(0, 1) under F w + g >= 0, from a start that satisfies it.

    F is (c, k), g (c,). A limit that the start violates is moved to the start. Raises NotSupported
    if the limits leave so little room that the particles do not get through it.
    """
    g = np.maximum(g, -(F @ start))
    w = np.repeat(start[None], PARTICLES, axis=0)
    kept, undone, flights = [], 0, WARM_UP + FLIGHTS_APART * -(-count // PARTICLES)
    for flight in range(flights):
        before = w
        w = _flown(F, g, w, rng.standard_normal(w.shape))
        undone += int(np.sum((w == before).all(axis=1)))
        if flight >= WARM_UP and flight % FLIGHTS_APART == FLIGHTS_APART - 1:
            kept.append(w)
        if undone > MOST_UNDONE * flights * PARTICLES:
            raise NotSupported(
                "bounds and constraints leave the Gaussian too little room to draw from, so that "
                "Laplace's approximation says nothing here. If they limit numbers that are "
                "integrated out, name these numbers too; else draw with `sample`, or widen them"
            )
    return np.concatenate(kept)[:count]


def _flown(F: Array, g: Array, w: Array, v: Array) -> Array:
    """The particles w (N, k) with velocities v after a quarter of a turn."""
    before, w = w, w.copy()
    time_left = np.full(len(w), np.pi / 2)
    squares = np.sum(F**2, axis=1)
    going = np.arange(len(w))
    for _ in range(MOST_REFLECTIONS):
        t, limit = _next_limit(F, g, w[going], v[going])
        t = np.minimum(t, time_left[going])
        c, s = np.cos(t)[:, None], np.sin(t)[:, None]
        w[going], v[going] = w[going] * c + v[going] * s, v[going] * c - w[going] * s
        time_left[going] -= t
        on = time_left[going] > 0
        going, limit = going[on], limit[on]
        if not going.size:
            break
        f = F[limit]
        speed = np.sum(f * v[going], axis=1) / squares[limit]
        v[going] -= 2 * speed[:, None] * f
    w[going] = before[going]
    return w


def _next_limit(F: Array, g: Array, w: Array, v: Array) -> tuple[Array, Index]:
    """When each particle next meets a limit from inside, and which; infinity if none is met."""
    a, b = v @ F.T, w @ F.T  # the limit's value is b cos t + a sin t + g
    size = np.hypot(a, b)
    phase = np.arctan2(-a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.arccos(np.clip(-g / size, -1, 1)) - phase
    t = np.where(size > abs(g), np.mod(crossing, 2 * np.pi), np.inf)
    touching = b + g <= TOUCHING * (abs(b) + abs(g))
    t = np.where(touching & (a < 0), 0.0, t)
    limit = np.argmin(t, axis=1)
    return t[np.arange(len(w)), limit], limit


def laplace(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    names: Names = None,
    *,
    rest: Rest = integrated,
    draws: int = 4000,
    seed: int = 0,
    against: Posterior | None = None,
) -> Posterior:
    """Draws of N(z*, (J'J)^-1) at the minimum next to `at`, in what is named (all that is free).

    J'J is the whitened Gauss-Newton Hessian. What is not named is integrated out, unless `rest`
    says otherwise, as in `sample`. Bounds, inequality constraints and domains of residuals cut the
    Gaussian off, which is exact where all is linear. The verdict compares the Gaussian with the
    posterior by importance weights, and looks for other modes. Where the weights say that the
    Gaussian of all free numbers does not fit, the named entries alone are compared with draws: with
    those of `against`, which `sample` made of the same entries, or with some that are made for
    this. Raises what `sample` raises, and BadArgument if `against` is of other entries.
    """
    x, fixed_values = problem.split(at)
    if draws < CHAINS:
        raise BadArgument(f"{draws} draws are too few to judge by; ask for {CHAINS} or more")
    names = named(problem, names)
    # limits on any number cut off the Gaussian of all numbers
    limited = problem.bounded or problem.stacked_constraints is not None
    most = MOST_LIMITED if limited else MOST
    if rest is integrated and (all_names := jointly(problem, at, names, most)):
        whole = laplace(problem, at, all_names, rest=fixed, draws=draws, seed=seed)
        space = subspace_of(problem, x, fixed_values, names, rest)
        return _judged_by_draws(whole.marginal(names), space, fixed_values, against, seed)
    with limited_threads():
        subspace = subspace_of(problem, x, fixed_values, names, rest)
        refuse_flat(problem, fixed_values, subspace)
        target = LogDensity(problem, fixed_values, subspace)
        refuse_undefined(problem, fixed_values, subspace.points(subspace.centre[None])[0])
        rng = np.random.default_rng(seed)
        mode = mode_from(target, subspace.centre)
        gaussian = truncated_laplace(target, mode)
        z, log_q = draws_in_domain(target, gaussian, CHAINS * (draws // CHAINS), rng)
        z = np.clip(z, *bounds_of(target))  # a draw on a bound may be beyond it by rounding
        chains = z.reshape(CHAINS, -1, 1, subspace.size)
        importance = of_laplace(target, z, log_q, share_cut_off(target, gaussian, rng), rng)
        mode_search = modes(target, mode, np.random.default_rng(np.random.SeedSequence([seed, 1])))
        posterior = Posterior(
            problem,
            problem.read(at),
            subspace,
            chains,
            log_q.reshape(chains.shape[:3]),
            Mixing(subspace.labels, chains, 1.0, 0, exact=True),
            "laplace",
            mode_search,
            conditioning(problem, fixed_values, subspace, mode.z),
            importance,
        )
        if not subspace.rest.shape[1]:
            return posterior  # the weights are of what is named
        return _judged_by_draws(posterior, subspace, fixed_values, against, seed)


def _judged_by_draws(
    posterior: Posterior,
    space: Subspace,
    fixed_values: Array,
    against: Posterior | None,
    seed: int,
) -> Posterior:
    """The approximation, judged in what is named alone where all free numbers together fail."""
    importance = posterior.importance
    if against is not None and against.labels != posterior.labels:
        raise BadArgument(
            "the draws to compare with are of different entries; give both functions the same names"
        )
    if importance is None or importance.holds:
        return posterior
    if against is not None:
        if not against.usable:
            return posterior
        beside = f"{against.mixing.effective.min():,.0f} effective draws by `sample`"
        draws = against.flat
    else:
        target = LogDensity(posterior.problem, fixed_values, space, compiled)
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        whole = drawn_with_the_rest(target, SamplerSettings(WALKERS, CHAINS, STEPS), rng)
        if whole is None or not whole[0].mixing.usable:
            return posterior
        mixing, n = whole[0].mixing, whole[0].points.shape[1]
        beside = f"{mixing.effective.min():,.0f} effective draws of all {n} free numbers"
        draws = mixing.draws.reshape(-1, posterior.size)
    return replace(posterior, importance=compared(importance, posterior.flat, draws, beside))


@dataclass(frozen=True)
class EntryComparison:
    """One entry of draws beside Laplace's Gaussian.

    `shift` is the distance of the means in Laplace's standard deviations, `ratio` the standard
    deviation of the draws over Laplace's.
    """

    label: str
    unit: str
    mean: float
    sd: float
    shift: float
    ratio: float
    skewness: float

    @property
    def remark(self) -> str:
        """How the draws differ from Laplace's approximation."""
        remarks = {
            "shifted": abs(self.shift) > SHIFTED,
            "wider": self.ratio > WIDER,
            "narrower": self.ratio < NARROWER,
            "curved": abs(self.skewness) > SKEWED,
        }
        return ", ".join(remark for remark, holds in remarks.items() if holds) or "agrees"


def compared_with_laplace(
    posterior: Posterior, approximation: Posterior
) -> tuple[EntryComparison, ...]:
    """How they differ, entry by entry. Raises BadArgument if they are not of the same entries."""
    if posterior.labels != approximation.labels:
        raise BadArgument(
            "the two posteriors are of different entries; give `laplace` the same names and rest"
        )
    from scipy.stats import skew  # a second to import: not before it is needed

    shift = (posterior.mean - approximation.mean) / approximation.sd
    ratio, skewness = posterior.sd / approximation.sd, skew(posterior.flat, axis=0)
    columns = posterior.mean, posterior.sd, shift, ratio, skewness
    numbers = np.column_stack(columns).tolist()
    labels = zip(posterior.labels, posterior.units, strict=True)
    return tuple(EntryComparison(*label, *row) for label, row in zip(labels, numbers, strict=True))
