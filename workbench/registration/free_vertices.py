"""Registration with free vertices: the template's vertices are unknowns, coupled to the model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Points, Values
from workbench.blocks.checks import above_zero, from_zero
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.scans.scan import Scan
from workbench.geometry.solids import area, mesh_edges
from workbench.problem import Problem
from workbench.problem.sparsity import rows_of_nonzeros
from workbench.problem.steps import ConjugateGradients
from workbench.residuals import (
    Form,
    Residual,
    distance,
    edges,
    geman_mcclure,
    scaled,
    scan_to_model,
    vertices,
)
from workbench.residuals.contacts import MovingContacts
from workbench.solvers import Iterate, Solution, Solver, TrustRegion

PATCH_AREA = 1e-3  # m^2 of a scan that count as one observation


@dataclass(frozen=True)
class ScanTerm:
    """How a scan becomes a residual on a surface: E_S, Geman-McClure's, weighted by areas.

    The weight of a point, outside of the kernel, is the area that it stands for, divided by
    `patch`, so that neither the resolution of the scan nor that of the template changes how much
    the scan counts: neighbouring points are not independent observations of a model that is not
    exact. Points whose areas are not known share the template's area evenly.

    Raises BadArgument for a length or an area that is not above zero.

    Attributes:
        sigma: in m, the noise of the scan.
        outlier: in m, the distance at which Geman-McClure's rho is half of its largest value.
        within: in m, the gate: a point farther away has no contact.
        facing: the least cosine of the angle between the normals in contact, if the scan has some.
        patch: in m^2, how much surface counts as one observation.
        form: what a contact says.
    """

    sigma: float = 0.003
    outlier: float = 0.03
    within: float = 0.1
    facing: float = 0.5
    patch: float = PATCH_AREA
    form: Form = distance

    def __post_init__(self) -> None:
        above_zero("a scan's term", sigma=self.sigma, outlier=self.outlier, patch=self.patch)
        above_zero("a scan's term", within=self.within)

    def residual(self, points: Points | cs.MX, faces: Index, scan: Scan, area: float) -> Residual:
        """The residual, in m, of a surface's vertices (N, 3); `area` in m^2 is the template's."""
        areas = (
            np.full(scan.n_points, area / scan.n_points) if scan.weights is None else scan.weights
        )
        return scan_to_model(
            points,
            faces,
            scan.points,
            sigma=self.sigma,
            kernel=scaled(geman_mcclure, self.outlier / self.sigma),
            weights=areas / self.patch,
            normals=scan.normals,
            within=self.within,
            facing=self.facing,
            form=self.form,
            name="scan",
        )


def touched(scan_residual: Residual, values: Mapping[str, Array], outlier: float) -> Mask:
    """Which vertices (N,) the scan touches: corners of triangles in contact with its points.

    A contact counts if its share in the vertex is above zero and it is at most `outlier` m long.
    Vertices that nothing touches are known only through the others. Raises BadArgument for a
    residual that has no contacts.
    """
    source = scan_residual.points[0].source if scan_residual.points else None
    if not isinstance(source, MovingContacts):
        raise BadArgument(
            f"residual {scan_residual.name!r} chooses no contacts; give one made by scan_to_model"
        )
    contacts = source.contacts(values)
    near = contacts.in_contact & (np.linalg.norm(contacts.numbers, axis=1) <= outlier)
    rows = np.repeat(near, contacts.numbers.shape[1])[rows_of_nonzeros(contacts.jacobian)]
    columns = contacts.jacobian.indices[rows & (contacts.jacobian.data != 0)]
    is_touched = np.zeros(contacts.jacobian.shape[1] // 3, dtype=bool)
    is_touched[columns // 3] = True
    return is_touched


Coupling = Callable[[cs.MX, Points, Index, float], Residual]
"""From the vertices' symbol (3, N), the model's points, faces (F, 3) and a sigma in m."""


def by_edges(free: cs.MX, model: Points, faces: Index, sigma: float) -> Residual:
    """E_C = |A V - A M|^2, where A takes the differences along all edges.

    V are the free vertices and M the model's (SMPL, section 4.1; Hirshberg et al., Coregistration,
    2012, take the differences along two edges of each triangle).

    The sigma is in m. What the scan moves takes its surroundings along, also where nothing was
    seen; translations change nothing.
    """
    return edges(model, free, mesh_edges(faces), sigma=sigma, name="coupling")


def by_vertices(free: cs.MX, model: Points, faces: Index, sigma: float) -> Residual:
    """E_C = |V - M|^2: each free vertex is drawn to its place on the model, whatever others do.

    The sigma is in m. A vertex that was not seen stays where the model puts it, even if all around
    it are elsewhere.
    """
    return vertices(model, free, sigma=sigma, name="coupling")


NEAR_TERM = ScanTerm(outlier=0.01, within=0.05, facing=0.8)
CLOSE_TERM = ScanTerm(outlier=0.006, within=0.05, facing=0.5)
BLOCKS = ("pose", "betas", "trans")
VERTICES = "vertices"
MODEL_SOLVER = TrustRegion(gradient_tolerance=1e-4, max_iterations=100)
VERTEX_SOLVER = TrustRegion(linear_algebra=ConjugateGradients())
JOINT_SOLVER = TrustRegion(linear_algebra=ConjugateGradients(tolerance=3e-2))
SETTLED_SHARE = 1e-3  # of the cost: a stage of free vertices ends after a smaller decrease
MOST_STEPS = 30  # steps of a stage that ends so


@dataclass(frozen=True)
class VertexStage:
    """A stage of a registration: what is free, and how strongly vertices are coupled.

    Raises BadArgument if nothing is free, for a coupling that is not a length, and for vertices
    that are free although the coupling is infinite.

    Attributes:
        name: what it is called.
        free: the names of the free blocks, out of pose, betas, trans and vertices.
        coupling: sigma_C in m, of each coordinate; 0 for an infinite coupling, V = M.
        term: how the scan pulls. Free vertices follow clutter where a whole body does not, so that
            outliers begin earlier for them.
        solver: what solves it.
        settled: the stage ends after a step that lowers the cost by less than this share of it,
            or after 30 steps; with 0 only the solver decides. Contacts go on switching between
            neighbouring triangles, so that gradients vanish late or never.
        prior_scale: by how much the standard deviations of the priors on pose and betas are
            multiplied. A larger one relaxes the priors, when the vertices have contacts by which
            the model finds its pose.
    """

    name: str
    free: tuple[str, ...]
    coupling: float
    term: ScanTerm = NEAR_TERM
    solver: Solver = VERTEX_SOLVER
    settled: float = SETTLED_SHARE
    prior_scale: float = 1.0

    def __post_init__(self) -> None:
        from_zero(f"stage {self.name!r}", coupling=self.coupling)
        if not self.free or (VERTICES in self.free and self.coupling == 0):
            raise BadArgument(
                f"stage {self.name!r} needs a free block, and a coupling above 0 m if {VERTICES} "
                f"are free: else they are the model's; not {self.free} and {self.coupling:g} m"
            )


@dataclass
class Settled:
    """A callback of a solver that stops it when a step lowers the cost by less than a share of it.

    `before` is the cost of the last iterate, and `left` how many more steps there may be.
    """

    share: float
    before: float = np.inf
    left: int = MOST_STEPS

    def __call__(self, iterate: Iterate) -> bool:
        """Whether the run is to stop after this iterate."""
        done = self.before - iterate.cost < self.share * iterate.cost or self.left == 0
        self.before, self.left = iterate.cost, self.left - 1
        return bool(done)


MODEL_STAGES = (
    VertexStage("model", BLOCKS, 0.0, ScanTerm(), MODEL_SOLVER, 0.0),
    VertexStage("model, near", BLOCKS, 0.0, NEAR_TERM, MODEL_SOLVER),
)
VERTEX_STAGES = (
    *MODEL_STAGES,
    VertexStage("free", (*BLOCKS, VERTICES), 0.01, CLOSE_TERM, JOINT_SOLVER),
    VertexStage("relaxed", (*BLOCKS, VERTICES), 0.01, CLOSE_TERM, JOINT_SOLVER, prior_scale=30.0),
)
"""Infinite coupling, then a weak one; the model goes on following the vertices, at last almost
without priors, which have led it there and would hold it back from a rare pose."""
QUICK_VERTEX_STAGES = (
    *MODEL_STAGES,
    VertexStage("strong", (VERTICES,), 0.002),
    VertexStage("weak", (VERTICES,), 0.01),
)
"""Infinite coupling, then strong, then weak, the model held once it is fitted: a step takes a
fraction of the time, but vertices come less near to the truth."""


@dataclass(frozen=True, eq=False)
class StageResult:
    """How a stage ended: what its solver found, and the surface (N, 3) m there."""

    stage: VertexStage
    solution: Solution
    vertices: Array


@dataclass(frozen=True, eq=False)
class Registered:
    """A template on a scan.

    Attributes:
        values: pose, betas, trans and vertices, by name.
        model: (N, 3) m, the vertices of the posed model at the end.
        touched: (N,) which vertices the scan touches; the others rest on the coupling alone.
        stages: how each stage ended.
    """

    values: Values
    model: Array
    touched: Mask
    stages: tuple[StageResult, ...]

    @property
    def vertices(self) -> Array:
        """(N, 3) m, the registration."""
        return self.values[VERTICES]


@dataclass(frozen=True, eq=False)
class FreeVertices:
    """A body and a scan as problems over pose, betas, trans and vertices, one for each stage.

        E = E_S(scan to V) + E_C(V to M(pose, betas, trans)) + E_pose + E_betas

    in stages: with an infinite coupling V is M, and this is the fit of the model; then the
    coupling is finite (Hirshberg, Loper, Rachlin and Black, Coregistration, ECCV
    2012; Bogo et al., FAUST, CVPR 2014). All stages have the same terms, and differ in the
    names that are free.

    Attributes:
        body: its template has the faces of the registration.
        scan: points, and normals and areas if they are known.
        couple: how free vertices are coupled to the model's.
    """

    body: SkinnedBody
    scan: Scan
    couple: Coupling = by_edges

    def problem(self, stage: VertexStage) -> Problem:
        """The problem of a stage. Raises UnknownName for a name that nothing reads."""
        pose, betas, trans = (block.symbol for block in self.body.blocks())
        model = self.body.points(pose, betas, trans)
        pose_term, shape_term, *limits = usual_priors(self.body)
        relaxed = [replace(r, sigma=stage.prior_scale * r.sigma) for r in (pose_term, shape_term)]
        priors = (*relaxed, *limits)
        if stage.coupling == 0:
            return Problem((self._scan(model, stage.term), *priors), stage.free)
        block = Block(VERTICES, (self.body.n_vertices, 3), "m")
        coupling = self.couple(block.symbol, model, self.body.faces, stage.coupling)
        read = priors if set(BLOCKS) & set(stage.free) else ()  # constants otherwise
        return Problem(
            (self._scan(block.symbol, stage.term), coupling, *read), stage.free, blocks=(block,)
        )

    def register(
        self, start: Mapping[str, Array], stages: tuple[VertexStage, ...] = VERTEX_STAGES
    ) -> Registered:
        """The stages in turn, each from where the last one ended.

        `start` has pose (K, 3) rad, betas (B,) and trans (3,) m near the scan; a stage of free
        vertices begins at the model's unless `start` holds vertices (N, 3) m too. Raises
        BadArgument if there are no stages.
        """
        if not stages:
            raise BadArgument("a registration has one stage or more; give a tuple of stages")
        values = {name: np.asarray(start[name], dtype=float) for name in BLOCKS}
        values[VERTICES] = np.asarray(start.get(VERTICES, self._model(values)), dtype=float)
        results: list[StageResult] = []
        for stage in stages:
            until = Settled(stage.settled) if stage.settled > 0 else None
            solution = stage.solver.solve(self.problem(stage), values, callback=until)
            values |= solution.values
            if stage.coupling == 0:
                values[VERTICES] = self._model(values)
            results.append(StageResult(stage, solution, values[VERTICES]))
        symbol = Block(VERTICES, (self.body.n_vertices, 3), "m").symbol
        seen = touched(self._scan(symbol, stages[-1].term), values, stages[-1].term.outlier)
        return Registered(values, self._model(values), seen, tuple(results))

    def _scan(self, points: Points | cs.MX, term: ScanTerm) -> Residual:
        whole = area(self.body.template, self.body.faces)
        return term.residual(points, self.body.faces, self.scan, whole)

    def _model(self, values: Mapping[str, Array]) -> Array:
        return np.asarray(self.body.vertices(*(values[name] for name in BLOCKS)))
