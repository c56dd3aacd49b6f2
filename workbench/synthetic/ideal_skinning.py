"""Linear blend skinning that is given the ground truth: the least error that it can have.

It is given rest shapes, joints, poses and the rig's weights of synthetic registrations, alone and
with the best linear predictor of blend shapes, which is learned from the true un-posed errors.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.synthetic.ground_truth import GroundTruth
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.evaluation import VertexErrors, errors_of, millimetres
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.registrations import (
    Registrations,
    RegistrationSubset,
    batches,
    training_and_held_out,
)
from workbench.training.ridge import Pair, Sums, ridge_learned
from workbench.training.skinning_pass import SkinningPass

RIDGES = (1e-3, 3e-3, 1e-2, 3e-2)  # per pose


def ideal_skinning_errors(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None
) -> dict[str, float]:
    """The errors of ideal skinning in mm, as a model card lists them.

    They are those of linear blend skinning alone and, given `posedirs`, with these blend shapes.
    """
    alone = errors_of_ideal_skinning(truth, registrations, start)
    found = {
        "ideal_skinning_mean_mm": millimetres(alone.mean),
        "ideal_skinning_rms_mm": millimetres(alone.rms),
    }
    if posedirs is not None:
        best = errors_of_ideal_skinning(truth, registrations, start, posedirs)
        found |= {
            "ideal_linear_mean_mm": millimetres(best.mean),
            "ideal_linear_rms_mm": millimetres(best.rms),
        }
    return found


def ideal_skinning(
    truth: GroundTruth, parents: tuple[int, ...], posedirs: Array | None = None
) -> Estimate:
    """The estimate that training would have to find: the ground truth itself."""
    K, N = len(parents), truth.rest.shape[1]
    P = np.zeros((N, 3, 9 * (K - 1))) if posedirs is None else posedirs
    return Estimate(truth.rest, truth.joints, P, truth.weights, truth.poses, parents)


def errors_of_ideal_skinning(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None = None
) -> VertexErrors:
    """The errors of linear blend skinning that is given the ground truth."""
    estimate = ideal_skinning(truth, start.parents, posedirs)
    held = Objective(registrations, start.rings(), truth.weights, None, Sigmas())
    return errors_of(held, estimate)


def best_linear(truth: GroundTruth, registrations: Registrations, start: Start) -> Array:
    """Posedirs (N, 3, F) by ridge regression of the true un-posed errors.

    The ridge is chosen by the errors on a fifth of the subjects, which is held out until then.
    """
    learned, held_out = (
        Sums.of(_errors(truth, registrations, start, rows)).with_reflections(start.mirror())
        for rows in training_and_held_out(truth.subject)
    )
    whole = np.ones_like(learned.products[:, 0], dtype=bool)
    return ridge_learned(learned, held_out, whole, RIDGES)[0]


def _errors(
    truth: GroundTruth, registrations: Registrations, start: Start, rows: Index
) -> Iterator[Pair]:
    """Features, and what must be added at rest for skinning to be right."""
    estimate = replace(ideal_skinning(truth, start.parents), poses=truth.poses[rows])
    for batch in batches(RegistrationSubset(registrations, rows)):
        passed = SkinningPass.of(estimate, batch.some, batch.subject)
        away = batch.vertices - truth.trans[rows[batch.some], None] - passed.points
        yield passed.features, passed.at_rest(away)
