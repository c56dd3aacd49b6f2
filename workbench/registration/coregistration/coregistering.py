"""Coregistration: registrations, poses, templates and the model that couples them, in turn.

The joint cost of J scans of S people is, for registrations V_j and a model M,

    E = sum_j [ E_S(scan_j; V_j) + |V_j - M_s(j)(pose_j)|^2 / (2 sigma_C^2) + E_pose(pose_j) ]
        + E_T(templates) + E_J + E_P + E_W

(Hirshberg, Loper, Rachlin and Black, Coregistration, ECCV 2012; Pons-Moll, Virtual Humans 5.1).
With V held, this is the objective of training, and with the model held every scan is a
registration of its own. The package says why the model's blocks take scans as soft observations,
and `training.priors` why templates are held by edges.
"""

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.checks import above_zero
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, BadFile
from workbench.fitting.body_priors import pose_gaussian
from workbench.geometry.solids import area
from workbench.identity import identity
from workbench.interrupts import Interrupts
from workbench.reading.arrays import Expected, doubles, nothing_else, opened, read_expected, texts
from workbench.reading.facts import facts_in
from workbench.registration.coregistration.scan_block import (
    OnScan,
    ScanCoupling,
    Scans,
    jobs,
    on_scans,
)
from workbench.registration.free_vertices import CLOSE_TERM, ScanTerm
from workbench.threads import limited_threads
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.checkpoint import FACTS, REMOVE, log_entry
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.execution import SERIAL, Execution, LogEntry, Progress
from workbench.training.first_guess import Start
from workbench.training.objective import Objective, centred, trusted
from workbench.training.pose_training import PoseModel
from workbench.training.priors import PosePrior, smooth_prior
from workbench.training.registrations import InMemory
from workbench.training.shape_training import start_shape
from workbench.writing import Keeping, replacing

if TYPE_CHECKING:
    from workbench.registration.coregistration.triangles import TriangleState

FILE, VERSION = "coregistration.npz", "3:"
STORED = ("vertices", "trans", "targets", "confidence", "scan_costs")


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns of a coregistration of J scans.

    Attributes:
        estimate: templates, joints, pose blend shapes, weights, and the pose of every scan.
        vertices: (J, N, 3) m, the registrations.
        trans: (J, 3) m.
        targets: (J, N, 3) m, where the scans alone would put the vertices.
        confidence: (J, N, 3, 3), how surely; see `scan_block`.
        scan_costs: (J,) E_S of each registration.
        log: the blocks that have run, in order.
    """

    estimate: Estimate
    vertices: Array
    trans: Array
    targets: Array
    confidence: Array
    scan_costs: Array
    log: tuple[LogEntry, ...] = ()

    @property
    def templates(self) -> Array:
        """(S, N, 3) m, every subject at rest."""
        return self.estimate.templates

    def arrays(self) -> dict[str, Array]:
        """All arrays by name, as they are stored."""
        return self.estimate.arrays() | {name: getattr(self, name) for name in STORED}

    def of(self, arrays: Mapping[str, Array], log: tuple[LogEntry, ...]) -> "State":
        """The state of these arrays, named and shaped as `arrays`, and this log."""
        of_scans = {name: arrays[name] for name in STORED}
        names = arrays.keys() - {*STORED, "regressor"}
        of_model: dict[str, Any] = {name: arrays[name] for name in names}
        regressor = csr_array(arrays["regressor"])
        return State(replace(self.estimate, **of_model, regressor=regressor), **of_scans, log=log)


def save_state(state: "AnyState", folder: Path, fingerprint: str) -> None:
    """Write the checkpoint, completely or not at all."""
    stored_facts = {"fingerprint": fingerprint, "log": [asdict(entry) for entry in state.log]}
    stored: dict[str, Any] = {FACTS: np.array(json.dumps(stored_facts)), **state.arrays()}
    with replacing(folder / FILE) as temporary, temporary.open("wb") as file:
        np.savez(file, **stored)


def read_state(folder: Path, fingerprint: str, first: "AnyState") -> "AnyState | None":
    """The state of an earlier run in `folder`, or None if there is no file.

    `first` is the state that the run began with, whose sizes do not change. Raises BadFile if the
    file is of other scans or settings, of another version, or damaged.
    """
    path = folder / FILE
    if not path.exists():
        return None
    with opened(path, "checkpoint of this coregistration", REMOVE) as archive:
        stored_facts = facts_in(read_expected(archive, {FACTS: texts()})[FACTS])
        if (digest := stored_facts.text("fingerprint")) != fingerprint:
            raise BadFile(
                "it is of other scans, another body or other settings"
                if digest.startswith(VERSION)
                else "another version of the workbench wrote it, which cannot be continued"
            )
        expected: dict[str, Expected] = {
            name: doubles(*array.shape) for name, array in first.arrays().items()
        }
        nothing_else(archive, (*expected, FACTS))
        arrays = read_expected(archive, expected)
        log = stored_facts.several("log", log_entry)
    return first.of(arrays, log)


def fingerprint(scans: Scans, first: "State | TriangleState", plan: object) -> str:
    """A digest of all that determines a coregistration. It reads every scan once."""
    digest = hashlib.sha256(json.dumps(identity(plan), sort_keys=True).encode())
    arrays = [*first.arrays().values(), scans.subject]
    for row in range(len(scans.subject)):
        scan = scans.read(row)
        arrays += [a for a in (scan.points, scan.normals, scan.weights) if a is not None]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return VERSION + digest.hexdigest()


EDGE_SIGMA = 0.01  # m
SIGMAS = Sigmas(data=0.003, rings=0.002, posedirs=0.001, weights=0.05)


@dataclass(frozen=True)
class CoregistrationPlan:
    """What a coregistration does, and how strongly its terms hold. Raises BadArgument for no
    rounds.

    Attributes:
        rounds: how often registrations and the model are found in turn; at the end the
            registrations are found once more.
        sigmas: of the terms; `data` is sigma_C, the coupling of registrations and model, in m.
        edges: sigma in m of the edges of a template, beyond what betas explain (E_T).
        blocks: those of training that make up the step of the model; none holds it.
        term: that of a scan, E_S.
        options: when the inner iterations of the model's blocks stop.
    """

    rounds: int = 4
    sigmas: Sigmas = SIGMAS
    edges: float = EDGE_SIGMA
    blocks: tuple[str, ...] = ("people", "surfaces", "regressor")
    term: ScanTerm = CLOSE_TERM
    options: BlockOptions = field(default_factory=lambda: BlockOptions(linear_tolerance=1e-3))

    def __post_init__(self) -> None:
        above_zero("a coregistration", rounds=self.rounds)


def coregistration_card(start: str, subject: Index, log: Sequence[LogEntry]) -> dict[str, Any]:
    """What a coregistered body is made of: the starting body, scans of subjects (J,), costs."""
    return {
        "coregistered_from": {
            "scans": len(subject),
            "subjects": len(np.unique(subject)),
            "starting_body": start,
        },
        "final_costs": {k: float(f"{v:.6g}") for k, v in log[-1].after.items()},
    }


AnyState = TypeVar("AnyState", "State", "TriangleState")
SHARES = (1.0, 0.5, 0.25, 0.1)  # of the model's step, until the joint cost falls


@dataclass(frozen=True, eq=False)
class Fitted:
    """A body fitted to one scan, from which coregistration starts: pose (K, 3) rad, betas (B,) and
    trans (3,) m.
    """

    pose: Array
    betas: Array
    trans: Array


def median_betas(fits: Sequence[Fitted], subject: Index) -> list[Array]:
    """The median (B,) of the betas of each subject's scans; `subject` (J,) says of whom each is."""
    betas = np.stack([fit.betas for fit in fits])
    return [np.median(betas[subject == s], axis=0) for s in range(subject.max() + 1)]


@dataclass(frozen=True, eq=False)
class Coregistration:
    """The joint problem of scans and a body.

    Raises BadArgument for scans of one subject, or of none, and for subjects that are not numbered
    from 0 on.

    The template of `body`, from which the model starts, has the topology of the registrations.
    """

    body: SkinnedBody
    scans: Scans
    plan: CoregistrationPlan = CoregistrationPlan()

    def __post_init__(self) -> None:
        subject = self.scans.subject
        people = np.unique(subject)
        if len(people) < 2:
            raise BadArgument(
                f"coregistration needs scans of two subjects or more, not of {len(people)}: a "
                "model's shapes cannot be learned from one; `workbench register` registers scans "
                "of one person"
            )
        if not np.array_equal(people, np.arange(len(people))):
            raise BadArgument("the subjects of scans are numbered 0, 1, 2, ... without gaps")

    def objective(self, registrations: InMemory) -> Objective:
        """The objective of training for these registrations, with templates held by edges."""
        body, plan = self.body, self.plan
        return Objective(
            registrations,
            body.J_regressor,
            body.weights,
            None,
            plan.sigmas,
            body.template,
            freedom=smooth_prior(body.faces, body.shapedirs, plan.edges),
            first_posedirs=body.posedirs,
            pose_prior=PosePrior.of(*pose_gaussian(body)),
        )

    def costs(self, state: State) -> dict[str, float]:
        """The joint cost of a state, by term."""
        registrations = InMemory(state.vertices, self.scans.subject)
        terms = self.objective(registrations).costs(state.estimate)
        return {"E_S": float(state.scan_costs.sum()), "E_C": terms.pop("E_D")} | terms

    def first(self, fits: Sequence[Fitted]) -> State:
        """The state that begins: every subject has the median of the betas of its scans."""
        body, subject = self.body, self.scans.subject
        medians = median_betas(fits, subject)
        templates = np.stack([body.template + body.shapedirs @ betas for betas in medians])
        estimate = Estimate(
            templates,
            np.stack([body.J_regressor @ T for T in templates]),
            body.posedirs,
            body.weights,
            np.stack([fit.pose for fit in fits]),
            body.parents,
            body.J_regressor,
        )
        J, N = len(fits), body.n_vertices
        trans = np.stack([fit.trans for fit in fits])
        nothing = InMemory(np.zeros((J, N, 3)), subject)
        vertices = _posed(self.objective(nothing), estimate) + trans[:, None]
        confidence = np.zeros((J, N, 3, 3))
        return State(estimate, vertices, trans, vertices, confidence, np.zeros(J))

    def learned(self, state: State, n_betas: int) -> SkinnedBody:
        """The body of a state, whose shape directions are those of its subjects."""
        objective = self.objective(InMemory(state.vertices, self.scans.subject))
        model = PoseModel(state.estimate, objective, state.log)
        body, regressor = start_shape(model, Start.of(self.body), n_betas)
        card = coregistration_card(self.body.name, self.scans.subject, state.log)
        card["J_regressor_rms_mm"] = [round(1e3 * float(r), 4) for r in regressor.rms]
        return replace(body, name="coregistered", card=card)

    def seen(self, state: State) -> Array:
        """(J, N) from 0 to 1, how surely the scans say where each vertex is.

        It is about 1 where a surface was scanned: a scan is sure across its surface, and not along.
        """
        return np.asarray(np.trace(state.confidence, axis1=2, axis2=3).clip(0, 1))

    def run(
        self,
        fits: Sequence[Fitted],
        *,
        folder: Path | None = None,
        execution: Execution = SERIAL,
    ) -> State:
        """Carry out the plan from fits of the body to every scan.

        With a `folder`, the state is written there after every block, and the same call continues
        from there, to the last bit as if nothing had happened. Raises NotLowered if a block raises
        the joint cost, BadFile if the folder holds a checkpoint of something else, and
        KeyboardInterrupt after Ctrl-C, when the checkpoint of the last block is on disk.
        """
        first = self.first(fits)
        digest = fingerprint(self.scans, first, self.plan) if folder else ""
        steps = [*("registrations", "model") * self.plan.rounds, "registrations"]

        def measured(state: State) -> State:
            return self._with(state, self._on_scans(state, execution))

        with limited_threads():
            return in_turn(
                first, measured, steps, self.costs, self._step, folder, digest, execution
            )

    def _step(
        self, state: State, block: str, cost: float, execution: Execution
    ) -> tuple[State, dict[str, float]]:
        if block == "registrations":
            return self._with(state, self._on_scans(state, execution, solve=True)), {}
        return self._model(state, cost, execution)

    def _model(
        self, state: State, cost: float, execution: Execution
    ) -> tuple[State, dict[str, float]]:
        """The step of the model, as much of it as lowers the joint cost."""
        observations = InMemory(state.targets, self.scans.subject, state.confidence)
        objective = self.objective(observations)
        moved = state.estimate
        for name in self.plan.blocks:
            task = replace(execution, task=f"model, {name}")
            context = BlockInput(objective, self.body.faces, self.plan.options, task)
            moved, _ = BLOCKS[name](context, moved)

        def part(share: float) -> State:
            tried = self._moved(state, objective, _between(state.estimate, moved, share))
            return self._with(tried, self._on_scans(tried, execution))

        return lowered(state, part, self.costs, cost, SHARES)

    def _moved(self, state: State, objective: Objective, estimate: Estimate) -> State:
        """The state with another model, and the registrations that belong to it."""
        batch = objective.registrations.read(slice(0, len(self.scans.subject)))
        posed = _posed(objective, estimate)
        _, trans = centred(batch, batch.vertices - posed)
        model = posed + trans[:, None]
        vertices = model + trusted(batch, batch.vertices - model)  # what E_S and E_C want together
        return replace(state, estimate=estimate, trans=trans, vertices=vertices)

    def _on_scans(self, state: State, execution: Execution, solve: bool = False) -> list[OnScan]:
        plan = self.plan
        whole = area(self.body.template, self.body.faces)
        coupled = ScanCoupling(self.body.faces, whole, plan.sigmas.data, plan.term)
        batches = jobs(state.estimate, self.scans.subject, state.vertices, state.trans)
        work = partial(on_scans, coupled, self.scans, solve)
        scans: list[OnScan] = []
        for some in execution.executor(work, batches):
            scans += some
            execution.finished(len(scans), len(self.scans.subject))
        return scans

    def _with(self, state: State, scans: Sequence[OnScan]) -> State:
        """The state with what was found on every scan."""
        stacked: dict[str, Any] = {
            name: np.array([getattr(scan, name) for scan in scans]) for name in STORED
        }
        poses = np.array([scan.pose for scan in scans])
        return replace(state, estimate=replace(state.estimate, poses=poses), **stacked)


def in_turn(
    first: AnyState,
    measured: Callable[[AnyState], AnyState],
    steps: Sequence[str],
    costs: Callable[[AnyState], dict[str, float]],
    step: Callable[[AnyState, str, float, Execution], tuple[AnyState, dict[str, float]]],
    folder: Path | None,
    digest: str,
    execution: Execution,
) -> AnyState:
    """The blocks in turn, from the first state, `measured`, or from the checkpoint in the folder.

    Each block is written into the state's log, and the state into the folder. `step` is given the
    state, the block's name and the joint cost. Raises NotLowered if a block raises that cost, and
    KeyboardInterrupt between two blocks.
    """
    stored = read_state(folder, digest, first) if folder else None
    state: AnyState = measured(first) if stored is None else stored
    keep = Keeping()
    started, already = time.perf_counter(), len(state.log)
    with Interrupts() as interrupts:
        for number, block in enumerate(steps[already:], start=already + 1):
            interrupts.check()
            began, before = time.perf_counter(), costs(state)
            task = replace(execution, task=block)
            moved, facts = step(state, block, sum(before.values()), task)
            entry = LogEntry(block, before, costs(moved), facts, time.perf_counter() - began)
            entry.check_lowered()
            state = replace(moved, log=(*state.log, entry))
            if folder:
                keep(partial(save_state, state, folder, digest))
            execution.report.block(Progress.since(started, already, number, len(steps), entry))
    return state


def lowered(
    state: AnyState,
    part: Callable[[float], AnyState],
    costs: Callable[[AnyState], dict[str, float]],
    cost: float,
    shares: Sequence[float],
) -> tuple[AnyState, dict[str, float]]:
    """The state after the first share of a step that lowers the joint cost, and that share."""
    for share in shares:
        tried = part(share)
        if sum(costs(tried).values()) < cost:
            return tried, {"share": share}
    return state, {"share": 0.0}


def _posed(objective: Objective, estimate: Estimate) -> Array:
    """The models (J, N, 3) m of all scans, before translation."""
    return np.concatenate([passed.points for passed, _, _ in objective.residuals(estimate)])


def _between(before: Estimate, after: Estimate, share: float) -> Estimate:
    """A share of the way from one model to another; poses are those of the latter."""
    if share == 1:
        return after
    names = ("templates", "joints", "posedirs", "weights", "regressor")
    ends = {name: (getattr(before, name), getattr(after, name)) for name in names}
    return replace(after, **{n: (1 - share) * a + share * b for n, (a, b) in ends.items()})
