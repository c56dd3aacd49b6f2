"""How far a predictor is from the teacher in test poses, and how long it takes.

A body is posed in three steps, so that predictors of every size are timed alike: features and
skinning are CasADi functions; the product of blend shapes and features between them, which is most
of the work, is NumPy's, or SciPy's where most numbers are zero.
"""

import time
from dataclasses import dataclass

import casadi as cs
import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import surface
from workbench.studies.blend_shapes.posed_surfaces import PosedSurfaces
from workbench.studies.blend_shapes.sparsity import nonzero_share

SPARSE_BELOW = 0.2  # of all numbers: there a sparse product is the faster one


@dataclass(frozen=True)
class Accuracy:
    """Distances to the teacher's vertices over all test poses.

    Attributes:
        mean: in mm.
        rms: in mm.
        largest: in mm.
        milliseconds: the least time that one pose took.
    """

    mean: float
    rms: float
    largest: float
    milliseconds: float


class Evaluation:
    """A function from pose (K, 3) rad to surface (N, 3) m, of the mean person at the origin."""

    def __init__(self, body: SkinnedBody) -> None:
        pose, rest = cs.MX.sym("pose", 3, body.n_joints), cs.MX.sym("rest", 3, body.n_vertices)
        at = surface.posture(body, pose, cs.MX.zeros(body.n_betas))
        G, _ = surface.motions(body, at)
        self._features = cs.Function("features", [pose], [cs.densify(body.features(at))])
        skinned = body.skinning(rest, G, surface.weights(body))
        self._skinned = cs.Function("skinned", [pose, rest], [skinned])
        flat, self._moved = body.posedirs.reshape(3 * body.n_vertices, -1), body.posedirs.any()
        sparse = self._moved and nonzero_share(flat) < SPARSE_BELOW
        self._posedirs = csr_array(flat) if sparse else flat
        self._template = body.template.ravel()

    def __call__(self, pose: Array) -> Array:
        """The surface (N, 3) m."""
        rest = self._template
        if self._moved:
            rest = rest + self._posedirs @ np.asarray(self._features(pose.T)).ravel()
        return np.asarray(self._skinned(pose.T, rest.reshape(-1, 3).T)).T


def accuracy(body: SkinnedBody, test: PosedSurfaces) -> Accuracy:
    """A body's distances to the teacher's surfaces in the test poses."""
    evaluate = Evaluation(body)
    evaluate(test.poses[0])
    distances, seconds = [], []
    for pose, truth in zip(test.poses, test.vertices, strict=True):
        began = time.perf_counter()
        found = evaluate(pose)
        seconds.append(time.perf_counter() - began)
        distances.append(1e3 * np.linalg.norm(found - truth, axis=1))
    return Accuracy(
        mean=float(np.mean(distances)),
        rms=float(np.sqrt(np.mean(np.square(distances)))),
        largest=float(np.max(distances)),
        milliseconds=1e3 * min(seconds),
    )
