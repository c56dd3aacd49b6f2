"""Meshes as paint: faces from far to near, each as bright as it is turned to the light."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.plots.palette import SKIN

LIGHT = np.array([-0.35, 0.55, 0.76])  # from the upper left, behind the viewer; right, up, towards


def painted(
    flat: Array,
    solid: Array,
    faces: Index,
    colours: ArrayLike | None = None,
    contrast: float = 0.5,
) -> PolyCollection:
    """A shaded mesh: `flat` (N, 2) is where vertices are drawn, `solid` (N, 3) where they are
    for the viewer (right, up, towards), in one unit. `colours` (F, 3) or one for all.

    Faces with a vertex that is not finite are left out.
    """
    finite = np.asarray(np.isfinite(np.column_stack([flat, solid])).all(axis=1))
    drawn = finite[faces].all(axis=1)
    base = np.broadcast_to(np.asarray(to_rgb(SKIN) if colours is None else colours), faces.shape)
    faces, base = faces[drawn], base[drawn]
    brightness = 1 - contrast + contrast * lightness(solid, faces)
    rgb = np.clip(base * brightness[:, None], 0, 1)
    order = np.argsort(solid[:, 2][faces].sum(axis=1), kind="stable")  # far faces first
    return PolyCollection(
        flat[faces[order]],  # type: ignore[arg-type]  # an array is a sequence of arrays
        facecolors=rgb[order],
        edgecolors=rgb[order],  # hides the seams between neighbours
        linewidths=0.3,
        rasterized=True,
    )


def lightness(solid: Array, faces: Index) -> Array:
    """How much each face is turned to the light, (F,) from 0 to 1, smoothed over its vertices."""
    a, b, c = (solid[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)  # as long as the face is large
    at_vertices = np.column_stack(
        [
            np.bincount(faces.ravel(), np.repeat(normals[:, i], 3), minlength=len(solid))
            for i in range(3)
        ]
    )
    smooth = at_vertices[faces].sum(axis=1)
    smooth = smooth * np.where(smooth[:, 2:] < 0, -1.0, 1.0)  # both sides of a face are skin
    length = np.linalg.norm(smooth, axis=1)
    towards = smooth @ (LIGHT / np.linalg.norm(LIGHT))
    return np.asarray(np.clip(towards / np.where(length > 0, length, 1.0), 0, 1))
