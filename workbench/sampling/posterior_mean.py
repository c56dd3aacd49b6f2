"""The mean of a posterior in place of its mode: the answer of least expected error.

    E |a - x|^2 = |a - E x|^2 + E |x - E x|^2

is least for a = E x (Berger, Statistical Decision Theory and Bayesian Analysis, 1985). Where a
posterior of many numbers is not Gaussian, as that of a pose in one image, mode and mean are far
apart. The mean is taken of draws by Hamiltonian Monte Carlo with a few chains side by side, which
begin at the mode: too few for intervals, and enough for a mean.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.sampling.hamiltonian import TRAJECTORY_LENGTH, Chains, adapted
from workbench.sampling.log_density import LogDensity, refuse_undefined
from workbench.sampling.modes import covariance_half
from workbench.sampling.subspace import fixed, movable, subspace_of
from workbench.threads import limited_threads

CHAINS = 16
WARM_UP, KEPT = 15, 30  # trajectories of each chain: of the warm-up, and after it
FIRST_STEP, SPREAD = 0.3, 0.3  # in Laplace's standard deviations; the second of the starts
ACCEPTED_SHARE = 0.8  # of the ends: shorter steps cost more than they bring to a mean


@dataclass(frozen=True, eq=False)
class PosteriorMean:
    """The mean of draws of a posterior.

    Attributes:
        values: all blocks, with the mean of each free number.
        draws: (N, n) all free numbers in each draw, in the order of `problem.free`.
        sd: (n,) the standard deviation of each free number in the draws; they begin at one mode,
            and do not know by how much the model is wrong, so that real errors are larger.
        error: (n,) that of each mean, by how far the means of the chains are apart.
        accepted: the mean chance with which ends of trajectories were accepted.
    """

    values: Values = field(repr=False)
    draws: Array = field(repr=False)
    sd: Array = field(repr=False)
    error: Array = field(repr=False)
    accepted: float


def posterior_mean(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    *,
    chains: int = CHAINS,
    trajectories: int = KEPT,
    seed: int = 0,
) -> PosteriorMean:
    """The mean of all free numbers under exp(-cost), from draws that begin about `at`.

    `at` are values of all blocks at a minimum of the cost. Each of the `chains` takes 15
    trajectories to warm up and then as many as are asked for, whose ends are the draws. Other
    minima, far from `at`, are usually not visited. A rotation vector's mean is that of its numbers.
    All matrices are dense, so that this is for up to about a thousand numbers; for a video there is
    `fitting.video_mean`. With a compiler, costs and gradients are compiled once for each problem,
    which takes seconds. The same seed gives the same draws, but for rounding.

    Raises BadArgument for less than two chains, for no trajectory, where the residual is not finite
    or outside of its domain at `at`, and for a number that cannot move; and Improper for a
    direction that nothing restricts.

    >>> import workbench as wb
    >>> from workbench.residuals import Residual
    >>> from workbench.sampling import posterior_mean
    >>> import casadi as cs
    >>> x = wb.Block("x", (1,))
    >>> skewed = cs.if_else(x.symbol < 0, 4 * x.symbol, x.symbol)  # wider on the right
    >>> result = posterior_mean(wb.Problem([Residual("skewed", skewed, 1.0)], ["x"]), {"x": [0.0]})
    >>> round(float(result.values["x"]), 1)  # sqrt(2 / pi) (1 - 1 / 4)
    0.6
    """
    for name, count, least in (("chains", chains, 2), ("trajectories", trajectories, 1)):
        if count < least:
            raise BadArgument(f"`{name}` must be {least} or more, not {count}")
    x, fixed_values = problem.split(at)
    rng = np.random.default_rng(seed)
    with limited_threads():
        refuse_undefined(problem, fixed_values, x)
        if not (free := movable(problem)).all():
            label = problem.free.label(int(np.argmin(free)))
            raise BadArgument(
                f"{label} has equal bounds or is in an equation among the constraints, so that no "
                "draw moves it; hold it fixed (`problem.freeing` with the other names)"
            )
        space = subspace_of(problem, x, fixed_values, None, fixed)
        target = LogDensity(problem, fixed_values, space)
        half = covariance_half(target, problem.linearize_at(x, fixed_values).dense)
        start = SPREAD * rng.standard_normal((chains, space.size))
        moving = Chains(target, x, half, start)
        if not np.isfinite(moving.log_p).all():
            moving = Chains(target, x, half, np.zeros_like(start))
        step, chances, kept = FIRST_STEP, list[float](), list[Array]()
        for k in range(WARM_UP + trajectories):
            chance, _ = moving.move(step, float(rng.uniform(*TRAJECTORY_LENGTH)), rng)
            if k < WARM_UP:
                step = adapted(step, chance, ACCEPTED_SHARE)
            else:
                chances.append(chance)
                kept.append(moving.z)
    each = np.array(kept)
    draws = each.reshape(-1, space.size)
    error = each.mean(axis=0).std(axis=0, ddof=1) / np.sqrt(chains)
    return PosteriorMean(
        problem.values(draws.mean(axis=0), fixed_values),
        draws,
        draws.std(axis=0),
        error,
        float(np.mean(chances)),
    )
