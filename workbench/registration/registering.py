"""A scan registered from nothing but its points: a body fitted to it, then free vertices.

`fit_model` (stages from many starts), `support`, `doubts` and `FreeVertices` in turn. No fit goes
uphill from a limb that is folded the wrong way; so other poses of limbs are tried after a stage
(`unfolded`). Results hold arrays only, so that they may be computed in another process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.hands import is_hand
from workbench.fitting.measures import Measurement, measurements
from workbench.fitting.scans.scan import Scan
from workbench.fitting.scans.surface import boundary
from workbench.geometry.meshes import Mesh
from workbench.geometry.surface_tree import SurfaceTree
from workbench.interrupts import Interrupts
from workbench.registration.doubts import FACING, NEAR, doubts, support
from workbench.registration.free_vertices import FreeVertices
from workbench.registration.from_a_camera import sees
from workbench.registration.model_fit import FitProgress, FitStage, ModelFit
from workbench.registration.recipe import Recipe, usual_recipe
from workbench.registration.starts import facing

if TYPE_CHECKING:
    import trimesh

HEIGHT, LENGTH = "height", "length"
CAMERA_AMONG_POINTS = (
    "the camera stands among the points, which it cannot have seen; its place was not used"
)


@dataclass(frozen=True)
class BodySize:
    """The size of a body in its bind pose: the `height` of a person, from the lowest to the highest
    vertex, or the `length` of a hand, from the wrist's joint to the tip of a finger.
    """

    name: str
    metres: float


def body_size(body: Body, betas: Array) -> BodySize:
    """The size of a body with the shape betas (B,)."""
    surface = body.vertices(body.bind_pose, betas, np.zeros(3))
    if not is_hand(body):
        return BodySize(HEIGHT, float(np.ptp(surface[:, 1])))
    wrist = body.joints(body.bind_pose, betas, np.zeros(3))[0]
    return BodySize(LENGTH, float(np.linalg.norm(surface - wrist, axis=1).max()))


@dataclass(frozen=True)
class StageOutcome:
    """How one stage of a registration ended.

    Attributes:
        unknowns: the number of free numbers.
        iterations: from all starts together.
        median: in m, of the distances from the scan's points to the surface, over those in contact.
        touching: the share of the points that are in contact: nearer than the reach of the fit to
            surface that faces their way.
    """

    name: str
    unknowns: int
    iterations: int
    cost: float
    median: float
    touching: float
    seconds: float


@dataclass(frozen=True)
class OtherEnd:
    """Another pose at which the fit could have ended, whose cost is higher by a share `excess`, and
    whose vertices are `apart` m from those of the best end, in the mean.
    """

    excess: float
    apart: float


@dataclass(frozen=True, eq=False)
class Registration:
    """A body's template on a scan. It holds arrays only, so that it can be sent and stored.

    Attributes:
        scan: the points that were used.
        left_out: the number of points at the boundary that were not.
        faces: (F, 3) of the template.
        values: pose (K, 3) rad, betas (B,) and trans (3,) m of the fitted body.
        model: (N, 3) m, the fitted body's vertices.
        vertices: (N, 3) m, the registration; the model's where vertices were not free.
        seen: (N,) which vertices are near points of the scan; the others rest on the priors and on
            the coupling to the model.
        sd: (N,) m, the posterior standard deviation of the place of each vertex of the model, by
            Laplace's approximation.
        distances: (M,) m, signed, from the points used to the registered surface; infinite where
            no surface within 30 cm faces their way.
        stages: how each stage ended.
        others: further ends of the fit, the lowest cost first.
        doubts: what speaks against the registration, in sentences; none if nothing does.
        size: of the fitted body at rest: the height of a person, the length of a hand.
        facing: rad, the angle about the vertical by which the body is turned from +z.
        reach: in m, the reach of the fit's last stage: where bad points begin.
        measurements: of a person with these betas at rest, with standard deviations as for `sd`.
        surfaces: (N, 3) m each, by name and in order: the surface at the start that led to the
            result, and at the end of each stage.
    """

    scan: Scan
    left_out: int
    faces: Index
    values: Values
    model: Array
    vertices: Array
    seen: Mask
    sd: Array
    distances: Array
    stages: tuple[StageOutcome, ...]
    others: tuple[OtherEnd, ...]
    doubts: tuple[str, ...]
    size: BodySize
    facing: float
    reach: float
    measurements: tuple[Measurement, ...]
    surfaces: Mapping[str, Array] = field(default_factory=dict)

    @property
    def touching(self) -> Mask:
        """Which points (M,) are in contact: within `reach` of surface that faces their way."""
        return np.asarray(np.abs(self.distances) < self.reach)

    @property
    def median(self) -> float:
        """The median distance in m of the points in contact from the surface; NaN without any."""
        return self.stages[-1].median


def register(
    body: Body,
    scan: Scan | Mesh | trimesh.Trimesh,
    *,
    recipe: Recipe | None = None,
    camera: ArrayLike | None = None,
    progress: Callable[[FitProgress], object] | None = None,
) -> Registration:
    """Fit a body to a scan from many starts, free the vertices, and judge the result.

    A mesh is taken as a scan of its surface; see `Scan.of`. The recipe is the `usual_recipe` of the
    body, unless one is given.
    `camera` (3,) m is where the scan was taken from, if that was one place; then the body is kept
    out of what the camera saw to be empty, and `doubts` looks for what is left there. A camera
    among the points is not used, and a doubt says so. `progress` is told of every iterate of the
    fit of the body. Ctrl-C raises KeyboardInterrupt, and nothing is returned.

    Raises BadScan for a scan that cannot be of a person, or of which nothing is left
    without the points near its boundary.
    """
    scan = Scan.of(scan)
    recipe = usual_recipe(body) if recipe is None else recipe
    keep = ~boundary(scan, width=recipe.boundary) if recipe.boundary else None
    used = scan if keep is None else scan.some(keep)
    outside = camera if camera is None or sees(camera, used.points) else None
    known_camera = outside if recipe.empty else None
    began = time.perf_counter()
    with Interrupts() as interrupts:
        fit = recipe.fit(body, scan, keep=keep, camera=known_camera, progress=progress)
        interrupts.check()
        supported = support(fit, near=recipe.near)
        sentences = doubts(fit, supported, camera=outside, limits=recipe.doubts)
        if outside is not camera:
            sentences = (*sentences, CAMERA_AMONG_POINTS)
        vertices, values, seen = fit.vertices(), fit.values, supported.seen
        surfaces = _surfaces(fit, recipe.stages(seen=known_camera is not None))
        stages: list[StageOutcome] = []

        def ended(name: str, unknowns: int, iterations: int, cost: float) -> None:
            away = np.abs(_signed_distances(fit.scan, vertices, body.faces))
            touching = away < fit.reach
            median = float(np.median(away[touching])) if touching.any() else float("nan")
            seconds = time.perf_counter() - began - sum(stage.seconds for stage in stages)
            share = float(touching.mean())
            stages.append(StageOutcome(name, unknowns, iterations, cost, median, share, seconds))

        ended("model", fit.problem.free.size, fit.iterations, fit.cost)
        for stage in recipe.stages_of_vertices(body):
            assert isinstance(body, SkinnedBody)  # of which alone there are stages
            free = FreeVertices(body, used).register({**values, "vertices": vertices}, (stage,))
            interrupts.check()
            values, vertices = free.values, free.vertices
            seen = supported.seen | free.touched
            suffix = "" if stage.name == "free" else f", {stage.name}"
            surfaces[f"free vertices{suffix}"] = np.asarray(vertices)
            solution = free.stages[-1].solution
            unknowns = sum(np.size(solution.values[name]) for name in stage.free)
            ended(stage.name, unknowns, solution.iterations, solution.cost)
        interrupts.check()
    names = [block.name for block in body.blocks()]
    kept = {name: np.asarray(values[name]) for name in names}
    x, _, z = facing(kept[names[0]][0], body.bind_pose[0])
    return Registration(
        scan=used,
        left_out=scan.n_points - used.n_points,
        faces=body.faces,
        values=kept,
        model=np.asarray(body.vertices(*(kept[name] for name in names))),
        vertices=np.asarray(vertices),
        seen=seen,
        sd=supported.sd,
        distances=_signed_distances(used, vertices, body.faces),
        stages=tuple(stages),
        others=_others(fit),
        doubts=sentences,
        size=body_size(body, kept[names[1]]),
        facing=float(np.arctan2(x, z)),
        reach=fit.reach,
        measurements=measurements(body, fit.problem, kept, fit.priors),
        surfaces=surfaces,
    )


def _others(fit: ModelFit) -> tuple[OtherEnd, ...]:
    """The hypotheses of a fit after the best one."""
    best = fit.vertices()
    return tuple(
        OtherEnd(
            (other.cost - fit.cost) / fit.cost,
            float(np.linalg.norm(fit.vertices(k) - best, axis=1).mean()),
        )
        for k, other in enumerate(fit.hypotheses[1:], start=1)
    )


def _surfaces(fit: ModelFit, stages: Sequence[FitStage]) -> dict[str, Array]:
    """The body on the way of its fit, by stages and the number of points that they use."""
    names = [block.name for block in fit.body.blocks()]
    counts = [min(stage.points, fit.scan.n_points) for stage in stages]
    labels = ["start", *(f"stage {k + 1}, {count:,} points" for k, count in enumerate(counts))]
    return {
        label: np.asarray(fit.body.vertices(*(values[name] for name in names)))
        for label, values in zip(labels, fit.way, strict=False)  # a stopped fit has fewer stages
    }


def _signed_distances(scan: Scan, vertices: Array, faces: Index) -> Array:
    """(M,) m, signed; infinite where no surface within 30 cm faces the way of a point."""
    contacts = SurfaceTree(vertices, faces).closest(scan.points, 10 * NEAR, scan.normals, FACING)
    return np.asarray(np.where(contacts.faces >= 0, contacts.distances, np.inf))
