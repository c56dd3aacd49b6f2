"""The posterior of one recorded person, by NUTS, and beside it the intervals of other ways."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.posterior.fitted import Fitted, monocular
from benchmarks.posterior.nuts import NutsSettings, nuts
from benchmarks.posterior.pieces import Pieces
from workbench.arrays import Array
from workbench.blocks.layout import entries
from workbench.sampling import Posterior, fixed, laplace, sample
from workbench.sampling.modes import Mode

NUTS = NutsSettings(draws=3000, warm=1500, accepted=0.95)
PERSON = ("trans", "pose[left_elbow]", "betas")  # of balance-monocular
STEPS = 4000  # of ensembles at most; Hamiltonian Monte Carlo replaces their draws


def of_a_person(seeds: Sequence[int], pieces: Pieces) -> dict[str, Any]:
    """balance-monocular: NUTS on all 85 unknowns, and beside it the intervals of some ways."""
    fitted = monocular()
    told = pieces.once("NUTS", partial(_reference, fitted))
    blocks = {}
    for block in PERSON:
        known = np.array(told["ends"][block]).T
        blocks[block] = _of_block(fitted, block, known, seeds, pieces)
        print(block, blocks[block], flush=True)
    return {"nuts": told["said"], "blocks": blocks}


def _of_block(
    fitted: Fitted, block: str, known: Array, seeds: Sequence[int], pieces: Pieces
) -> dict[str, Any]:
    problem, at = fitted.problem, fitted.values

    def drawn(seed: int) -> Posterior:
        return sample(problem, at, block, seed=seed, steps=STEPS)

    ways = {
        f"sample, seed {seed}": partial(lambda seed: _beside(drawn(seed), known), seed)
        for seed in seeds
    }
    ways["Laplace"] = lambda: _beside(laplace(problem, at, block, against=drawn(seeds[0])), known)
    ways["held fixed"] = lambda: _beside(sample(problem, at, block, rest=fixed), known)
    return {way: pieces.once(f"{block}: {way}", measure) for way, measure in ways.items()}


def _reference(fitted: Fitted) -> dict[str, Any]:
    """What NUTS says of all 85 unknowns, and its 5 % and 95 % quantiles of the named ones."""
    problem, (x, given) = fitted.problem, fitted.problem.split(fitted.values)
    here = problem.linearize_at(x, given)
    mode = Mode(x, here.cost, np.linalg.cholesky(here.covariance), 0.0)
    draws, said = nuts(problem, x, given, np.arange(len(x)), mode, NUTS, seed=1)
    return {"said": said, "ends": ends_of(fitted, draws.reshape(-1, len(x)))}


def ends_of(fitted: Fitted, draws: Array) -> dict[str, Any]:
    """The 5 % and 95 % quantiles of the named entries of draws (N, 85), by block."""
    at = {block: entries(fitted.problem.free, block) for block in PERSON}
    return {b: np.quantile(draws[:, i], [0.05, 0.95], axis=0).T.tolist() for b, i in at.items()}


def _beside(posterior: Posterior, known: Array) -> dict[str, Any]:
    found = np.quantile(posterior.flat, [0.05, 0.95], axis=0)
    return {
        "verdict": posterior.judgement[0].name,
        "usable": posterior.usable,
        "ratio": (np.ptp(found, axis=0) / np.ptp(known, axis=0)).tolist(),
        "end": (abs(found - known).max(axis=0) / np.ptp(known, axis=0)).tolist(),
        "seconds": round(posterior.seconds, 2),
    }
