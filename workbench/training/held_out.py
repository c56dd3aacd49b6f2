"""How well a body explains people and poses that it was not trained on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.solvers import LevenbergMarquardt
from workbench.training.poses import OnVertices, PoseFit, ShapePrior, segments_turned
from workbench.training.registrations import Registrations, batches

Array = NDArray[np.float64]
STEPS = 60


@dataclass(frozen=True, eq=False)
class Generalization:
    """Distances (m) from held-out registrations to the body fitted to them, vertex by vertex."""

    distances: Array  # (J, N)

    @property
    def mean(self) -> float:
        """m."""
        return float(self.distances.mean())

    @property
    def rms(self) -> float:
        """m."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def largest(self) -> float:
        """m."""
        return float(self.distances.max())


def generalization(
    body: SkinnedBody,
    registrations: Registrations,
    *,
    sigma: float = 0.001,
    betas_sigma: float = 1e3,
) -> Generalization:
    """Pose, betas and trans fitted to every registration; whoever it is, no template is his.

    `betas_sigma` is the prior on betas in standard deviations.
    """
    solver = LevenbergMarquardt(max_iterations=STEPS, gradient_tolerance=1e-13)
    fit = PoseFit(body, body.n_vertices, OnVertices(), sigma, solver, ShapePrior(betas_sigma))
    distances = np.empty((len(registrations.subject), body.n_vertices))
    for batch in batches(registrations):
        for at in range(len(batch.subject)):
            V, seen = batch.vertices[at], batch.seen[at]
            first = segments_turned(body.template, body.weights, body.parents, V, seen)
            found = fit.values(first, V, seen)
            posed = body.vertices(found["pose"], found["betas"], found["trans"])
            distances[batch.some.start + at] = np.linalg.norm(posed - V, axis=1)
    return Generalization(distances)
