"""Whether a fit to a scan may be believed: doubts as `fitting.doubts` has them, of scans."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.errors import NotFinite
from workbench.fitting.doubts import of_person, pose_square
from workbench.fitting.scans.surface import loose_points
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration.from_a_camera import shows_all
from workbench.registration.model_fit import ModelFit
from workbench.registration.starts import facing
from workbench.residuals.scans import BESIDE, Shadow

NEAR = 0.03  # m: a vertex without a point of the scan as near as this was not seen
FACING = 0.5  # cosine of the largest angle between normals in contact


@dataclass(frozen=True, eq=False)
class Support:
    """Which vertices of a fit the scan says something about.

    Attributes:
        distances: (M,) m, signed, from each point of the scan to the surface; infinite where none
            faces its way.
        touching: (M,) which points are within the reach of the fit.
        contacts: (N,) how many of them touch a triangle of each vertex.
        seen: (N,) which vertices have a touching point nearby, within 3 cm unless `support` is told
            otherwise; the others rest on the prior.
        sd: (N,) m, the posterior standard deviation of the place of each vertex, in Laplace's
            approximation: the root of the trace of its covariance, with contacts held.
    """

    distances: Array
    touching: Mask
    contacts: Index
    seen: Mask
    sd: Array

    @property
    def mean_sd(self) -> float:
        """The mean of `sd`, in m."""
        return float(np.mean(self.sd))


def support(fit: ModelFit, *, near: float = NEAR) -> Support:
    """What of a fit the scan supports.

    The standard deviations are those of the linearized problem: J'J of the last stage, whose
    derivatives are those with contacts held, pushed through to the vertices. They hold near the
    best hypothesis and say nothing about others. A vertex without a touching point within `near` m
    was not seen. Raises NotFinite where the priors leave a direction open.
    """
    vertices = fit.vertices()
    faces, scan = fit.body.faces, fit.scan
    tree = SurfaceTree(vertices, faces)
    nearest = tree.closest(scan.points, 10 * fit.reach, scan.normals, FACING)
    distances = np.where(nearest.faces >= 0, nearest.distances, np.inf)
    touching = np.abs(distances) < fit.reach
    contacts = np.bincount(faces[nearest.faces[touching]].ravel(), minlength=len(vertices))
    seen: Mask = contacts > 0
    if touching.any():
        seen = seen & (np.asarray(cKDTree(scan.points[touching]).query(vertices)[0]) < near)
    return Support(distances, touching, contacts, seen, _vertex_sd(fit))


def _vertex_sd(fit: ModelFit) -> Array:
    """(N,) m, the posterior standard deviation of each vertex."""
    arithmetic = fit.body.points(*(block.symbol for block in fit.body.blocks())).source.numeric
    assert arithmetic is not None  # of every body
    blocks = fit.problem.free.blocks
    into = {block.name: np.zeros((block.size, 3 * fit.body.n_vertices)) for block in blocks}
    arithmetic.evaluate(fit.values).write_jacobian(into, None)
    J = np.concatenate([into[block.name] for block in blocks])  # (n, 3 N), transposed
    solved = fit.problem.linearize(fit.values).inverse_times(J)
    if solved is None or not np.isfinite(solved).all():
        raise NotFinite(
            "the scan and the priors leave a direction of the body open, so that its vertices "
            "have no posterior; give priors on pose and betas"
        )
    return np.asarray(np.sqrt(np.sum(J * solved, axis=0).reshape(-1, 3).sum(axis=1)))


@dataclass(frozen=True)
class Doubts:
    """The thresholds above which a fit is doubted, as far as they differ between people and hands.

    Attributes:
        apart: in m, the mean distance of vertices from which on hypotheses differ.
        rough: in m, the largest robust standard deviation of the distances.
        open: in m, the largest mean standard deviation of the vertices, for which the scan and the
            priors leave room.
        unusual: the largest mean square of the pose in standard deviations of `pose_prior`, which
            is 1 for poses drawn from it; judged where half of the vertices or more were not seen.
    """

    apart: float = 0.05
    rough: float = 0.012
    open: float = 0.018
    unusual: float = 0.9


TIE_SHARE = 0.05  # of the cost: two hypotheses that differ by less tie
TURNED_ANGLE = np.pi / 3  # rad: the angle from which on two hypotheses face different ways
MOST_STRAY = 0.4  # of the points may be without contact
MOST_BEFORE = 0.015  # of the vertices may be in space that the camera saw to be empty
MOST_OFF = 0.008  # of the scan's points and of its area may form one cluster off the surface
CLEARANCE = 0.03  # m: a vertex that stands as far in empty space would have been seen
OFF_SURFACE = 2 / 3  # of the reach of the fit: a point farther away does not belong to the surface
MOST_SEEN = 0.5  # of the vertices: where fewer were seen, the prior decides much of the pose
NTH_NEIGHBOUR = 4  # whose distance says how dense the points of a scan are
LINK_FACTOR = 2.0  # times that distance: points that are nearer hang together
MOST_POINTS = 5_000  # points of a scan that are looked at for that
MAD_TO_SD = 1.4826  # times the median of absolute values is the standard deviation of a Gaussian


def doubts(
    fit: ModelFit,
    found: Support | None = None,
    *,
    camera: ArrayLike | None = None,
    limits: Doubts = Doubts(),
) -> tuple[str, ...]:
    """What speaks against a fit, in sentences; none if nothing does.

    `found` is the `support` of the fit, if it is known already, and `camera` (3,) m is where the
    whole scan was taken from, if it was taken from one place.
    """
    known = support(fit) if found is None else found
    sentences = [*_ties(fit, limits), *_data(known, limits), *_missed(fit, known)]
    sentences += [*_hidden(fit, known, limits), *_unusual(fit, known, limits)]
    if camera is not None:
        sentences += _before(fit, np.asarray(camera, dtype=float))
    if fit.stopped:
        sentences.append(f"the fit did not end by itself: {fit.stopped}")
    return (*sentences, *of_person(fit.body, fit.values[fit.body.blocks()[1].name]))


def _ties(fit: ModelFit, limits: Doubts) -> Iterator[str]:
    best, forward = fit.vertices(), _facing(fit, 0)
    for k, other in enumerate(fit.hypotheses[1:], start=1):
        excess = (other.cost - fit.cost) / fit.cost
        distance = float(np.linalg.norm(fit.vertices(k) - best, axis=1).mean())
        if excess > TIE_SHARE or distance < limits.apart:
            continue
        angle = float(np.arccos(np.clip(forward @ _facing(fit, k), -1, 1)))
        if angle > TURNED_ANGLE:
            yield (
                f"which way the body faces is not decided: turned by {np.degrees(angle):.0f} "
                f"degrees it costs {100 * excess:.1f} % more; look at the picture, and give "
                "--camera if the scan was taken from one place"
            )
        else:
            yield (
                f"another pose, {1e3 * distance:.0f} mm away in the mean over the vertices, costs "
                f"{100 * excess:.1f} % more; look at both"
            )


def _facing(fit: ModelFit, k: int) -> Array:
    """The horizontal unit vector along which the root of a hypothesis faces."""
    pose = fit.hypotheses[k].values[fit.body.blocks()[0].name]
    return facing(pose[0], fit.body.bind_pose[0])


def _data(known: Support, limits: Doubts) -> Iterator[str]:
    stray = 1 - float(known.touching.mean())
    if stray > MOST_STRAY:
        yield (
            f"{100 * stray:.0f} % of the points of the scan touch no surface; check its unit, "
            "which axis is up, and that it is of one person alone"
        )
    if known.touching.any():
        rough = MAD_TO_SD * float(np.median(np.abs(known.distances[known.touching])))
        if rough > limits.rough:
            yield (
                f"points that touch the surface are {1e3 * rough:.0f} mm off it (robust sd); the "
                "scan may be noisy or clothed, or in another unit"
            )


def _hidden(fit: ModelFit, known: Support, limits: Doubts) -> Iterator[str]:
    if known.mean_sd <= limits.open:
        return
    hidden = ~known.seen
    share = fit.body.vertex_weights[hidden].T @ known.sd[hidden] ** 2
    names = [fit.body.joint_names[k] for k in np.argsort(-share)[:3]] if hidden.any() else []
    yield (
        f"{100 * hidden.mean():.0f} % of the vertices were not seen and rest on the priors, most "
        f"at {', '.join(names)}; vertices have a "
        f"standard deviation of {1e3 * known.mean_sd:.0f} mm in the mean; do not measure there"
    )


def _unusual(fit: ModelFit, known: Support, limits: Doubts) -> Iterator[str]:
    """A body that was put into the scan the wrong way is bent as people seldom are."""
    if known.seen.mean() > MOST_SEEN or np.isinf(limits.unusual):
        return
    square = pose_square(fit.body, fit.values[fit.body.blocks()[0].name])
    if square > limits.unusual:
        yield (
            "people seldom stand like this, and half of the vertices were not seen: the joints are "
            f"{np.sqrt(square):.2f} standard deviations off the mean pose (root mean square)"
        )


def _missed(fit: ModelFit, known: Support) -> Iterator[str]:
    """A limb that was not found leaves many points side by side; most clutter is loose.

    They have to be a share of the scan's area too: the fingers of a mesh are many vertices.
    """
    points = fit.scan.points
    areas = np.ones(len(points)) if fit.scan.weights is None else fit.scan.weights
    away = (np.abs(known.distances) > OFF_SURFACE * fit.reach) & ~loose_points(fit.scan)
    rows = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
    tree, off_surface = cKDTree(points[rows]), points[rows][away[rows]]
    if not len(off_surface) or len(rows) <= NTH_NEIGHBOUR:
        return
    spacing = float(np.median(tree.query(points[rows], k=[NTH_NEIGHBOUR + 1])[0]))
    pairs = cKDTree(off_surface).query_pairs(LINK_FACTOR * spacing, output_type="ndarray")
    linked = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(off_surface), len(off_surface)))
    cluster = connected_components(linked)[1]
    counts, sums = np.bincount(cluster), np.bincount(cluster, areas[rows][away[rows]])
    large = (counts > MOST_OFF * len(rows)) & (sums > MOST_OFF * areas[rows].sum())
    if large.any():
        share = counts[large].max() / len(rows)
        yield (
            f"{100 * share:.0f} % of the points lie side by side and off the surface: "
            "a part of the body that was not found, or another thing"
        )


def _before(fit: ModelFit, camera: Array) -> Iterator[str]:
    within = np.inf if shows_all(fit.body, fit.scan) else BESIDE
    off = Shadow.of(fit.scan.points, camera, within=within).distances(fit.vertices()).numbers
    share = float(np.mean(off > CLEARANCE))
    if share > MOST_BEFORE:
        yield (
            f"{100 * share:.0f} % of the vertices stand where the camera would have seen them, "
            "in front of the scan or beside it"
        )
