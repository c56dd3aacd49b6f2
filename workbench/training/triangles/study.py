"""SMPL, SCAPE and BlendSCAPE on the same synthetic people and poses."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.training.embedded.pose_blends import learn_pose_blends
from workbench.training.embedded.teacher import Teacher
from workbench.training.mirror import Mirror
from workbench.training.triangles.comparison import n_parameters
from workbench.training.triangles.learning import PosedMeshes, learn_bends
from workbench.training.triangles.stitched_fit import CentredVertices, Lsqr

Array = NDArray[np.float64]
Report = Callable[[str], None]
# m^2 per squared unit of posedirs. Learned from 100 poses on `small`, held-out rms in mm for 1e-1,
# 1e-3, 1e-4, 1e-5: SCAPE 12.0, 5.2, 4.9, 4.9; BlendSCAPE 14.2, 6.1, 5.5, 5.5
RIDGE = 1e-4
LSQR = Lsqr(1e-3)


@dataclass(frozen=True)
class Outcome:
    """Distances in mm from the teacher's posed surface, centroids laid together."""

    model: str
    parameters: int
    rms_learned: float  # on the poses that it was learned from
    rms: float  # on others
    mean: float
    largest: float


def compare_on_poses(
    body: SkinnedBody, teacher: Teacher, poses: tuple[Array, Array], mirror: Mirror, report: Report
) -> tuple[Outcome, ...]:
    """One person's pose-dependent part, learned from the first poses, measured on the second.

    The teacher is the synthetic one of the embedded bodies: a finer rig under dual quaternions.
    SMPL's blend shapes also see every pose in a mirror; all models have the same joints and
    skinning weights. Q is fitted to vertices, as the blend shapes are.
    """
    seen, others = (np.stack([teacher.vertices(pose) for pose in some]) for some in poses)
    posedirs, _ = learn_pose_blends(teacher, body.weights, mirror, poses, report)
    models: dict[str, SkinnedBody | TriangleBody] = {
        "linear blend skinning": replace(body, posedirs=0 * body.posedirs),
        "SMPL": replace(body, posedirs=posedirs),
    }
    one = PosedMeshes(seen, poses[0], np.zeros(len(seen), dtype=np.int64))
    for name, untrained in (("SCAPE", scape(body)), ("BlendSCAPE", blend_scape(body))):
        report(f"  {name}")
        models[f"{name}, Q = I"] = untrained
        models[name] = learn_bends(
            untrained, one, np.zeros((1, body.n_betas)), ridge=RIDGE, by=LSQR,
            measure=CentredVertices,
        )  # fmt: skip
    return tuple(
        Outcome(name, n_parameters(model), distances(model, poses[0], seen)[0],
                *distances(model, poses[1], others))
        for name, model in models.items()
    )  # fmt: skip


def distances(model: Body, poses: Array, surfaces: Array) -> tuple[float, float, float]:
    """Root mean square, mean and largest distance in mm, centroids laid together."""
    apart = model.vertices(poses) - surfaces
    away = 1e3 * np.linalg.norm(apart - apart.mean(axis=1, keepdims=True), axis=-1)
    return float(np.sqrt((away**2).mean())), float(away.mean()), float(away.max())
