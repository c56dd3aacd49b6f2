"""One body posed in three steps, so that predictors of every size are timed alike.

Features and skinning are graphs of CasADi; the product of shapes and features between them, which
is most of the work, is NumPy's, or SciPy's where most shapes are nothing.
"""

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody, surface

Array = NDArray[np.float64]
SPARSE_BELOW = 0.2  # of all numbers: there a sparse product is the faster one


class Evaluation:
    """pose (K, 3) rad -> surface (N, 3) m of the mean person at the origin."""

    def __init__(self, body: SkinnedBody) -> None:
        pose, rest = cs.MX.sym("pose", 3, body.n_joints), cs.MX.sym("rest", 3, body.n_vertices)
        at = surface.posture(body, pose)
        G, _ = surface.motions(body, at, cs.MX.zeros(body.n_betas))
        self._features = cs.Function("features", [pose], [cs.densify(body.features(at))])
        skinned = body.skinning(rest, G, surface.weights(body))
        self._skinned = cs.Function("skinned", [pose, rest], [skinned])
        flat = body.posedirs.reshape(3 * body.n_vertices, -1)
        share = np.count_nonzero(flat) / max(1, flat.size)
        self._shapes = csr_array(flat) if share < SPARSE_BELOW else flat
        self._template = body.template.ravel()
        self._moved = bool(flat.any())

    def __call__(self, pose: Array) -> Array:
        """The surface."""
        rest = self._template
        if self._moved:
            rest = rest + self._shapes @ np.asarray(self._features(pose.T)).ravel()
        return np.asarray(self._skinned(pose.T, rest.reshape(-1, 3).T)).T
