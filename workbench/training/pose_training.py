"""Training of all that has to do with pose: {templates, joints, posedirs, weights, poses}.

From registrations of some people in many poses, by an alternation of blocks (SMPL, section 4.1;
Body Models II). What was published were the equations; the code was not.
"""

import time
from dataclasses import dataclass, replace
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.errors import BadFile, WorkbenchError
from workbench.threads import limited_threads
from workbench.training.blocks import BLOCKS, MAY_RISE, Effort
from workbench.training.checkpoint import Checkpoint, Entry, fingerprint, read_checkpoint
from workbench.training.crew import Crew, Hands, alone
from workbench.training.estimate import Estimate
from workbench.training.first_guess import Start
from workbench.training.mirror import Mirror
from workbench.training.noticing import noticed
from workbench.training.objective import Objective
from workbench.training.plan import Plan
from workbench.training.poses import Compared, OnEdges, fitted_poses, segments_turned
from workbench.training.registrations import Batch, Registrations, batches, held
from workbench.training.rotation_centres import joint_guess, means_at
from workbench.training.thinning import thinned
from workbench.writing import Keeping

Array = NDArray[np.float64]
ROUNDING = 1e-9  # of the cost: what a block may add by rounding
KKT = 1e-8  # the conditions of the weights hold to this
FIRST_STEPS = 5  # of the first fit of a pose
FIRST_SIGMA = 0.005  # m, of an edge on a template of somebody else


class NotLowered(WorkbenchError):
    """A block of training raised the cost, or did not solve what it claims to solve."""


@dataclass(frozen=True, eq=False)
class Progress:
    """What a run says after a block."""

    number: int  # of this block, from 1
    of: int
    entry: Entry
    seconds_left: float


@dataclass(frozen=True, eq=False)
class PoseModel:
    """What was found, the objective it was found under, and how."""

    estimate: Estimate
    objective: Objective
    log: tuple[Entry, ...]


class Report(Protocol):
    """Who is told how a run goes."""

    def block(self, progress: Progress) -> None:
        """A block has ended."""

    def part(self, doing: str, done: int, of: int) -> None:
        """One more of many small things, within something long."""


class Silent:
    """Tells nobody."""

    def block(self, progress: Progress) -> None:
        """Nothing."""

    def part(self, doing: str, done: int, of: int) -> None:
        """Nothing."""


SILENT = Silent()


def train_poses(
    registrations: Registrations,
    start: Start,
    plan: Plan,
    *,
    folder: Path | None = None,
    report: Report = SILENT,
    compared: Compared | None = None,
    crew: Crew = alone,
    begun: Estimate | None = None,
    sides: Mirror | None = None,
) -> PoseModel:
    """Run a plan, from a start that knows a template, a tree and segments only, or as `begun`.

    With a `folder` the run is on disk after every block and goes on from there when called
    again; the end is the same to the last bit. What cannot be written there is told in the log
    once, and the run goes on. First poses are fitted to edges, or as `compared`
    says. Raises NotLowered if a block raises the cost: every block is checked as it ends; BadFile
    if there is no such folder, or it holds another training's checkpoint.
    """
    if folder is not None and not folder.is_dir():
        raise BadFile(f"cannot keep a checkpoint in {folder}: there is no such folder; make it")
    keep = Keeping()
    registrations = held(registrations)
    weights = start.weights()
    sides = start.mirror() if sides is None else sides
    if begun is None:
        rings = joint_guess(start, weights, registrations)
        first = first_estimate(registrations, start, weights=weights, rings=rings)
    else:
        rings, first = means_at(start.template, begun.joints.mean(axis=0)), begun
    near = None if plan.reach is None else noticed(first.weights, start.parents, plan.reach)
    if near is not None:
        first = replace(first, posedirs=first.posedirs * near[:, None])
    fixed = [start.template, start.faces, start.segmentation]
    if sides is not None:
        fixed += [sides.vertices, sides.joints]
    mark = fingerprint(registrations, first, plan, *fixed)
    steps = plan.steps
    known = read_checkpoint(folder, mark, first, [b for _, b in steps]) if folder else None
    with limited_threads():
        if known is None:
            if begun is None:
                first = first_poses(first, registrations, start, compared, report, crew)
            known = Checkpoint(first, (), mark)
            if folder:
                keep(partial(known.save, folder))
        sigmas = steps[0][0].sigmas
        objective = Objective(registrations, rings, weights, sides, sigmas, start.template, near)
        began, already = time.perf_counter(), len(known.log)
        for number in range(already, len(steps)):
            stage, block = steps[number]
            objective = objective.with_sigmas(stage.sigmas)
            known = _carried_out(objective, known, block, start, stage.effort, report, crew)
            if folder:
                keep(partial(known.save, folder))
            each = (time.perf_counter() - began) / (number + 1 - already)
            left = each * (len(steps) - number - 1)
            report.block(Progress(number + 1, len(steps), known.log[-1], left))
    return PoseModel(known.estimate, objective.with_sigmas(steps[-1][0].sigmas), known.log)


def _carried_out(
    objective: Objective,
    known: Checkpoint,
    block: str,
    start: Start,
    effort: Effort,
    report: Report,
    crew: Crew,
) -> Checkpoint:
    began = time.perf_counter()
    before = objective.costs(known.estimate)
    hands = Hands(crew, partial(report.part, block))
    found = BLOCKS[block](objective, known.estimate, start.faces, effort, hands)
    after = objective.costs(found.estimate)
    total, was = sum(after.values()), sum(before.values())
    lowered = total <= was + ROUNDING * (1 + was) or block in MAY_RISE
    if not (isfinite(total) and lowered):
        raise NotLowered(f"block {block!r} raised the cost from {was:.9g} to {total:.9g}")
    if found.facts.get("kkt", 0.0) > KKT:
        raise NotLowered(
            f"block {block!r} left weights with a KKT residual of {found.facts['kkt']:.1e}, "
            f"above {KKT:g}"
        )
    entry = Entry(block, before, after, found.facts, time.perf_counter() - began)
    return replace(known, estimate=found.estimate, log=(*known.log, entry))


def first_estimate(
    registrations: Registrations, start: Start, *, weights: Array, rings: csr_array
) -> Estimate:
    """Everybody is the template, unbent."""
    S = int(registrations.subject.max()) + 1
    K, N = len(start.parents), len(start.template)
    return Estimate(
        templates=np.repeat(start.template[None], S, axis=0),
        joints=np.repeat((rings @ start.template)[None], S, axis=0),
        posedirs=np.zeros((N, 3, 9 * (K - 1))),
        weights=weights,
        poses=np.zeros((len(registrations.subject), K, 3)),
        parents=start.parents,
    )


def first_poses(
    first: Estimate,
    registrations: Registrations,
    start: Start,
    compared: Compared | None = None,
    report: Report = SILENT,
    crew: Crew = alone,
) -> Estimate:
    """Poses by turning each segment onto its vertices, then on edges, the template being alike.

    Edges do not say where the body stands, and tell a bent knee from a long shin better than
    vertices do.
    """
    few = thinned(start.template, start.faces)
    registrations, sparse = few.registrations(registrations), few.estimate(first)
    poses = first.poses.copy()
    for batch in batches(registrations):
        for at in range(len(batch.subject)):
            poses[batch.some.start + at] = segments_turned(
                start.template[few.vertices],
                sparse.weights,
                start.parents,
                batch.vertices[at],
                batch.seen[at],
            )
    data = OnEdges(few.faces) if compared is None else compared.on(few.faces)
    one = replace(sparse, poses=poses, templates=sparse.templates[:1], joints=first.joints[:1])
    alike = AsOneSubject(registrations)
    hands = Hands(crew, partial(report.part, "first poses"))
    found = fitted_poses(one, alike, few.faces, data, FIRST_SIGMA, FIRST_STEPS, hands)
    return replace(first, poses=found.poses)


@dataclass(frozen=True, eq=False)
class AsOneSubject:
    """Registrations as if all were of one person."""

    of: Registrations

    @property
    def subject(self) -> NDArray[np.int64]:
        """Zeros."""
        return np.zeros(len(self.of.subject), dtype=np.int64)

    @property
    def n_vertices(self) -> int:
        """N."""
        return self.of.n_vertices

    def read(self, some: slice) -> Batch:
        """The same meshes."""
        batch = self.of.read(some)
        return replace(batch, subject=np.zeros_like(batch.subject))
