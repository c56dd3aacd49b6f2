"""Principal directions of the deformation gradients of people at rest."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.geometry.triangles import Stitching, edges, gradient_derivatives


@dataclass(frozen=True, eq=False)
class TriangleShapes:
    """D_f = I + shapedirs[f] betas about the mean of some people; betas in standard deviations.

    Attributes:
        template: (N, 3) in metres, the mean.
        shapedirs: (F, 3, 3, B) per unit of betas.
        betas: (P, B) those of the people that it was learned from.
        explained: (B,) the share of the gradients' variance.
    """

    template: Array
    shapedirs: Array
    betas: Array
    explained: Array


def learn_shapes(people: ArrayLike, faces: Index, n_betas: int) -> TriangleShapes:
    """Principal components of the gradients X_f of people (P, N, 3) at rest, about their mean.

    The third axis of X_f is taken to first order, so that X_f is linear in the vertices: people
    who span k dimensions then have k components and no more. Raises BadArgument for more than
    P - 1 betas.
    """
    v = np.asarray(people, dtype=float)
    P = len(v)
    if not 0 <= n_betas < P:
        raise BadArgument(f"{P} people tell up to {P - 1} shape directions apart, not {n_betas}")
    template = v.mean(axis=0)
    slopes = gradient_derivatives(template, np.moveaxis(v - template, 0, 2), faces)  # (F, 3, 3, P)
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
    """How each beta moves the stitched vertices about their mean, (N, 3, B) m per unit."""
    stitching = Stitching(faces, len(shapes.template))
    e = edges(shapes.template, faces)
    moved = np.einsum("facb,fic->bfia", shapes.shapedirs, e, optimize=True)
    found = [stitching.vertices(one) for one in moved]
    return np.stack(found, axis=2) if found else np.zeros((*shapes.template.shape, 0))
