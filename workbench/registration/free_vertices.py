"""Registration with free vertices: the template's vertices are unknowns, coupled to the model."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import casadi as cs
import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.scans.scan import Scan
from workbench.geometry.solids import area
from workbench.problem import Problem
from workbench.problem.conjugate_gradients import ConjugateGradients
from workbench.registration.coupling import Coupling, by_edges
from workbench.registration.limbs import other_limbs
from workbench.registration.scan_term import ScanTerm, touched
from workbench.residuals import Residual
from workbench.solvers import Iterate, Solution, Solver, TrustRegion

NEAR = ScanTerm(outlier=0.01, within=0.05, facing=0.8)
CLOSE = ScanTerm(outlier=0.006, within=0.05, facing=0.5)
BODY = ("pose", "betas", "trans")
VERTICES = "vertices"
OF_MODEL = TrustRegion(gradient_tolerance=1e-4, max_iterations=100)
OF_VERTICES = TrustRegion(linear_algebra=ConjugateGradients())
TOGETHER = TrustRegion(linear_algebra=ConjugateGradients(tolerance=3e-2))
SETTLED = 1e-3  # of the cost: a stage of free vertices ends after a smaller decrease
MOST = 30  # steps of a stage that ends so
COARSE = 800  # points of the scan with which other poses of limbs are compared
COARSE_SETTLED = 5e-3  # of the cost: such a comparison ends after a smaller decrease


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
            neighbouring triangles when nothing else happens any more, so that gradients vanish late
            or never.
        limbs: whether arms and legs begin again from their mean pose afterwards, in case one is
            folded the wrong way; the lower cost decides (see `limbs`).
    """

    name: str
    free: tuple[str, ...]
    coupling: float
    term: ScanTerm = NEAR
    solver: Solver = OF_VERTICES
    settled: float = SETTLED
    limbs: bool = False

    def __post_init__(self) -> None:
        if not self.free or not 0 <= self.coupling < np.inf:
            raise BadArgument(
                f"stage {self.name!r} needs a free block and a coupling from 0 m on, not "
                f"{self.free} and {self.coupling:g} m"
            )
        if VERTICES in self.free and self.coupling == 0:
            raise BadArgument(
                f"in stage {self.name!r}, the coupling is infinite, so that the vertices are the "
                f"model's; give it a coupling above 0 m, or leave {VERTICES} out of {self.free}"
            )


@dataclass
class Settled:
    """A callback of a solver that stops it when the cost falls by less than a share of it.

    Attributes:
        share: of the cost, the smallest decrease by one step after which the run goes on.
        before: the cost of the last iterate.
        left: how many more steps there may be.
    """

    share: float
    before: float = np.inf
    left: int = MOST

    def __call__(self, iterate: Iterate) -> bool:
        """Whether the run is to stop after this iterate."""
        done = self.before - iterate.cost < self.share * iterate.cost or self.left == 0
        self.before, self.left = iterate.cost, self.left - 1
        return bool(done)


MODEL_STAGES = (
    VertexStage("model", BODY, 0.0, ScanTerm(), OF_MODEL, 0.0, limbs=True),
    VertexStage("model, near", BODY, 0.0, NEAR, OF_MODEL),
)
VERTEX_STAGES = (
    *MODEL_STAGES,
    VertexStage("free", (*BODY, VERTICES), 0.01, CLOSE, TOGETHER),
)
"""Infinite coupling, then a weak one; the model goes on following the vertices."""
QUICK_VERTEX_STAGES = (
    *MODEL_STAGES,
    VertexStage("strong", (VERTICES,), 0.002),
    VertexStage("weak", (VERTICES,), 0.01),
)
"""Infinite coupling, then strong, then weak, the model held once it is fitted: a step takes a
fraction of the time, but vertices come less near to the truth."""


@dataclass(frozen=True, eq=False)
class StageResult:
    """How a stage ended.

    Attributes:
        stage: the stage.
        solution: what its solver found.
        vertices: (N, 3) m, the surface at its end.
    """

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

    >>> from workbench import load_body
    >>> body = load_body("small")
    >>> scan = Scan(body.vertices() + [0.01, 0, 0])
    >>> done = FreeVertices(body, scan).register(body.start())
    >>> done.values["trans"].round(3).tolist(), int(done.touched.sum()) == body.n_vertices
    ([0.01, 0.0, 0.0], True)
    """

    body: SkinnedBody
    scan: Scan
    couple: Coupling = by_edges

    def problem(self, stage: VertexStage) -> Problem:
        """The problem of a stage. Raises UnknownName for a name that nothing reads."""
        pose, betas, trans = (block.symbol for block in self.body.blocks())
        model = self.body.points(pose, betas, trans)
        priors = usual_priors(self.body)
        if stage.coupling == 0:
            return Problem((self._scan(model, stage.term), *priors), stage.free)
        block = Block(VERTICES, (self.body.n_vertices, 3), "m")
        coupling = self.couple(block.symbol, model, self.body.faces, stage.coupling)
        read = priors if set(BODY) & set(stage.free) else ()  # constants otherwise
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
        values = {name: np.asarray(start[name], dtype=float) for name in BODY}
        values[VERTICES] = np.asarray(start.get(VERTICES, self._model(values)), dtype=float)
        done: list[StageResult] = []
        for stage in stages:
            solution = self._solved(stage, values)
            values |= solution.values
            if stage.coupling == 0:
                values[VERTICES] = self._model(values)
            done.append(StageResult(stage, solution, values[VERTICES]))
        symbol = Block(VERTICES, (self.body.n_vertices, 3), "m").symbol
        seen = touched(self._scan(symbol, stages[-1].term), values, stages[-1].term.outlier)
        return Registered(values, self._model(values), seen, tuple(done))

    def _solved(self, stage: VertexStage, values: Values) -> Solution:
        problem, settled = self.problem(stage), stage.settled
        found = _minimum(problem, stage.solver, settled, values)
        if not stage.limbs:
            return found
        coarse = replace(self, scan=self.scan.thinned(COARSE)).problem(stage)
        near = partial(_minimum, coarse, stage.solver, COARSE_SETTLED)
        other = other_limbs(self.body, near, values | found.values)
        if other is None:
            return found
        again = _minimum(problem, stage.solver, settled, values | other.values)
        return min(found, again, key=lambda end: end.cost)

    def _scan(self, points: Points | cs.MX, term: ScanTerm) -> Residual:
        whole = area(self.body.template, self.body.faces)
        return term.residual(points, self.body.faces, self.scan, whole)

    def _model(self, values: Mapping[str, Array]) -> Array:
        return np.asarray(self.body.vertices(*(values[name] for name in BODY)))


def _minimum(problem: Problem, solver: Solver, settled: float, values: Values) -> Solution:
    return solver.solve(problem, values, callback=Settled(settled) if settled > 0 else None)


def posterior_sd(problem: Problem, values: Values, draws: int = 64, seed: int = 0) -> Array:
    """The posterior standard deviation of every free number at a minimum, (n,), estimated.

    If z is standard normal, x = (J'J)^-1 J'z has the covariance (J'J)^-1 of Laplace's approximation
    (Papandreou and Yuille, Gaussian sampling by local perturbations, 2010). Each draw is one solve
    by conjugate gradients; `draws` of them give a relative error of 1 / sqrt(2 draws).
    """
    here = problem.linearize(values)
    rng = np.random.default_rng(seed)
    solve, n = ConjugateGradients(), problem.free.size
    squares = np.zeros(n)
    for _ in range(draws):
        pull = here.jacobian.T @ rng.standard_normal(here.shape[0])
        squares += solve.solved(here.normal, np.zeros(n), pull) ** 2
    return np.sqrt(squares / draws)
