"""Emcee's ensembles beside NUTS on the same posteriors.

NUTS (Hoffman and Gelman 2014, as in nutpie) shares nothing with the ensembles but the problem: it
takes the cost and gradient of `Problem.cost_gradients`, in coordinates whitened by Laplace's
approximation at the mode. Its own numbers (R-hat, divergences, effective
draws) stand beside the comparison, for it is a reference only as far as they are good.

An arm needs small steps: the ridge on which its joints trade with each other is bent, and narrower
than at the mode by `bent`. With steps as large as nutpie takes by itself (an acceptance of 0.8) it
diverges there.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import workbench as wb
from benchmarks.posterior.fitted import BLOCKS, monocular
from workbench.arrays import Array, Index
from workbench.blocks.layout import entries
from workbench.sampling import Posterior, fixed, sample
from workbench.sampling.modes import Mode
from workbench.threads import limited_threads

ALLOWED_SD, ALLOWED_MEAN, TIMES = 0.05, 0.1, 50.0
ENOUGH = 2000  # effective draws: a standard deviation is then known to 1.6 %
SCALE = 1.01  # of R-hat
SEARCHED = 400  # draws at which the curvature is looked at


@dataclass(frozen=True)
class NutsSettings:
    """Of NUTS' four chains: draws, steps before the first of them, acceptance aimed at."""

    draws: int = 6000
    warm: int = 2000
    accepted: float = 0.97  # small steps


USUAL = NutsSettings(draws=3000, warm=1500, accepted=0.8)  # nutpie's own acceptance


def compared(
    names: Sequence[str], settings: NutsSettings, steps: int, seed: int = 1
) -> dict[str, Any]:
    """Each block by both, and where they differ; the first arm again with NUTS' usual steps."""
    fitted = monocular()

    def one(name: str, settings: NutsSettings) -> dict[str, Any]:
        found = beside(fitted.problem, fitted.values, BLOCKS[name], settings, steps, seed)
        print(f"{name}: agree {found['agree']}, {found['nuts']}", flush=True)
        return found

    arms = [name for name in names if "arm" in name][:1]
    return {
        "blocks": {name: one(name, settings) for name in names},
        "usual steps": {name: one(name, USUAL) for name in arms},
    }


def beside(
    problem: wb.Problem,
    at: wb.Values,
    block: Sequence[str],
    settings: NutsSettings,
    steps: int,
    seed: int,
) -> dict[str, Any]:
    """One block of a posterior by both."""
    ours = sample(problem, at, block, rest=fixed, seed=seed, steps=steps)
    with limited_threads():
        began = time.perf_counter()
        x, given = problem.split(at)
        places = entries(problem.free, block)
        theirs, said = nuts(problem, x, given, places, ours.modes[0], settings, seed)
        seconds = time.perf_counter() - began
    flat = theirs.reshape(-1, ours.size)
    ratio = ours.sd / flat.std(axis=0)
    shift = np.abs(ours.mean - flat.mean(axis=0)) / flat.std(axis=0)
    laplace = np.linalg.norm(ours.modes[0].half, axis=1)
    alike = np.abs(ratio - 1).max() <= ALLOWED_SD and shift.max() <= ALLOWED_MEAN
    return {
        "entries": list(ours.labels),
        "emcee": {
            "sd": ours.sd.tolist(),
            "times": float(ours.mixing.length),
            "seconds": ours.seconds,
            "effective": float(ours.mixing.effective.min()),
            "usable": ours.mixing.usable,
            "modes": [mode.share for mode in ours.modes],
        },
        "nuts": said | {"sd": flat.std(axis=0).tolist(), "seconds": seconds},
        "sd ratio": ratio.tolist(),
        "mean apart": shift.tolist(),
        "sd over Laplace's": (ours.sd / laplace).tolist(),
        "bent": bent(ours, seed),
        "agree": bool(alike and ours.mixing.length >= TIMES),
        "reference": bool(said["R-hat"] <= SCALE and said["effective"] >= ENOUGH),
    }


def nuts(
    problem: wb.Problem,
    x: Array,
    given: Array,
    places: Index,
    mode: Mode,
    settings: NutsSettings,
    seed: int,
) -> tuple[Array, dict[str, Any]]:
    """Draws (4, N, k) of x's entries in these places, and what is known of them.

    Chains begin at draws of Laplace's approximation at the mode.
    """
    import nutpie
    from nutpie.compiled_pyfunc import from_pyfunc

    k, slope = len(places), problem.cost_gradients(x, given, places)

    def make_log_density() -> Callable[[Array], tuple[float, Array]]:
        def log_density(u: Array) -> tuple[float, Array]:
            cost, gradient = slope((mode.z + mode.half @ u)[None])
            return -float(cost[0]), -(mode.half.T @ gradient[0])

        return log_density

    model = from_pyfunc(
        ndim=k,
        make_logp_fn=make_log_density,
        make_expand_fn=lambda *_: lambda u: {"z": mode.z + mode.half @ u},
        expanded_dtypes=[np.dtype(np.float64)],
        expanded_shapes=[(k,)],
        expanded_names=["z"],
        make_initial_point_fn=lambda s: np.random.default_rng(s).standard_normal(k),
    )
    trace = nutpie.sample(
        model,
        draws=settings.draws,
        tune=settings.warm,
        chains=4,
        cores=1,
        seed=seed,
        progress_bar=False,
        target_accept=settings.accepted,
    )
    import arviz as az  # beside nutpie, which needs it

    return np.asarray(trace.posterior["z"]), {
        "R-hat": float(az.rhat(trace)["z"].max()),
        "divergences": int(np.asarray(trace.sample_stats["diverging"]).sum()),
        "effective": float(az.ess(trace)["z"].min()),
        "draws": 4 * settings.draws,
    }


def bent(ours: Posterior, seed: int) -> float:
    """How many times narrower than at the mode the posterior is, in its narrowest hundredth.

    By the largest singular value of J half at some of the draws: 1 for a Gaussian.
    """
    rng = np.random.default_rng(seed)
    z = ours.flat[rng.integers(len(ours.flat), size=SEARCHED)]
    given = ours.problem.split(ours.given)[1]
    scale = ours.subspace.along @ ours.modes[0].half
    largest = [
        np.linalg.norm(ours.problem.linearize_at(x, given).jacobian @ scale, 2)
        for x in ours.subspace.points(z)
    ]
    return float(np.quantile(largest, 0.99))
