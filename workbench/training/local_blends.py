"""Pose blend shapes of a trained body once more: each vertex from the joints that it notices.

Training gives every vertex a little of every joint: what poses have in common, and what one
pose's error passes on to another. A body that is shipped needs neither. With all else held, what
skinning gets wrong at rest is regressed on the joints within `REACH` bones of those that carry a
vertex, as if every registration had been seen in a mirror too.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.training.embedded.pose_blends import Lesson, solve_ridge
from workbench.training.estimate import Estimate
from workbench.training.mirror import Mirror
from workbench.training.noticing import noticed
from workbench.training.objective import Objective, centred
from workbench.training.plan import REACH
from workbench.training.registrations import batches
from workbench.training.skinning_pass import SkinningPass

Array = NDArray[np.float64]
RIDGES = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # per pose
APART = 5  # every fifth subject chooses among them


def local_posedirs(
    objective: Objective, estimate: Estimate, mirror: Mirror | None
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m, and the ridge, chosen on subjects that are left out meanwhile."""
    subject = objective.registrations.subject
    test = subject % APART == APART - 1
    lessons = [_lesson(objective, estimate, rows) for rows in (~test, test)]
    if mirror is not None:
        lessons = [lesson.with_reflections(mirror) for lesson in lessons]
    learned, left_out = lessons
    near = noticed(estimate.weights, estimate.parents, REACH)[:, ::9]
    support = np.concatenate([np.zeros((len(near), 1), dtype=bool), near], axis=1)
    ridge = min(RIDGES, key=lambda r: left_out.error(solve_ridge(learned, support, r)))
    both = Lesson(
        learned.features + left_out.features,
        learned.products + left_out.products,
        learned.energy + left_out.energy,
        learned.n_poses + left_out.n_poses,
    )
    posedirs = solve_ridge(both, support, ridge)
    return (posedirs if mirror is None else (posedirs + mirror.posedirs(posedirs)) / 2), ridge


def _lesson(objective: Objective, estimate: Estimate, wanted: NDArray[np.bool_]) -> Lesson:
    """Sums of features and of what must be added at rest for skinning to be right."""
    N, _, F = estimate.posedirs.shape
    bare = replace(estimate, posedirs=np.zeros_like(estimate.posedirs))
    features, products, energy = np.zeros((F, F)), np.zeros((N * 3, F)), 0.0
    for batch in batches(objective.registrations):
        own = wanted[batch.some]
        if not own.any():
            continue
        whole = SkinningPass(estimate, batch.some, batch.subject)
        _, trans = centred(batch, batch.vertices - whole.points)
        passed = SkinningPass(bare, batch.some, batch.subject)
        away = (batch.vertices - trans[:, None] - passed.points) * (batch.seen > 0)[..., None]
        errors = np.linalg.solve(passed.blended[own], away[own][..., None]).reshape(own.sum(), -1)
        f = passed.features[own]
        features += f.T @ f
        products += errors.T @ f
        energy += float(np.vdot(errors, errors))
    return Lesson(features, products.reshape(N, 3, F), energy, int(wanted.sum()))
