"""Scans that one camera took: space that it saw to be empty, and starts like what it saw."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.fitting.scans.scan import Scan
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.solids import face_vectors, sums_over_faces
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.registration.starts import STRAY_SHARE, WHOLE_HEIGHT, limb_poses
from workbench.residuals import Residual, free_space, geman_mcclure, scaled
from workbench.residuals.scans import BESIDE, Shadow

VERTICES_KEPT_OUT = 300  # vertices of the body, drawn at random, that are kept out of empty space
LEAST_SIGMA = 0.03  # m, of how far vertices are in empty space, at least
SIGMA_FACTOR = 3.0  # times the sigma of a stage: that, if it is more
KERNEL_REACH = 0.2  # m: the scale of the robust kernel; a limb in empty space has a long way back
MOST_BEHIND = 0.02  # of the points of a scan may be behind a camera that looks at their middle


def empty_space(body: Body, scan: Scan, camera: ArrayLike, sigma: float) -> Residual:
    """How far vertices stand in space that a camera at `camera` (3,) m saw to be empty.

    `sigma` is that of the stage in m: one that is coarse in its distances is as coarse in this. Of
    a scan that shows only a part of the body (see `shows_all`), what is beside counts as out of
    view. The lengths suit a whole person.
    """
    vertices = np.random.default_rng(0).permutation(body.n_vertices)[:VERTICES_KEPT_OUT]
    symbols = (block.symbol for block in body.blocks())
    sigma = max(SIGMA_FACTOR * sigma, LEAST_SIGMA)
    return free_space(
        body.points(*symbols, vertices=np.sort(vertices)),
        scan.points,
        camera,
        sigma=sigma,
        kernel=scaled(geman_mcclure, KERNEL_REACH / sigma),
        within=np.inf if shows_all(body, scan) else BESIDE,
        name="empty space",
    )


def shows_all(body: Body, scan: Scan) -> bool:
    """Whether a scan is at least 0.6 times as high as the body, as `scan_starts` asks for too.

    A lower one may have been cut off, so that nothing is known of what is beyond its points.
    """
    low, high = np.quantile(scan.points[:, 1], [STRAY_SHARE, 1 - STRAY_SHARE])
    return bool(high - low > WHOLE_HEIGHT * np.ptp(body.template[:, 1]))


def sees(camera: ArrayLike, points: Array) -> bool:
    """Whether one look from `camera` (3,) m can have all but 2 % of points (M, 3) m before it.

    A camera that stands among the points cannot have taken them.
    """
    rays = points - np.asarray(camera, dtype=float)
    far = np.linalg.norm(rays, axis=1)
    if not (far > 0).all():
        return False
    unit = rays / far[:, None]
    return bool(np.mean(unit @ np.median(unit, axis=0) <= 0) <= MOST_BEHIND)


DRAWN_POSES = 72  # poses of the prior that are tried beside those of the starts
SAME_ROOT = 1e-6  # rad: root rotations that differ less are one
LEAST_TOWARDS = 0.3  # cosine with the way to the camera, from which on a vertex faces it
COMPARED_POINTS, COMPARED_VERTICES = 200, 300  # of the scan and of the body, that are compared
FACING = 0.5  # cosine of the largest angle between the normals of a point and of a vertex
EMPTY_WEIGHT = 0.3  # how much a vertex in empty space counts beside a point without surface


def start_poses(body: Body, draws: int = DRAWN_POSES) -> Array:
    """Poses (P, K - 1, 3) rad of all joints but the root, such as people take.

    They are `limb_poses`, and random ones of `shipped_mixture` for a body with its joints. The same
    body always gets the same poses.
    """
    mixture = shipped_mixture()
    if tuple(body.joint_names[1:]) != tuple(mixture.joint_names):
        return np.array(limb_poses(body))
    drawn = draw_poses(mixture, draws, np.random.default_rng(0))[:, 1:]
    return np.concatenate([limb_poses(body), drawn])


def seen_starts(
    body: Body,
    scan: Scan,
    camera: Array,
    starts: Sequence[Values],
    count: int,
) -> tuple[Values, ...]:
    """The `count` starts that are most like the scan, the most alike first.

    Every root rotation of `starts` is combined with every pose of the other joints: those of
    `starts` and `start_poses`. `camera` (3,) m is where the scan was taken from. A scan from one
    side has its median on the skin, and not inside of the body; so the median of the vertices that
    face the camera comes to that of the scan. Feet are where `scan_starts` puts them.

    With d the distance from a point of the scan to the nearest vertex that faces its way, and e
    that from a vertex to the shadow of the scan (see `residuals.free_space`), starts are compared
    by the robust means, with KERNEL_REACH,

        mean d^2 / (d^2 + reach^2) + EMPTY_WEIGHT mean e^2 / (e^2 + reach^2).
    """
    pose, betas, trans = (block.name for block in body.blocks())
    roots = _distinct([start[pose][0] for start in starts])
    poses = [*_distinct([start[pose][1:] for start in starts]), *start_poses(body)]
    look, shape = _Look(scan, camera), starts[0][betas]
    vertices = np.linspace(0, body.n_vertices - 1, COMPARED_VERTICES).astype(int)
    turns = matrix_from_vector(np.array(roots))
    posed = np.stack([np.concatenate([np.zeros((1, 3)), other]) for other in poses])
    centre = body.joints(posed[0], shape, np.zeros(3))[0]  # the root's, which no pose moves
    candidates: list[tuple[float, Array, Values]] = []
    for other, surface in zip(poses, body.vertices(posed, shape, np.zeros(3)), strict=True):
        normals = sums_over_faces(face_vectors(surface, body.faces), body.faces, len(surface))
        normals = normals[vertices] / np.linalg.norm(normals[vertices], axis=1, keepdims=True)
        for root, R in zip(roots, turns, strict=True):
            v, n = (surface[vertices] - centre) @ R.T + centre, normals @ R.T
            place = look.place(v, n)
            start = {pose: np.concatenate([root[None], other]), betas: shape, trans: place}
            candidates.append((look.unlike(v + place, n), v + place, start))
    candidates.sort(key=lambda one: one[0])
    best: list[tuple[float, Values]] = []
    for unlike, v, start in candidates:
        if len(best) == count and unlike >= best[-1][0]:
            break  # empty space only adds to what the points say
        best.append((unlike + EMPTY_WEIGHT * look.outside(v), start))
        best = sorted(best, key=lambda one: one[0])[:count]
    return tuple(start for _, start in best)


class _Look:
    """What was seen from `camera` (3,) m, to be compared with bodies: some of the points (m, 3) m,
    the shadow and the median (3,) m of all, and the heights in m between which they are.
    """

    def __init__(self, scan: Scan, camera: Array) -> None:
        rows = np.random.default_rng(0).permutation(scan.n_points)[:COMPARED_POINTS]
        self.points = scan.points[rows]
        self.normals = None if scan.normals is None else scan.normals[rows]
        self.shadow = Shadow.of(scan.points, camera)
        self.middle: Array = np.median(scan.points, axis=0)
        self.ends: Array = np.quantile(scan.points[:, 1], [STRAY_SHARE, 1 - STRAY_SHARE])
        self.direction = (self.middle - camera) / np.linalg.norm(self.middle - camera)

    def place(self, vertices: Array, normals: Array) -> Array:
        """The translation (3,) m that brings what faces the camera to the scan."""
        towards = -normals @ self.direction > LEAST_TOWARDS
        shift = self.middle - np.median(vertices[towards] if towards.any() else vertices, axis=0)
        if np.ptp(self.ends) > WHOLE_HEIGHT * np.ptp(vertices[:, 1]):
            shift[1] = self.ends[0] - vertices[:, 1].min()
        return np.asarray(shift)

    def unlike(self, vertices: Array, normals: Array) -> float:
        """How much the points differ from a body (n, 3) m, from 0 to 1."""
        squares = (self.points**2).sum(axis=1)[:, None] + (vertices**2).sum(axis=1)
        squares -= 2 * self.points @ vertices.T
        if self.normals is not None:
            squares[self.normals @ normals.T < FACING] = np.inf
        return _mean_robust(np.maximum(squares.min(axis=1), 0.0))

    def outside(self, vertices: Array) -> float:
        """How much of a body (n, 3) m is in space that was seen to be empty, from 0 to 1."""
        return _mean_robust(self.shadow.distances(vertices).numbers.ravel() ** 2)


def _mean_robust(squares: Array) -> float:
    """The mean of s / (s + reach^2) over squares s of distances, from 0 to 1."""
    return float(np.mean(1 - KERNEL_REACH**2 / (squares + KERNEL_REACH**2)))


def _distinct(arrays: Sequence[Array]) -> list[Array]:
    """Those that differ from all before by more than rounding."""
    distinct: list[Array] = []
    for array in arrays:
        if all(np.abs(array - other).max() > SAME_ROOT for other in distinct):
            distinct.append(array)
    return distinct
