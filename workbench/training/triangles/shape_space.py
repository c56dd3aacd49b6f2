"""Principal directions of the deformation gradients of people at rest."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from workbench.errors import BadArgument
from workbench.geometry.stitching import Stitching
from workbench.geometry.triangles import edges, gradient_slopes

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TriangleShapes:
    """D_f = I + shapedirs[f] betas about the mean of some people; betas in standard deviations."""

    template: Array  # (N, 3) m, the mean
    shapedirs: Array  # (F, 3, 3, B)
    betas: Array  # (P, B) of the people that it was learned from
    explained: Array  # (B,): the share of the gradients' variance


def learn_shapes(people: ArrayLike, faces: Index, n_betas: int) -> TriangleShapes:
    """Principal components of the gradients X_f of people (P, N, 3) at rest, about their mean.

    The third axis of X_f is taken to first order, so that X_f is linear in the vertices: people
    who fill k dimensions then have k components and not more. Raises BadArgument for more betas
    than P - 1 people can tell apart.
    """
    v = np.asarray(people, dtype=float)
    P = len(v)
    if not 0 <= n_betas < P:
        raise BadArgument(f"{P} people tell up to {P - 1} shape directions apart, not {n_betas}")
    template = v.mean(axis=0)
    slopes = gradient_slopes(template, np.moveaxis(v - template, 0, 2), faces)  # (F, 3, 3, P)
    flat = slopes.reshape(-1, P)
    variances, coordinates = scipy.linalg.eigh(flat.T @ flat)
    order = np.argsort(-variances)[:n_betas]
    betas = coordinates[:, order] * np.sqrt(P - 1)
    directions = flat @ coordinates[:, order] / np.sqrt(P - 1)
    return TriangleShapes(
        template,
        directions.reshape(*slopes.shape[:3], n_betas),
        betas,
        variances[order] / max(variances.sum(), np.finfo(float).tiny),
    )


def stitched_directions(shapes: TriangleShapes, faces: Index) -> Array:
    """What each beta does to the vertices once stitched, centroids at rest: (N, 3, B) m."""
    stitching = Stitching(faces, len(shapes.template))
    e = edges(shapes.template, faces)
    moved = np.einsum("facb,fic->bfia", shapes.shapedirs, e, optimize=True)
    found = [stitching.vertices(one) for one in moved]
    return np.stack(found, axis=2) if found else np.zeros((*shapes.template.shape, 0))
