"""Coregistration with a model that acts on triangles: registrations, subjects' D, and Q, in turn.

The joint cost of J scans of S subjects, with registrations V_j of edges A V_j, is

    sum_j [ E_S(scan_j; V_j) + E_C(V_j, pose_j, D_s(j), Q) + E_pose(pose_j) ] + E_D(D) + E_Q(Q)

    E_C   |A V_j - B(pose_j) D Q(pose_j) e|^2 / (2 sigma_C^2), the triangles not being stitched
    E_D   differences of D_f - D_f(fitted betas) over neighbouring faces, by sigma_D
    E_Q   posedirs from the first ones, by sigma_Q

(Hirshberg, Loper, Rachlin and Black, Coregistration, ECCV 2012.) Because triangles are not
stitched, the model's edges are linear in D of each face and in its Q, and edges say nothing of
where a registration stands: no translation is among the unknowns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.blocks.checks import above_zero
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.bodies.triangles.surface import TriangleSurface
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_prior
from workbench.geometry.solids import area
from workbench.geometry.triangles import edges
from workbench.problem import Linearization, Problem
from workbench.problem.storage import unblocked
from workbench.registration.coregistration.coregistering import (
    Fitted,
    coregistration_card,
    fingerprint,
    in_turn,
    lowered,
    median_betas,
)
from workbench.registration.coregistration.scan_block import JOB_SIZE, Scans, cost_of_scan
from workbench.registration.coregistration.triangle_steps import (
    JointStep,
    OfScan,
    PersonDeformations,
    PoseDeformations,
    Unknown,
    differing,
    learned_bends,
    model_edges,
)
from workbench.registration.free_vertices import (
    CLOSE_TERM,
    JOINT_SOLVER,
    SETTLED_SHARE,
    VERTICES,
    ScanTerm,
    Settled,
    touched,
)
from workbench.residuals import Residual, stitching
from workbench.training.execution import SERIAL, Execution, LogEntry
from workbench.training.triangles import learn_gradient_shapes


@dataclass(frozen=True)
class TrianglePlan:
    """What a coregistration of triangles does, and how strongly its terms hold.

    Raises BadArgument for no rounds, and for a sigma that is not above zero.

    Attributes:
        rounds: how often the model and the registrations are found in turn.
        coupling: sigma_C in m, of each coordinate of an edge.
        neighbours: sigma_D of what the entries of D differ by between neighbouring faces.
        bends: sigma_Q of an entry of posedirs, per rad.
        blocks: which parts of the model are found, of persons and bends; none holds it.
        term: that of a scan, E_S.
    """

    rounds: int = 4
    coupling: float = 0.01
    neighbours: float = 0.05
    bends: float = 0.1
    blocks: tuple[str, ...] = ("persons", "bends")
    term: ScanTerm = CLOSE_TERM

    def __post_init__(self) -> None:
        lengths = {name: getattr(self, name) for name in ("coupling", "neighbours", "bends")}
        above_zero("a coregistration", rounds=self.rounds, **lengths)
        if unknown := set(self.blocks) - {"persons", "bends"}:
            raise BadArgument(f"no block is called {sorted(unknown)[0]!r}; give persons and bends")


SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step of D or Q, until the joint cost falls


@dataclass(frozen=True, eq=False)
class TriangleState:
    """The unknowns of a coregistration of triangles: poses (J, K, 3) rad, registrations (J, N, 3)
    m, and a body whose beta s is 1 for subject s and otherwise 0, so that shapedirs are D - I; its
    posedirs are Q's. Also E_S (J,) of each scan, and the blocks that have run, in order.
    """

    body: TriangleBody
    poses: Array
    vertices: Array
    scan_costs: Array
    log: tuple[LogEntry, ...] = ()

    @property
    def templates(self) -> Array:
        """(S, N, 3) m, every subject at rest."""
        rest = np.zeros((self.body.n_joints, 3))
        return np.stack([self.body.vertices(rest, betas) for betas in np.eye(self.body.n_betas)])

    def arrays(self) -> dict[str, Array]:
        """All arrays by name, as they are stored."""
        of_scans = {name: getattr(self, name) for name in ("poses", "vertices", "scan_costs")}
        return {"shapedirs": self.body.shapedirs, "posedirs": self.body.posedirs, **of_scans}

    def of(self, arrays: Mapping[str, Array], log: tuple[LogEntry, ...]) -> "TriangleState":
        """The state of these arrays, named and shaped as `arrays`, and this log."""
        shapedirs, posedirs, poses, vertices, costs = (arrays[name] for name in self.arrays())
        body = replace(self.body, shapedirs=shapedirs, posedirs=posedirs)
        return TriangleState(body, poses, vertices, costs, log)


@dataclass(frozen=True, eq=False)
class TriangleCoregistration:
    """The joint problem of scans and a triangle body; see the module.

    The template of `body`, from which D and Q start, has the topology of the registrations. Raises
    BadArgument for scans whose subjects are not numbered from 0 on.
    """

    body: TriangleBody
    scans: Scans
    plan: TrianglePlan = TrianglePlan()

    def __post_init__(self) -> None:
        people = np.unique(self.scans.subject)
        if not len(people) or not np.array_equal(people, np.arange(len(people))):
            raise BadArgument("the subjects of scans are numbered 0, 1, 2, ... without gaps")

    def first(self, fits: Sequence[Fitted], vertices: Array) -> TriangleState:
        """The state that begins: every subject has the median of the betas of its scans.

        `vertices` (J, N, 3) m are registrations of each scan by itself.
        """
        subject, F = self.scans.subject, self.body.n_faces
        betas_of_subjects = median_betas(fits, subject)
        columns = self.body.shapedirs.reshape(9 * F, -1) @ np.stack(betas_of_subjects, axis=1)
        body = replace(self.body, shapedirs=columns.reshape(F, 3, 3, -1))
        poses = np.stack([fit.pose for fit in fits])
        return TriangleState(body, poses, vertices, np.zeros(len(fits)))

    def learned(self, state: TriangleState, n_betas: int) -> TriangleBody:
        """The body of a state, whose shape directions are those of its subjects."""
        people = state.templates
        shapes = learn_gradient_shapes(people, self.body.faces, min(n_betas, len(people) - 1))
        return replace(
            state.body,
            name="coregistered",
            template=shapes.template,
            shapedirs=shapes.shapedirs,
            card=coregistration_card(self.body.name, self.scans.subject, state.log),
        )

    def seen(self, state: TriangleState) -> Array:
        """(J, N) 1 where a scan touches a triangle of a vertex, and 0 elsewhere."""
        outlier = self.plan.term.outlier
        each = [
            touched(self._scan_term(j)[0], {VERTICES: vertices}, outlier)
            for j, vertices in enumerate(state.vertices)
        ]
        return np.stack(each).astype(np.float64)

    def run(
        self,
        fits: Sequence[Fitted],
        vertices: Array,
        *,
        folder: Path | None = None,
        execution: Execution = SERIAL,
    ) -> TriangleState:
        """Carry out the plan from fits of the body to every scan, and their registrations.

        `vertices` (J, N, 3) m are registrations of each scan by itself. The model moves first:
        edges add up, and a limb whose edges are 2 mm off here and there ends 100 mm from its
        scan, where nothing draws it back. With a `folder`, the state is kept there after every
        block, from which the same call continues, as `Coregistration.run` does. Raises NotLowered
        if a block raises the joint cost, and BadFile for a checkpoint of something else.
        """
        first = self.first(fits, vertices)
        digest = fingerprint(self.scans, first, self.plan) if folder else ""

        def costs(state: TriangleState) -> dict[str, float]:
            return self.costs(state, first.body)

        def step(
            state: TriangleState, block: str, cost: float, execution: Execution
        ) -> tuple[TriangleState, dict[str, float]]:
            if block == "registrations":
                return self._registered(state, execution), {}
            part = partial(self._moved, state, *self._step(state, first.body, block))
            return lowered(state, part, costs, cost, SHARES)

        steps = [*self.plan.blocks, "registrations"] * self.plan.rounds
        return in_turn(first, self._measured, steps, costs, step, folder, digest, execution)

    def costs(self, state: TriangleState, first: TriangleBody) -> dict[str, float]:
        """The joint cost of a state, by term; E_D and E_Q count from the body `first`."""
        plan, gaps = self.plan, 0.0
        for j in range(len(state.poses)):
            e = edges(state.vertices[j], self.body.faces).reshape(-1, 3)
            gaps += float(((e - model_edges(self._posed(state, j))) ** 2).sum())
        prior = Problem((pose_prior(self.body),), ("pose",))
        D = (state.body.shapedirs - first.shapedirs).reshape(self.body.n_faces * 9, -1)
        precision = differing(self.body, plan.neighbours)
        Q = state.body.posedirs - first.posedirs
        return {
            "E_S": float(state.scan_costs.sum()),
            "E_C": gaps / 2 / plan.coupling**2,
            "E_pose": sum(prior.linearize({"pose": pose}).cost for pose in state.poses),
            "E_D": float((D * (precision @ D)).sum()) / 2,
            "E_Q": float((Q**2).sum()) / 2 / plan.bends**2,
        }

    def _posed(self, state: TriangleState, j: int) -> TriangleSurface:
        betas = np.eye(state.body.n_betas)[self.scans.subject[j]]
        return state.body.arithmetic.evaluate(state.poses[j], betas)

    def _registered(self, state: TriangleState, execution: Execution) -> TriangleState:
        whole = area(self.body.template, self.body.faces)
        J = len(state.poses)
        each = [np.arange(i, min(i + JOB_SIZE, J)) for i in range(0, J, JOB_SIZE)]
        jobs = [(state.body, rows, state.poses[rows], state.vertices[rows]) for rows in each]
        work = partial(_register, self.scans, self.plan, whole)
        registered: list[tuple[Array, Array, float]] = []
        for some in execution.executor(work, jobs):
            registered += some
            execution.finished(len(registered), J)
        poses, vertices, costs = zip(*registered, strict=True)
        return replace(
            state, poses=np.stack(poses), vertices=np.stack(vertices), scan_costs=np.array(costs)
        )

    def _measured(self, state: TriangleState) -> TriangleState:
        each = [self._scan(j, V).cost for j, V in enumerate(state.vertices)]
        return replace(state, scan_costs=np.array(each))

    def _scan(self, j: int, vertices: Array) -> Linearization:
        term, block = self._scan_term(j)
        return Problem((term,), (VERTICES,), blocks=(block,)).linearize({VERTICES: vertices})

    def _scan_term(self, j: int) -> tuple[Residual, Block]:
        block = Block(VERTICES, (self.body.n_vertices, 3), "m")
        whole = area(self.body.template, self.body.faces)
        scan = self.scans.read(j)
        return self.plan.term.residual(block.symbol, self.body.faces, scan, whole), block

    def _step(
        self, state: TriangleState, first: TriangleBody, block: str
    ) -> tuple[Array, Array, Array]:
        """The changes of D of all subjects and Q, of which one is zero, and of registrations."""
        J = len(state.poses)
        linear = [self._scan(j, V) for j, V in enumerate(state.vertices)]
        scans = [
            OfScan(V, on_scan.gradient, csc_array(unblocked(on_scan.normal)))
            for V, on_scan in zip(state.vertices, linear, strict=True)
        ]
        surfaces = [self._posed(state, j) for j in range(J)]
        vertices, D = np.zeros_like(state.vertices), np.zeros_like(state.body.shapedirs)
        Q = np.zeros_like(state.body.posedirs)

        def solved(unknown: Unknown, rows: Index) -> Array:
            """The change of an unknown; those of the registrations of these rows are kept."""
            own, model = [scans[j] for j in rows], [model_edges(surfaces[j]) for j in rows]
            step = JointStep(unknown, own, model, self.plan.coupling, self.body)
            change, vertices[rows] = step.solve()
            return change

        if block == "persons":
            fitted = np.eye(3)[..., None] + first.shapedirs
            for s in range(state.body.n_betas):
                rows = np.flatnonzero(self.scans.subject == s)
                own, sigma = [surfaces[j] for j in rows], self.plan.neighbours
                person = PersonDeformations(state.body, own, sigma, fitted[..., s])
                D[..., s] = solved(person, rows).reshape(-1, 3, 3)
        else:
            bends = PoseDeformations(state.body, surfaces, self.plan.bends, first.posedirs)
            Q[:] = solved(bends, np.arange(J)).reshape(Q.shape)
        return D, Q, vertices

    def _moved(
        self, state: TriangleState, D: Array, Q: Array, vertices: Array, share: float
    ) -> TriangleState:
        """The state after a share of these changes."""
        body = replace(
            state.body,
            shapedirs=state.body.shapedirs + share * D,
            posedirs=state.body.posedirs + share * Q,
        )
        return self._measured(replace(state, body=body, vertices=state.vertices + share * vertices))


def bent_as(body: SkinnedBody, fits: Sequence[Fitted], plan: TrianglePlan) -> TriangleBody:
    """BlendSCAPE of a skinned body, whose Q makes the mean person's meshes in the fitted poses.

    It is where a coregistration of triangles begins; see `learned_bends`.
    """
    poses = np.stack([fit.pose for fit in fits])
    poses[:, 0] = 0
    return learned_bends(blend_scape(body), poses, body.vertices(poses), plan.coupling / plan.bends)


Job = tuple[TriangleBody, Index, Array, Array]


def _register(
    scans: Scans, plan: TrianglePlan, whole: float, job: Job
) -> list[tuple[Array, Array, float]]:
    """Pose, vertices and E_S of some scans; no cost is higher afterwards."""
    body, rows, poses, vertices = job
    registered = []
    pose, betas, _ = body.blocks()
    block = Block(VERTICES, (body.n_vertices, 3), "m")
    model = body.deformed_edges(pose.symbol, betas.symbol)
    coupling = stitching(block.symbol, model, body.faces, sigma=plan.coupling, name="coupling")
    prior = pose_prior(body)
    for row, theta, V in zip(rows, poses, vertices, strict=True):
        scan = plan.term.residual(block.symbol, body.faces, scans.read(row), whole)
        described = (block, pose, betas)
        problem = Problem((scan, coupling, prior), ("pose", VERTICES), blocks=described)
        betas_of_subject = np.eye(body.n_betas)[scans.subject[row]]
        values: Values = {"pose": theta, "betas": betas_of_subject, VERTICES: V}
        until = Settled(SETTLED_SHARE)
        values = values | JOINT_SOLVER.solve(problem, values, callback=until).values
        registered.append((values["pose"], values[VERTICES], cost_of_scan(scan, values)))
    return registered
