"""SMPL's way with shape and pose beside SCAPE's, in numbers.

Of all affine spaces of k dimensions the one through the mean along the first k principal
components is nearest to a set of points in the least-squares sense (Eckart and Young 1936). What k
directions of deformation gradients are stitched into is such a space of vertices too, so with the
same centring it explains at most what k components of vertices explain, for every k.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.training.triangles.shape_space import learn_shapes, stitched_directions

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Explained:
    """How near k shape directions come to people, their centroids laid together; k = 0, 1, ..."""

    share: Array  # (k + 1,): of the variance of the vertices
    rms: Array  # (k + 1,) m: per vertex

    def count_for(self, share: float) -> int | None:
        """How many directions explain that share; None if all there are do not."""
        enough = self.share >= share
        return int(np.argmax(enough)) if enough.any() else None


def explained_by_vertices(
    people: ArrayLike, most: int, others: ArrayLike | None = None
) -> Explained:
    """By the first components of the vertices of people (P, N, 3) m, at rest.

    `others` (Q, N, 3) are whom it is measured on, about the same mean; None: the people.
    """
    centred, mean = _centred(people)
    components = np.linalg.svd(centred, full_matrices=False)[2][:most]
    return _explained(_about(mean, people if others is None else others), components)


def explained_by_triangles(
    people: ArrayLike, faces: Index, most: int, others: ArrayLike | None = None
) -> Explained:
    """By the first components of their deformation gradients, stitched.

    Each person gets the betas that bring the vertices nearest, which is more than training on
    gradients would give.
    """
    shapes = learn_shapes(people, faces, most)
    directions = stitched_directions(shapes, faces).reshape(-1, most).T  # centroids at 0
    _, mean = _centred(people)
    return _explained(_about(mean, people if others is None else others), directions)


def explained_gradients(people: ArrayLike, faces: Index, most: int) -> Array:
    """Shares (most + 1,) of the variance of the gradients themselves, before any stitching.

    What SCAPE's own principal components are chosen for: 9 numbers per face, small faces and
    large ones alike.
    """
    return np.append(0.0, np.cumsum(learn_shapes(people, faces, most).explained))


def additivity_gap(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """What shape and pose do together less what each does alone, unposed: (N, 3) m.

    T(pose, betas) - T(pose, 0) - T(0, betas) + T(0, 0), T being the surface before the joints
    turn it: zero for SMPL, whose blend shapes are added, and (D - I)(Q - I) stitched for SCAPE,
    whose deformations are multiplied.
    """
    still, mean = np.zeros_like(pose), np.zeros_like(betas)
    both, bent, shaped, neither = (
        unposed(body, *at) for at in ((pose, betas), (pose, mean), (still, betas), (still, mean))
    )
    return both - bent - shaped + neither


def unposed(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """The surface (N, 3) m with all that pose and shape deform, before any joint turns it."""
    if isinstance(body, TriangleBody):
        at = body.arithmetic.at(pose, betas)
        return np.asarray(at.of.placed(body.stitching.pulled(at.shaped)) + at.of.root)
    bent = body.posedirs @ body.kinematics.motion(pose, betas).features
    return np.asarray(body.template + body.shapedirs @ betas + bent)


def n_parameters(body: SkinnedBody | TriangleBody) -> int:
    """The numbers that training decides; posedirs that are zero are not counted."""
    shared = body.template.size + body.shapedirs.size + body.J_regressor.nnz
    weights = csr_array(body.weights).nnz
    return int(shared + weights + np.count_nonzero(body.posedirs))


def _centred(people: ArrayLike) -> tuple[Array, Array]:
    v = np.asarray(people, dtype=float)
    v = v - v.mean(axis=1, keepdims=True)
    mean = v.mean(axis=0)
    return (v - mean).reshape(len(v), -1), mean


def _about(mean: Array, people: ArrayLike) -> Array:
    v = np.asarray(people, dtype=float)
    return np.asarray((v - v.mean(axis=1, keepdims=True) - mean).reshape(len(v), -1))


def _explained(deviations: Array, directions: Array) -> Explained:
    """By the span of the first k rows of `directions`, for every k."""
    Q = np.linalg.qr(directions.T)[0]
    along = np.cumsum((deviations @ Q) ** 2, axis=1).sum(axis=0)  # (k,)
    total = float((deviations**2).sum())
    left = np.maximum(total - np.append(0.0, along), 0.0)
    return Explained(1 - left / total, np.sqrt(left / (deviations.size / 3)))
