"""SMPL, SCAPE and BlendSCAPE learned from the same meshes in known poses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.training.embedded.pose_blends import RIDGES, Lesson, solve_ridge, supports
from workbench.training.embedded.skeleton import binding_motions, blended, pose_features, unskin
from workbench.training.triangles.learning import PosedMeshes, learn
from workbench.training.triangles.people import Registrations
from workbench.training.triangles.stitched_fit import CentredVertices, LeastSquares, Lsqr

Array = NDArray[np.float64]
Report = Callable[[str], None]
# m^2 per squared unit of posedirs. Learned from 100 poses on `small`, held-out rms in mm for 1e-1,
# 1e-3, 1e-4, 1e-5: SCAPE 12.0, 5.2, 4.9, 4.9; BlendSCAPE 14.2, 6.1, 5.5, 5.5
RIDGE = 1e-4
QUICK = Lsqr(1e-3)  # what is left of the meshes no longer changes
SMPL, SCAPE, BLEND_SCAPE = "SMPL", "SCAPE", "BlendSCAPE"
LBS = "linear blend skinning"


def learn_models(
    given: Registrations, n_betas: int, report: Report, by: LeastSquares = QUICK
) -> dict[str, SkinnedBody | TriangleBody]:
    """By name, each also without what it learned of pose; tree, joints and weights are given.

    SCAPE and BlendSCAPE compare vertices, as SMPL does, not edges (see CentredVertices).
    """
    report("learning SMPL")
    body, rest = given.people.body, given.people.learned
    smpl = learn_smpl(body, rest, given.posed, given.trial, n_betas)
    models: dict[str, SkinnedBody | TriangleBody] = {
        LBS: replace(smpl, posedirs=0 * smpl.posedirs),
        SMPL: smpl,
    }
    for name, untrained in ((SCAPE, scape(body)), (BLEND_SCAPE, blend_scape(body))):
        report(f"learning {name}")
        learned = learn(
            untrained, rest, given.posed, n_betas=n_betas, ridge=RIDGE, by=by,
            measure=CentredVertices,
        )  # fmt: skip
        models[f"{name}, Q = I"] = replace(learned, posedirs=0 * learned.posedirs)
        models[name] = learned
    return models


def learn_smpl(
    body: SkinnedBody, people: ArrayLike, posed: PosedMeshes, trial: PosedMeshes, n_betas: int
) -> SkinnedBody:
    """Shape directions are principal components of vertices, posedirs a ridge regression.

    What skinning gets wrong is seen about each person's own rest surface; the ridge is that which
    leaves least on the trial.
    """
    rest = np.asarray(people, dtype=float)
    template = rest.mean(axis=0)
    away = rest - template
    away = (away - away.mean(axis=1, keepdims=True)).reshape(len(rest), -1)
    _, s, Vt = np.linalg.svd(away, full_matrices=False)
    shapedirs = (Vt[:n_betas].T * s[:n_betas] / np.sqrt(len(rest) - 1)).reshape(-1, 3, n_betas)
    lesson, test = (_lesson(body, rest, meshes) for meshes in (posed, trial))
    support = supports(body.weights)
    tried = [solve_ridge(lesson, support, ridge) for ridge in RIDGES]
    posedirs = min(tried, key=test.error)
    return replace(body, template=template, shapedirs=shapedirs, posedirs=posedirs)


def _lesson(body: SkinnedBody, rest: Array, posed: PosedMeshes) -> Lesson:
    features, errors = pose_features(posed.poses), []
    for V, pose, i in zip(posed.vertices, posed.poses, posed.person, strict=True):
        M, m = blended(body.weights, *binding_motions(pose, body.J_regressor @ rest[i]))
        errors.append(unskin(V, M, m) - rest[i])
    e = np.stack(errors)
    products = np.tensordot(e, features, axes=(0, 0))  # (N, 3, F)
    return Lesson(features.T @ features, products, float(np.vdot(e, e)), len(e))
