"""Pose blend shapes of a trained body once more: each vertex from the joints that it notices.

Training gives every vertex a little of every joint: what poses have in common, and what one
pose's error passes on to another. A body that is shipped needs neither. With all else held, what
skinning gets wrong at rest is regressed on the joints within `REACH` bones of those that carry a
vertex, as if every registration had been seen in a mirror too.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.training.estimate import Estimate
from workbench.training.mirror import Mirror
from workbench.training.noticing import noticed
from workbench.training.objective import Objective, centred
from workbench.training.plan import REACH
from workbench.training.registrations import Picked, batches, kept_and_held_back
from workbench.training.ridge import Pair, Sums, ridge_learned
from workbench.training.skinning_pass import SkinningPass

Array = NDArray[np.float64]
Index = NDArray[np.int64]
RIDGES = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # per pose


def local_posedirs(
    objective: Objective, estimate: Estimate, mirror: Mirror | None
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m, and the ridge, chosen on subjects that are held back meanwhile."""
    learned, held_back = (
        Sums.of(_errors(objective, estimate, rows)).with_reflections(mirror)
        for rows in kept_and_held_back(objective.registrations.subject)
    )
    support = noticed(estimate.weights, estimate.parents, REACH)
    posedirs, ridge = ridge_learned(learned, held_back, support, RIDGES)
    return (posedirs if mirror is None else (posedirs + mirror.posedirs(posedirs)) / 2), ridge


def _errors(objective: Objective, estimate: Estimate, rows: Index) -> Iterator[Pair]:
    """Features, and what must be added at rest for skinning to be right."""
    own = replace(estimate, poses=estimate.poses[rows])
    bare = replace(own, posedirs=np.zeros_like(own.posedirs))
    for batch in batches(Picked(objective.registrations, rows)):
        whole, passed = (SkinningPass(e, batch.some, batch.subject) for e in (own, bare))
        _, trans = centred(batch, batch.vertices - whole.points)
        away = (batch.vertices - trans[:, None] - passed.points) * (batch.seen > 0)[..., None]
        yield passed.features, passed.at_rest(away)
