"""Posteriors a second, inside of emcee, as shares of emcee's own with nothing to compute."""

import os
import time
from collections.abc import Callable
from typing import Any

import emcee
import numpy as np

import workbench as wb
from benchmarks.bodies_made_up import random_body
from workbench.arrays import Array
from workbench.experiments import find
from workbench.problem.costs import CostMethod, compiled, interpreted
from workbench.threads import limited_threads

WALKERS = 192
ALONE = "emcee alone"


def measured(seconds: float = 1.5, rounds: int = 4) -> dict[str, Any]:
    """Of each posterior the best of some rounds, candidates in turn; one core."""
    found: dict[str, Any] = {}
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for name, (problem, start) in posteriors().items():
        x, given = problem.split(start)
        ways: tuple[CostMethod, ...] = (interpreted, compiled)
        densities = {ALONE: lambda z: np.zeros(len(z))} | {
            way.__name__: _density(problem.costs(x, given, None, way)) for way in ways
        }
        noise = np.random.default_rng(0).standard_normal((WALKERS, problem.free.size))
        best = dict.fromkeys(densities, 0.0)
        for _ in range(rounds):  # taking turns, so that a disturbance meets all of them
            for way, density in densities.items():
                best[way] = max(best[way], rate(density, x, noise, seconds))
        found[name] = {"free": problem.free.size, "a second": best}
        print(name, best, flush=True)
    return {"walkers": WALKERS, "posteriors": found}


def _density(costs: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda z: -costs(z)


def rate(density: Callable[[Array], Array], x: Array, noise: Array, seconds: float) -> float:
    """Densities in a second of the processor's, with emcee's own moves and loops."""
    walkers, k = noise.shape
    sampler = emcee.EnsembleSampler(walkers, k, density, moves=emcee.moves.DEMove(), vectorize=True)
    state = emcee.State(x + 1e-3 * noise, random_state=np.random.RandomState(0).get_state())
    with limited_threads():
        state = sampler.run_mcmc(state, 10, store=False)
        steps, began = 0, time.process_time()
        while time.process_time() - began < seconds:
            state = sampler.run_mcmc(state, 20, store=False, skip_initial_state_check=True)
            steps += 20
    return steps * walkers / (time.process_time() - began)


def posteriors() -> dict[str, tuple[wb.Problem, wb.Values]]:
    """All 85 entries of a body free, seen in three ways."""
    body = wb.load_body()
    pose, betas, trans = (block.symbol for block in body.blocks())
    priors = [
        wb.residuals.gaussian(betas, name="shape prior"),
        wb.residuals.gaussian(pose, covariance=0.25, unit="rad", name="pose prior"),
    ]
    joints = body.joint_points(pose, betas, trans)
    landmarks = wb.residuals.landmarks(joints, body.joints(), sigma=0.01)
    coco = find("balance-monocular").setup()
    large = random_body(6890)
    symbols = [block.symbol for block in large.blocks()]
    vertices = wb.residuals.vertices(large.points(*symbols), large.vertices(), sigma=0.01)
    free = ("pose", "betas", "trans")
    return {
        "24 joints in space": (wb.Problem([landmarks, *priors], free), body.start()),
        "COCO keypoints, one camera": (coco.problem, coco.start),
        "6,890 vertices (made up)": (wb.Problem([vertices], free), large.start()),
    }
