"""Posteriors a second, inside of emcee, as shares of emcee's own with nothing to compute."""

import os
import time
from collections.abc import Callable
from typing import Any

import casadi as cs
import emcee
import numpy as np

import workbench as wb
from benchmarks.bodies_made_up import random_body
from workbench.arrays import Array
from workbench.blocks.threaded import TRIED
from workbench.experiments import find
from workbench.problem.batch import Evaluation, compiled, interpreted
from workbench.threads import limited_threads

WALKERS = 192
ALONE = "emcee alone"


def measured(seconds: float = 1.5, rounds: int = 4) -> dict[str, Any]:
    """Of each posterior the best of some rounds, candidates in turn; one core."""
    found: dict[str, Any] = {}
    not_batched = on_cores(rounds)
    print(not_batched, flush=True)
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for name, (problem, start) in posteriors().items():
        x, given = problem.split(start)
        ways: tuple[Evaluation, ...] = (interpreted, compiled)
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
    return {"walkers": WALKERS, "posteriors": found, "not batched": not_batched}


def on_cores(rounds: int = 3, rows: int = 96) -> dict[str, Any]:
    """Costs a second of a problem that cannot be batched, on one core and on all.

    A pendulum's stiffness, damping and start from forty places that it was seen at: an integrator,
    which has no scalar instructions. Rows are shared out to threads where the clock says so.
    """
    problem, start = pendulum()
    x, given = problem.split(start)
    z = x + 1e-3 * np.random.default_rng(0).standard_normal((rows, len(x)))
    every = os.sched_getaffinity(0)
    best: dict[str, float] = {}
    answers = []
    try:
        for use in (1, len(every)):
            os.sched_setaffinity(0, sorted(every)[:use])
            costs = problem.costs(x, given)
            for _ in range(2 * TRIED):  # both ways are tried in these
                answers.append(costs(z))
            best[f"{use} cores" if use > 1 else "1 core"] = max(
                rows / _seconds(costs, z) for _ in range(rounds)
            )
    finally:
        os.sched_setaffinity(0, every)
    same = all(np.array_equal(answers[0], one) for one in answers)
    return {"costs a second": best, "same bits": same}


def _seconds(costs: Callable[[Array], object], z: Array, times: int = 5) -> float:
    began = time.perf_counter()
    for _ in range(times):
        costs(z)
    return (time.perf_counter() - began) / times


def pendulum() -> tuple[wb.Problem, wb.Values]:
    """Made up: four unknowns, forty places."""
    x, p = cs.SX.sym("x", 2), cs.SX.sym("p", 2)
    ode = cs.vertcat(x[1], -p[0] * cs.sin(x[0]) - p[1] * x[1])
    options = {"abstol": 1e-8, "reltol": 1e-8}
    times = np.linspace(0.0, 10.0, 41)
    run = cs.integrator("run", "cvodes", {"x": x, "p": p, "ode": ode}, 0.0, times[1:], options)
    law, begin = wb.Block("law", (2,)), wb.Block("start", (2,))
    truth = {"law": np.array([1.0, 0.1]), "start": np.array([1.0, 0.0])}
    seen = np.asarray(run(x0=truth["start"], p=truth["law"])["xf"])[0]
    angles = run(x0=begin.symbol, p=law.symbol)["xf"][0, :].T
    data = wb.Residual("angles", angles - seen, 0.05, "rad")
    return wb.Problem([data], ("law", "start"), blocks=[law, begin]), truth


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
