"""Fits of bodies to meshes of held-out people, for triangle bodies and skinned ones alike."""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.training.pose_training import FIRST_SIGMA, FIRST_STEPS
from workbench.training.poses import (
    EdgeTerm,
    Fits,
    PoseFit,
    ShapePrior,
    VertexTerm,
    poses_of_segments,
)

AnyBody = SkinnedBody | TriangleBody
SIGMA = 0.002  # m: a mesh from the body, per coordinate; as in training
STEPS = 6  # of pose and shape after the edges; more of them change less than 0.01 mm


def fit_held_out(body: AnyBody, first: SkinnedBody, meshes: Array) -> Fits:
    """Fit pose, betas and trans of a body to meshes (M, N, 3) m of people it was not trained on.

    For any body, the segments of `first` are turned onto the mesh. Then the pose is fitted to the
    edges with the mean shape, and pose and shape to the vertices, betas being standard normal.
    """
    trusted, segments = np.ones(first.n_vertices), (first.template, first.weights, first.parents)
    turned = np.stack([poses_of_segments(*segments, V, trusted) for V in meshes])
    N = body.n_vertices
    by_edges = PoseFit(body, N, EdgeTerm(first.faces), FIRST_SIGMA, FIRST_STEPS)
    near = by_edges.fits(turned, meshes).poses
    return PoseFit(body, N, VertexTerm(), SIGMA, STEPS, ShapePrior()).fits(near, meshes)
