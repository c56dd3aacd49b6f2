"""The replay of a registered scan: its points, and the surface on its way to them."""

import numpy as np

from workbench.arrays import Array
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import Registration
from workbench.registration.doubts import FACING, NEAR
from workbench.replay.assembling import recording
from workbench.replay.observations import spread
from workbench.replay.packing import packed
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording

MOST, LINKS = 6_000, 400  # points of the scan that are shown, and that are joined to the surface
MM = 1e3
OF_REGISTRATION = (
    "The points of the scan, and the surface on its way to them: the start that led to the result, "
    "the end of each stage, and the registration. Points in contact have the colour of their "
    "distance to the surface, others are grey. Where the surface is orange, the scan did not show "
    "it. Red lines lead from some of the points to the nearest place on the surface that faces "
    "their way. "
)


def recorded_registration(found: Registration) -> Recording | None:
    """The surface at the start, at the end of each stage and at last, with points of the scan.

    Distances are signed in a `Registration`, and are shown without their sign. None for a
    registration that was made without `surfaces`.
    """
    if not found.surfaces:
        return None
    rng = np.random.default_rng(0)
    scan = found.scan.some(rng.permutation(found.scan.n_points) < MOST)
    joined = spread(scan.n_points, LINKS)
    tree = SurfaceTree(found.vertices, found.faces)
    far, ends, said = [], [], []
    for name, vertices in found.surfaces.items():
        at = tree.moved(vertices).closest(scan.points, 10 * NEAR, scan.normals, FACING)
        there = at.faces >= 0
        distances = np.where(there, np.abs(at.distances), np.inf)
        far.append(distances)
        ends.append(np.where(there[joined, None], at.points[joined], np.nan))
        said.append(_said(name, distances, found.reach))
    surfaces = np.array(list(found.surfaces.values()))
    series = Series(
        "stages",
        list(found.surfaces),
        said,
        surfaces=surfaces,
        opens=len(surfaces) - 1,
        links=(np.array(ends), np.tile(scan.points[joined], (len(ends), 1, 1))),
        scan=(scan.points, np.array(far)),
        contact=found.reach,
        scale=_scale(far[-1], found.reach),
        hidden=(~found.seen).astype(float),
    )
    turn = found.facing
    return recording(
        {"faces": packed(found.faces, "u4")},
        None,
        OF_REGISTRATION.rstrip(),
        front=(float(np.sin(turn)), 0.0, float(np.cos(turn))),
        series=[series],
    )


def _scale(distances: Array, reach: float) -> float:
    """Where the colours end: 98 % of the points in contact at last are nearer, in whole mm."""
    near = distances[distances < reach]
    return float(np.ceil(MM * np.percentile(near, 98)) / MM) if len(near) else reach


def _said(name: str, distances: Array, reach: float) -> str:
    """A sentence on one surface."""
    near = distances < reach
    begun = f"{name[0].upper()}{name[1:]}: "
    if not near.any():
        return f"{begun}none of the {len(distances):,} points shown is in contact."
    return (
        f"{begun}{100 * near.mean():.0f} % of the {len(distances):,} points shown are in contact, "
        f"nearer than {MM * reach:.0f} mm to the surface; half of these are within "
        f"{MM * float(np.median(distances[near])):.1f} mm."
    )
