"""How much of people's shapes the first k shape directions of SMPL and of SCAPE explain.

Of all affine spaces of k dimensions, the one through the mean along the first k principal
components is nearest to a set of points in the least-squares sense (Eckart and Young, The
Approximation of One Matrix by Another of Lower Rank, Psychometrika 1, 1936). Stitching k directions
of deformation gradients gives such a space of vertices too, so with the same centring it explains
at most what k components of vertices explain, for every k.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.training.triangles.learning import learn_gradient_shapes, stitched_directions


@dataclass(frozen=True, eq=False)
class ExplainedVariance:
    """How near k = 0, 1, ... shape directions come to people whose centroids were made to coincide.

    Attributes:
        share: (k + 1,), of the variance of the vertices.
        rms: (k + 1,) in metres, the distance that is left at a vertex.
    """

    share: Array
    rms: Array

    def count_for(self, share: float) -> int | None:
        """How many directions explain that share; None if all of them together do not."""
        enough = self.share >= share
        return int(np.argmax(enough)) if enough.any() else None


def explained_by_vertices(
    people: ArrayLike, most: int, others: ArrayLike | None = None
) -> ExplainedVariance:
    """What the first principal components of the vertices of people (P, N, 3) m explain.

    It is measured on `others` (Q, N, 3) about the same mean, or on the people themselves.
    """
    centred, mean = _centred(people)
    components = np.linalg.svd(centred, full_matrices=False)[2][:most]
    return _explained(_about(mean, people if others is None else others), components)


def explained_by_triangles(
    people: ArrayLike, faces: Index, most: int, others: ArrayLike | None = None
) -> ExplainedVariance:
    """The variance that principal components of deformation gradients explain, after stitching.

    Each person gets the betas that bring the vertices nearest, which explains more than betas
    trained on gradients would. The arguments are those of `explained_by_vertices`.
    """
    shapes = learn_gradient_shapes(people, faces, most)
    directions = stitched_directions(shapes, faces).reshape(-1, most).T  # centroids at 0
    _, mean = _centred(people)
    return _explained(_about(mean, people if others is None else others), directions)


def explained_gradients(people: ArrayLike, faces: Index, most: int) -> Array:
    """Shares (most + 1,) of the variance of the gradients themselves, before any stitching.

    It is what SCAPE's own principal components maximise: 9 numbers per face, where small faces
    count as much as large ones.
    """
    return np.append(0.0, np.cumsum(learn_gradient_shapes(people, faces, most).explained))


def _centred(people: ArrayLike) -> tuple[Array, Array]:
    v = np.asarray(people, dtype=float)
    v = v - v.mean(axis=1, keepdims=True)
    mean = v.mean(axis=0)
    return (v - mean).reshape(len(v), -1), mean


def _about(mean: Array, people: ArrayLike) -> Array:
    v = np.asarray(people, dtype=float)
    return np.asarray((v - v.mean(axis=1, keepdims=True) - mean).reshape(len(v), -1))


def _explained(deviations: Array, directions: Array) -> ExplainedVariance:
    """What the span of the first k rows of `directions` explains of the deviations, for every k."""
    Q = np.linalg.qr(directions.T)[0]
    along = np.cumsum((deviations @ Q) ** 2, axis=1).sum(axis=0)  # (k,)
    total = float((deviations**2).sum())
    left = np.maximum(total - np.append(0.0, along), 0.0)
    return ExplainedVariance(1 - left / total, np.sqrt(left / (deviations.size / 3)))
