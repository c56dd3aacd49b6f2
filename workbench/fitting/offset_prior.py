"""Where markers may sit: beside their nominal places, or on the surface at a known height.

How far the centre of a ball lies above the skin to which it is glued is known: it is the radius of
the ball and the thickness of its foot. What is not known is where on the surface somebody put it,
so that its offset is uncertain along the surface and nearly known across it (Loper, Mahmood and
Black, MoSh, 2014, section 3).
"""

import casadi as cs
import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting.marker_sets import MARKERS, MarkerSet
from workbench.geometry.solids import vertex_normals
from workbench.residuals import Residual, gaussian

NAME = "offset prior"
WAYS = "along 1", "along 2", "across"  # the surface: the rows of a marker


def offset_prior(
    body: SkinnedBody, marker_set: MarkerSet, sigma: float, across: float | None = None
) -> Residual:
    """Offsets (M, 3) m of a body that wears the markers, about their nominal places.

    `sigma` is the standard deviation along each axis in m; with `across`, it is that of the two
    directions along the surface, and `across` that of the height above it. The directions are those
    of the surface of the mean person at rest: its normal at the marker's vertex, and two
    perpendicular to it. A surface is curved: on a limb of radius R, a marker at the distance t from
    its vertex lies t^2 / 2R below the tangent plane in which the prior expects it, though its
    height above the skin is right; that is 0.3 mm for t = 5 mm and R = 4 cm. A coarse mesh and the
    shapes of other people add to it (`benchmarks/MARKERS.md`). Raises BadArgument for standard
    deviations that are not above 0, and where heights are known for a marker on a vertex that
    belongs to no face.
    """
    for what, value in (("offset_sigma", sigma), ("across", across)):
        number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
        if value is not None and not (number and 0 < value < np.inf):
            raise BadArgument(f"{what} is a standard deviation in m, above 0, not {value!r}")
    offsets = body.offsets(MARKERS).symbol
    if across is None:
        return gaussian(offsets, mean=marker_set.nominal, covariance=sigma**2, unit="m", name=NAME)
    turns = surface_frames(body, marker_set)
    rows = cs.sparsify(cs.DM(block_diag(*turns))) @ (
        cs.vec(offsets) - cs.DM(marker_set.nominal.ravel())
    )
    labels = tuple(f"{name}, {way}" for name in marker_set.names for way in WAYS)
    sigmas = np.tile([sigma, sigma, across], len(turns))
    return Residual(NAME, rows, sigmas, "m", labels=labels)


def surface_frames(body: SkinnedBody, marker_set: MarkerSet) -> Array:
    """(M, 3, 3): two directions along the surface of the mean person at rest, and its normal, as
    the rows of an orthonormal matrix for each marker.
    """
    normals = vertex_normals(body.template, body.faces)[marker_set.vertices]
    if (lost := np.linalg.norm(normals, axis=1) < 0.5).any():
        raise BadArgument(
            f"marker {marker_set.names[int(lost.argmax())]!r} is on a vertex that no face has, so "
            "that it has no height above a surface; leave `across` out, or put the marker elsewhere"
        )
    rows = np.linalg.svd(normals[:, None, :])[2]  # +-n first, and what is perpendicular to it
    return np.concatenate([rows[:, 1:], normals[:, None, :]], axis=1)
