"""Coregistration: registrations, poses, templates and the model that couples them, in turn.

The joint cost of J scans of S people is, for registrations V_j and a model M,

    E = sum_j [ E_S(scan_j; V_j) + |V_j - M_s(j)(pose_j)|^2 / (2 sigma_C^2) + E_pose(pose_j) ]
        + E_T(templates) + E_J + E_P + E_W

(Hirshberg, Loper, Rachlin and Black, Coregistration, ECCV 2012; Pons-Moll, Virtual Humans 5.1).
With V held, this is the objective of training, and with the model held every scan is a
registration of its own. `softness` says why the model's blocks take scans as soft observations,
and `template_prior` why templates are held by edges.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_gaussian
from workbench.geometry.solids import area
from workbench.interrupts import Interrupts
from workbench.registration.coregistration.plan import CoregistrationPlan
from workbench.registration.coregistration.scan_block import (
    OnScan,
    Pull,
    Scans,
    Work,
    jobs,
    measured,
    registered,
)
from workbench.registration.coregistration.state import State, fingerprint, read_state
from workbench.threads import limited_threads
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.estimate import Estimate
from workbench.training.execution import SERIAL, Execution, LogEntry, Progress
from workbench.training.first_guess import Start
from workbench.training.objective import Objective, centred, trusted
from workbench.training.pose_training import PoseModel
from workbench.training.priors import PosePrior, smooth_prior
from workbench.training.registrations import InMemory
from workbench.training.shape_training import start_shape
from workbench.writing import Keeping

SHARES = (1.0, 0.5, 0.25, 0.1)  # of the model's step, until the joint cost falls


@dataclass(frozen=True, eq=False)
class Fitted:
    """A body fitted to one scan, from which coregistration starts.

    Attributes:
        pose: (K, 3) rad.
        betas: (B,).
        trans: (3,) m.
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

    Attributes:
        body: whose template has the topology of the registrations, and from which the model starts.
        scans: where the scans are read from.
        plan: what is done.
    """

    body: SkinnedBody
    scans: Scans
    plan: CoregistrationPlan = CoregistrationPlan()  # noqa: RUF009 - it is immutable

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
        freedom = None
        if plan.edges is not None:
            freedom = smooth_prior(body.faces, body.shapedirs, plan.edges, plan.bends)
        return Objective(
            registrations,
            body.J_regressor,
            body.weights,
            None,
            plan.sigmas,
            body.template,
            freedom=freedom,
            first_posedirs=body.posedirs,
            pose_prior=PosePrior.of(*pose_gaussian(body)),
        )

    def costs(self, state: State) -> dict[str, float]:
        """The joint cost of a state, by term."""
        data = InMemory(state.vertices, self.scans.subject)
        found = self.objective(data).costs(state.estimate)
        return {"E_S": float(state.scan_costs.sum()), "E_C": found.pop("E_D")} | found

    def first(self, fits: Sequence[Fitted]) -> State:
        """The state that begins: every subject has the median of the betas of its scans."""
        body, subject = self.body, self.scans.subject
        each = median_betas(fits, subject)
        templates = np.stack([body.template + body.shapedirs @ one for one in each])
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
        card = {
            "coregistered_from": {
                "scans": len(self.scans.subject),
                "subjects": len(state.estimate.templates),
                "starting_body": self.body.name,
            },
            "final_costs": {k: float(f"{v:.6g}") for k, v in state.log[-1].after.items()},
            "J_regressor_rms_mm": [round(1e3 * float(r), 4) for r in regressor.rms],
        }
        return replace(body, name="coregistered", card=card)

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
        identity, keep = "", Keeping()
        state = None
        if folder is not None:
            identity = fingerprint(self.scans, first, self.plan.written())
            state = read_state(folder, identity, first)
        with limited_threads(), Interrupts() as interrupts:
            if state is None:
                state = self._with(first, self._on_scans(measured, first, execution))
            steps = [*("registrations", "model") * self.plan.rounds, "registrations"]
            began, already = time.perf_counter(), len(state.log)
            for number in range(already, len(steps)):
                interrupts.check()
                state = self._after(state, steps[number], execution)
                if folder is not None:
                    keep(partial(state.save, folder, identity))
                ended = Progress.since(began, already, number + 1, len(steps), state.log[-1])
                execution.report.block(ended)
        return state

    def _after(self, state: State, block: str, execution: Execution) -> State:
        began, before = time.perf_counter(), self.costs(state)
        facts: dict[str, float] = {}
        execution = replace(execution, task=block)
        if block == "registrations":
            found = self._with(state, self._on_scans(registered, state, execution))
        else:
            found, facts = self._model(state, sum(before.values()), execution)
        entry = LogEntry(block, before, self.costs(found), facts, time.perf_counter() - began)
        entry.check_lowered()
        return replace(found, log=(*state.log, entry))

    def _model(
        self, state: State, cost: float, execution: Execution
    ) -> tuple[State, dict[str, float]]:
        """The step of the model, as much of it as lowers the joint cost."""
        objective = self.objective(self.plan.observe(state, self.scans.subject))
        moved = state.estimate
        for name in self.plan.blocks:
            part = replace(execution, task=f"model, {name}")
            given = BlockInput(objective, self.body.faces, self.plan.options, part)
            moved = BLOCKS[name](given, moved).estimate
        for share in SHARES:
            tried = self._moved(state, objective, _between(state.estimate, moved, share))
            found = self._with(tried, self._on_scans(measured, tried, execution))
            if sum(self.costs(found).values()) < cost:
                return found, {"share": share}
        return state, {"share": 0.0}

    def _moved(self, state: State, objective: Objective, estimate: Estimate) -> State:
        """The state with another model, and the registrations that belong to it."""
        batch = objective.registrations.read(slice(0, len(self.scans.subject)))
        posed = _posed(objective, estimate)
        _, trans = centred(batch, batch.vertices - posed)
        there = posed + trans[:, None]
        vertices = there + trusted(batch, batch.vertices - there)  # what E_S and E_C want together
        return replace(state, estimate=estimate, trans=trans, vertices=vertices)

    def _on_scans(self, work: Work, state: State, execution: Execution) -> list[OnScan]:
        plan = self.plan
        whole = area(self.body.template, self.body.faces)
        pull = Pull(self.body.faces, whole, plan.sigmas.data, plan.terms)
        todo = jobs(state.estimate, self.scans.subject, state.vertices, state.trans)
        found: list[OnScan] = []
        for some in execution.executor(partial(work, pull, self.scans), todo):
            found += some
            execution.finished(len(found), len(self.scans.subject))
        return found

    def _with(self, state: State, found: Iterable[OnScan]) -> State:
        """The state with what was found on every scan."""
        each = list(found)
        poses = np.stack([one.pose for one in each])
        return replace(
            state,
            estimate=replace(state.estimate, poses=poses),
            vertices=np.stack([one.vertices for one in each]),
            trans=np.stack([one.trans for one in each]),
            targets=np.stack([one.pulled.targets for one in each]),
            confidence=np.stack([one.pulled.confidence for one in each]),
            scan_costs=np.array([one.scan_cost for one in each]),
        )


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
