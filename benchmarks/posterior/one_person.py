"""What forty frames of one person say about coverage: less than forty frames of forty people.

Made-up people go through the poses of the recording, each with betas of its own, drawn once from
the prior, and are photographed by the one camera with the very sigma. The model is right, and yet
the rate at which forty intervals of one entry cover is near 100 % or far below 90 %: the error of
a shape is mostly that person's distance from the prior's mean, which is the same in every frame.
"""

from typing import Any

import numpy as np

import workbench as wb
from benchmarks.posterior.held_out import (
    SIGMA,
    Case,
    by_laplace,
    frames,
    labels,
    photographed,
    recorded,
)
from workbench.experiments.balance import balance_monocular


def of_people(people: int, count: int, seed: int = 0) -> dict[str, Any]:
    """For each of them, how often Laplace's intervals cover each of the 16 entries."""
    setup = balance_monocular()
    body = setup.body
    assert body is not None
    view = next(view for view in setup.views if not view.held_out)
    cases = [case for case, _ in recorded(frames(count), SIGMA)]
    rates, means, spreads = [], [], []
    for person in range(people):
        rng = np.random.default_rng([seed, person])
        betas = rng.standard_normal(body.n_betas)
        z = np.array([_off(setup.problem, case, betas, rng, body, view) for case in cases])
        rates.append(np.mean(abs(z) < 1.6449, axis=0).tolist())
        means.append(z.mean(axis=0).tolist())
        spreads.append(z.std(axis=0).tolist())
        print(f"person {person}: least {min(rates[-1]):.0%}", flush=True)
    return {
        "labels": labels(setup.problem),
        "frames": count,
        "rates": rates,
        "mean": means,
        "sd": spreads,
    }


def _off(problem: wb.Problem, case: Case, betas: Any, rng: Any, body: Any, view: Any) -> Any:
    """How far the truth is from the answer, in Laplace's standard deviations (16,)."""
    truth = case.truth | {"betas": betas}
    points = body.landmark(view.landmarks, *(truth[b.name] for b in body.blocks()))
    made_up = Case("", problem, photographed(view, points, truth, rng))
    found = by_laplace(made_up)
    right = problem.free.pack(truth)[case.places]
    return (right - np.array(found["mean"])) / np.array(found["sd"])
