"""Poses of meshes by the training's pose solver, of triangle bodies as of skinned ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.solvers import LevenbergMarquardt
from workbench.training.pose_training import FIRST_SIGMA, FIRST_STEPS
from workbench.training.poses import (
    FIRST_DAMPING,
    TOLERANCE,
    Compared,
    OnEdges,
    OnVertices,
    PoseFit,
    ShapePrior,
    segments_turned,
)

Array = NDArray[np.float64]
AnyBody = SkinnedBody | TriangleBody
SIGMA = 0.002  # m: a mesh from the body, per coordinate; as in training
STEPS = 6  # of a stranger's pose and shape, after edges: more change no hundredth of a mm


@dataclass(frozen=True, eq=False)
class Fits:
    """Where a body was found in M meshes."""

    poses: Array  # (M, K, 3) rad
    betas: Array  # (M, B)
    surfaces: Array  # (M, N, 3) m

    def rms(self, meshes: Array) -> float:
        """Of the distances to meshes (M, N, 3), in their unit."""
        return float(np.sqrt(np.mean(np.sum((self.surfaces - meshes) ** 2, axis=-1))))


@dataclass(frozen=True)
class Search:
    """What is compared, how far it is ordinarily off, and how long is sought."""

    compared: Compared
    steps: int  # of Levenberg and Marquardt, at most
    sigma: float = SIGMA  # m
    shapes: ShapePrior | None = None  # None: betas are given

    def of(self, body: AnyBody, meshes: Array, poses: Array, betas: Array | None = None) -> Fits:
        """Begun at poses (M, K, 3) rad, with betas (M, B), or zero."""
        solver = LevenbergMarquardt(
            max_iterations=self.steps, gradient_tolerance=TOLERANCE, first_damping=FIRST_DAMPING
        )
        fit = PoseFit(body, body.n_vertices, self.compared, self.sigma, solver, self.shapes)
        seen = np.ones(body.n_vertices)
        known = np.zeros((len(meshes), body.n_betas)) if betas is None else betas
        each = zip(poses, meshes, known, strict=True)
        found = [fit.values(pose, V, seen, b) for pose, V, b in each]
        surfaces = [body.vertices(v["pose"], v["betas"], v["trans"]) for v in found]
        return Fits(
            np.stack([v["pose"] for v in found]),
            np.stack([v["betas"] for v in found]),
            np.stack(surfaces),
        )


def strangers_fitted(body: AnyBody, first: SkinnedBody, meshes: Array) -> Fits:
    """Pose, betas and place of a body in meshes (M, N, 3) m of people it has never seen.

    Whichever the body, segments of `first` are turned onto the mesh; then the edges of its mean
    shape decide, then its vertices, betas ordinary at one standard deviation.
    """
    seen = np.ones(first.n_vertices)
    turned = [segments_turned(first.template, first.weights, first.parents, V, seen)
              for V in meshes]  # fmt: skip
    roughly = Search(OnEdges(first.faces), FIRST_STEPS, FIRST_SIGMA)
    near = roughly.of(body, meshes, np.stack(turned))
    return Search(OnVertices(), STEPS, shapes=ShapePrior()).of(body, meshes, near.poses)
