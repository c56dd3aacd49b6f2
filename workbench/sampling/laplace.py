"""Laplace's approximation as draws: the Gaussian with the cost's curvature at its minimum."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.problem import Problem
from workbench.sampling.choice import Names, chosen
from workbench.sampling.importance import importance
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import modes
from workbench.sampling.posterior import Posterior, as_values
from workbench.sampling.subspace import Rest, fixed
from workbench.sampling.target import Target
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

    J'J is Gauss and Newton's Hessian, whitened. Bounds are not asked: what is drawn beyond them
    shows where the approximation ends. Raises what `sample` raises.
    """
    x, given = problem.split(at)
    with limited_threads():
        subspace = chosen(problem, x, given, names, rest)
        target = Target(problem, given, subspace)
        rng = np.random.default_rng(seed)
        mode = modes(target, rng, searches=0)[0]
        noise = rng.standard_normal((CHAINS * (draws // CHAINS), subspace.size))
        z = mode.z + noise @ mode.half.T
        drawn = z.reshape(CHAINS, -1, 1, subspace.size)
        log_prob = -mode.cost - 0.5 * np.sum(noise**2, axis=1)
        return Posterior(
            problem, as_values(problem, at), subspace, drawn, log_prob.reshape(drawn.shape[:3]),
            Mixing(subspace.labels, drawn, 1.0, 0, exact=True), "laplace", (mode,),
            importance(target, z, rng),
        )  # fmt: skip
