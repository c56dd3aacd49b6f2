"""Laplace's approximation as draws: the Gaussian with the cost's curvature at its minimum."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.problem.costs import compiled
from workbench.sampling.conditioning import conditioning
from workbench.sampling.descent import bounds_of, mode_from
from workbench.sampling.feasible import refuse_flat, refuse_undefined
from workbench.sampling.hamiltonian import HamiltonianSettings
from workbench.sampling.importance import compared, of_laplace
from workbench.sampling.joint import jointly_with_limits, named
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import modes
from workbench.sampling.posterior import Posterior
from workbench.sampling.subspace import Names, Rest, Subspace, fixed, integrated, subspace_of
from workbench.sampling.truncated_gaussian import draws_in_domain, share_cut_off, truncated_laplace
from workbench.sampling.with_the_rest import drawn_with_the_rest
from workbench.threads import limited_threads

CHAINS = 4  # as many as there are ensembles, so that both are looked at alike
WALKERS, STEPS = 64, 20_000  # of the draws that it is compared with, as `sample` makes them
SHIFTED = 0.3  # of Laplace's standard deviation
WIDER, NARROWER = 1.15, 0.87  # standard deviation over Laplace's
SKEWED = 0.5  # third moment over the cube of the standard deviation
VALLEY = 0.7  # of the lower of two peaks: deeper ones part two modes
SEEN = 0.1  # of the higher peak: lower ones are noise


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

    J'J is Gauss and Newton's Hessian, whitened. What is not named is integrated out, unless `rest`
    says otherwise, as in `sample`. Bounds and inequality constraints cut the Gaussian off (see
    `cut`), which is exact where residuals and constraints are linear, and so do the domains of
    residuals: no draw is behind a camera. The verdict compares the Gaussian with the posterior by
    importance weights, and looks for other modes, of which the Gaussian knows nothing. Where the
    weights say that the Gaussian of all free numbers does not fit, the named entries alone are
    compared with draws: with those of `against`, which `sample` made of the same entries, or with
    some that are made for this. Raises what `sample` raises, and BadArgument if `against` is of
    other entries.
    """
    x, given = problem.split(at)
    if draws < CHAINS:
        raise BadArgument(f"{draws} draws are too few to judge by; ask for {CHAINS} or more")
    wanted = None if callable(names) or rest is not integrated else named(problem, names)
    if wanted is not None and (all_of := jointly_with_limits(problem, at, wanted)):
        found_whole = laplace(problem, at, all_of, rest=fixed, draws=draws, seed=seed)
        space = subspace_of(problem, x, given, wanted, rest)
        return _named_alone(found_whole.marginal(wanted), space, given, against, seed)
    with limited_threads():
        subspace = subspace_of(problem, x, given, wanted or names, rest)
        refuse_flat(problem, given, subspace)
        target = LogDensity(problem, given, subspace)
        refuse_undefined(problem, given, subspace.points(subspace.centre[None])[0])
        rng = np.random.default_rng(seed)
        mode = mode_from(target, subspace.centre)
        gaussian = truncated_laplace(target, mode)
        z, log_q = draws_in_domain(target, gaussian, CHAINS * (draws // CHAINS), rng)
        z = np.clip(z, *bounds_of(target))  # a draw on a bound may be beyond it by rounding
        drawn = z.reshape(CHAINS, -1, 1, subspace.size)
        weighed = of_laplace(target, z, log_q, share_cut_off(target, gaussian, rng), rng)
        found = modes(target, mode, np.random.default_rng(np.random.SeedSequence([seed, 1])))
        posterior = Posterior(
            problem,
            problem.read(at),
            subspace,
            drawn,
            log_q.reshape(drawn.shape[:3]),
            Mixing(subspace.labels, drawn, 1.0, 0, exact=True),
            "laplace",
            found,
            conditioning(problem, given, subspace, mode.z),
            weighed,
        )
        if not subspace.rest.shape[1]:
            return posterior  # the weights are of what is named
        return _named_alone(posterior, subspace, given, against, seed)


def _named_alone(
    posterior: Posterior,
    space: Subspace,
    given: Array,
    against: Posterior | None,
    seed: int,
) -> Posterior:
    """The approximation, judged in what is named alone where all free numbers together fail."""
    told = posterior.importance
    if against is not None and against.labels != posterior.labels:
        raise BadArgument(
            "the draws to compare with are of different entries; give both functions the same names"
        )
    if told is None or told.holds:
        return posterior
    if against is not None:
        if not against.usable:
            return posterior
        beside = f"{against.mixing.effective.min():,.0f} effective draws by `sample`"
        drawn = against.flat
    else:
        target = LogDensity(posterior.problem, given, space, compiled)
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        whole = drawn_with_the_rest(target, HamiltonianSettings(CHAINS, WALKERS, STEPS), rng)
        if whole is None or not whole.run.mixing.usable:
            return posterior
        beside, drawn = whole.in_words, whole.run.mixing.draws.reshape(-1, posterior.size)
    return replace(posterior, importance=compared(told, posterior.flat, drawn, beside))


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
    peaks: int

    @property
    def remark(self) -> str:
        """How the draws differ from Laplace's approximation."""
        if self.peaks > 1:
            return f"{self.peaks} modes"
        found = []
        if abs(self.shift) > SHIFTED:
            found.append("shifted")
        if self.ratio > WIDER:
            found.append("wider")
        if self.ratio < NARROWER:
            found.append("narrower")
        if abs(self.skewness) > SKEWED:
            found.append("curved")
        return ", ".join(found) or "agrees"


def compared_with_laplace(
    posterior: Posterior, approximation: Posterior
) -> tuple[EntryComparison, ...]:
    """How they differ, entry by entry. Raises BadArgument if they are not of the same entries."""
    if posterior.labels != approximation.labels:
        raise BadArgument(
            "the two posteriors are of different entries; give `laplace` the same names and rest"
        )
    shift = (posterior.mean - approximation.mean) / approximation.sd
    ratio = posterior.sd / approximation.sd
    from scipy.stats import skew  # a second to import: not before it is needed

    skewness = np.asarray(skew(posterior.flat, axis=0))
    return tuple(
        EntryComparison(
            posterior.labels[i],
            posterior.units[i],
            float(posterior.mean[i]),
            float(posterior.sd[i]),
            float(shift[i]),
            float(ratio[i]),
            float(skewness[i]),
            peaks(posterior.flat[:, i]),
        )
        for i in range(posterior.size)
    )


def peaks(draws: Array) -> int:
    """How many modes a smoothed density of the draws (N,) has, with deep valleys between them."""
    from scipy.stats import gaussian_kde

    some = draws[:: max(1, len(draws) // 4000)]
    if np.ptp(some) == 0:
        return 1
    low, high = np.quantile(some, [0.001, 0.999])
    grid = np.linspace(low, high, 200)
    density = gaussian_kde(some, bw_method=1.3 * len(some) ** -0.2)(grid)
    tops = [
        i
        for i in range(1, 199)
        if density[i - 1] < density[i] >= density[i + 1] and density[i] > SEEN * density.max()
    ]
    count = min(1, len(tops))
    for i, j in pairwise(tops):
        if density[i:j].min() < VALLEY * min(density[i], density[j]):
            count += 1
    return max(1, count)
