"""What SCAPE and BlendSCAPE are learned from: posed meshes, and people at rest.

The shape of a person is D_f = X_f at rest, and its directions are principal components of that.
While D (shape) and Q (pose) are learned, triangles need not fit together. (Anguelov et al., SCAPE,
2005; Hirshberg et al., Coregistration, 2012.)
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.geometry.triangles import gradient_derivatives


def neighbour_differences(faces: Index) -> csr_array:
    """(E, F): one face less the other, for every edge that two faces share."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(sides.T)
    same = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    first, second = owner[order[:-1][same]], owner[order[1:][same]]
    E = len(first)
    return csr_array(
        (
            np.tile([1.0, -1.0], E),
            (np.repeat(np.arange(E), 2), np.stack([first, second], 1).ravel()),
        ),
        shape=(E, len(faces)),
    )


@dataclass(frozen=True, eq=False)
class PosedMeshes:
    """M meshes of one topology in known poses. Raises BadArgument if they do not fit together.

    Attributes:
        vertices: (M, N, 3) in metres.
        poses: (M, K, 3) in radians.
        person: (M,) the number of each mesh's person, from 0.
    """

    vertices: Array
    poses: Array
    person: Index

    def __post_init__(self) -> None:
        M = len(self.vertices)
        if self.poses.shape[:1] != (M,) or self.person.shape != (M,) or not M:
            raise BadArgument(
                f"meshes {self.vertices.shape}, poses {self.poses.shape} and persons "
                f"{self.person.shape} must be as many, and at least one"
            )


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


def learn_gradient_shapes(people: ArrayLike, faces: Index, n_betas: int) -> TriangleShapes:
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
    away = np.moveaxis(v - template, 0, 2)
    gradients = gradient_derivatives(template, away, faces)  # (F, 3, 3, P)
    flat = gradients.reshape(-1, P)
    variances, coordinates = scipy.linalg.eigh(flat.T @ flat)
    order = np.argsort(-variances)[:n_betas]
    betas = coordinates[:, order] * np.sqrt(P - 1)
    directions = flat @ coordinates[:, order] / np.sqrt(P - 1)
    return TriangleShapes(
        template,
        directions.reshape(*gradients.shape[:3], n_betas),
        betas,
        variances[order] / max(variances.sum(), np.finfo(float).tiny),
    )
