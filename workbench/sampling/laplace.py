"""Laplace's approximation as draws: the Gaussian with the cost's curvature at its minimum."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.sampling.conditioning import conditioning
from workbench.sampling.descent import bounds_of, mode_from
from workbench.sampling.feasible import refuse_flat, refuse_undefined
from workbench.sampling.importance import of_laplace
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import modes
from workbench.sampling.posterior import Posterior
from workbench.sampling.subspace import Names, Rest, fixed, subspace_of
from workbench.sampling.truncated_gaussian import draws_from, share_cut_off, truncated_laplace
from workbench.threads import limited_threads

CHAINS = 4  # as many as there are ensembles, so that both are looked at alike


def laplace(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    names: Names = None,
    *,
    rest: Rest = fixed,
    draws: int = 4000,
    seed: int = 0,
) -> Posterior:
    """Draws of N(z*, (J'J)^-1) at the minimum next to `at`, in what is named (all that is free).

    J'J is Gauss and Newton's Hessian, whitened. Bounds and inequality constraints cut the Gaussian
    off (see `cut`), which is exact where residuals and constraints are linear. All else is as in
    `sample`. The verdict compares the Gaussian with the posterior by importance weights, and looks
    for other modes, of which the Gaussian knows nothing. Raises what `sample` raises.
    """
    x, given = problem.split(at)
    if draws < CHAINS:
        raise BadArgument(f"{draws} draws are too few to judge by; ask for {CHAINS} or more")
    with limited_threads():
        subspace = subspace_of(problem, x, given, names, rest)
        refuse_flat(problem, given, subspace)
        target = LogDensity(problem, given, subspace)
        refuse_undefined(problem, given, subspace.points(subspace.centre[None])[0])
        rng = np.random.default_rng(seed)
        mode = mode_from(target, subspace.centre)
        gaussian = truncated_laplace(target, mode)
        z, log_q = draws_from(gaussian, CHAINS * (draws // CHAINS), rng)
        z = np.clip(z, *bounds_of(target))  # a draw on a bound may be beyond it by rounding
        drawn = z.reshape(CHAINS, -1, 1, subspace.size)
        weighed = of_laplace(target, z, log_q, share_cut_off(target, gaussian, rng), rng)
        found = modes(target, mode, np.random.default_rng(np.random.SeedSequence([seed, 1])))
        return Posterior(
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
