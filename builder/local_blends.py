"""Pose blend shapes of a trained body, learned again so that they are local.

Training lets every vertex depend a little on every joint: on what the poses have in common, and on
errors that one pose passes on to another. A body that is published needs neither. With everything
else held, the errors of skinning, un-posed, are regressed on the joints within `REACH` bones of
those that move a vertex, as if every registration had a mirror image too.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.geometry.mirror import Mirror
from workbench.training.blend_shapes import Pair, Sums, local_features, ridge_learned
from workbench.training.blocks import REACH
from workbench.training.estimate import Estimate, SkinningPass
from workbench.training.objective import Objective, centred
from workbench.training.registrations import RegistrationSubset, batches, training_and_held_out

RIDGES = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # per pose


def local_posedirs(
    objective: Objective, estimate: Estimate, mirror: Mirror | None
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m, and the ridge, which is chosen on held-out subjects."""
    learned, held_out = (
        Sums.of(errors_at_rest(objective, estimate, rows)).with_reflections(mirror)
        for rows in training_and_held_out(objective.registrations.subject)
    )
    support = local_features(estimate.weights, estimate.parents, REACH)
    posedirs, ridge = ridge_learned(learned, held_out, support, RIDGES)
    return (posedirs if mirror is None else (posedirs + mirror.posedirs(posedirs)) / 2), ridge


def errors_at_rest(objective: Objective, estimate: Estimate, rows: Index) -> Iterator[Pair]:
    """The pose features, and the un-posed errors of skinning."""
    own = replace(estimate, poses=estimate.poses[rows])
    bare = replace(own, posedirs=np.zeros_like(own.posedirs))
    for batch in batches(RegistrationSubset(objective.registrations, rows)):
        whole, passed = (SkinningPass.of(e, batch.some, batch.subject) for e in (own, bare))
        _, trans = centred(batch, batch.vertices - whole.points)
        away = (batch.vertices - trans[:, None] - passed.points) * (batch.confidence > 0)[..., None]
        yield passed.features, passed.at_rest(away)
