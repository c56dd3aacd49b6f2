"""Training of all that has to do with pose: {templates, joints, posedirs, weights, poses}.

The input are registrations of some people in many poses; blocks of unknowns are optimised in turn
(Loper et al., SMPL, section 4.1; the lectures Body Models II). The equations are published, but
the code is not.

A large mesh is trained on some of its vertices first: poses and joints belong to the people, not to
the mesh, and templates, blend shapes and weights are interpolated between the coarse vertices.
"""

import logging
import time
from dataclasses import astuple, dataclass, replace
from functools import partial
from pathlib import Path

from workbench.errors import BadFile
from workbench.geometry.mirror import Mirror
from workbench.geometry.surface_tree import barycentric_weights
from workbench.threads import limited_threads
from workbench.training.blend_shapes import local_features
from workbench.training.blocks import BLOCKS, NO_LIMIT, BlockInput, Plan, Stage, alternation
from workbench.training.checkpoint import TrainingCheckpoint, fingerprint, read_checkpoint
from workbench.training.estimate import Estimate
from workbench.training.execution import SERIAL, Execution, LogEntry, NotLowered, Progress
from workbench.training.first_guess import (
    BORDER,
    Start,
    first_estimate,
    first_poses,
    joint_guess,
    means_at,
)
from workbench.training.objective import Objective
from workbench.training.registrations import Registrations, check_registrations, in_memory
from workbench.training.shares import MOST_WEIGHTS, at_most
from workbench.training.subsampling import subsample
from workbench.writing import Keeping

KKT_TOLERANCE = 1e-8  # the conditions of the weights hold to this
LOG = logging.getLogger(__name__)
COARSE_VERTICES = 1500  # vertices that are enough for a body with 24 joints


@dataclass(frozen=True, eq=False)
class PoseModel:
    """The result of pose training.

    Attributes:
        estimate: what was found.
        objective: the objective with the sigmas of the last stage.
        log: the blocks that ran, in order.
    """

    estimate: Estimate
    objective: Objective
    log: tuple[LogEntry, ...]


def train_poses(
    registrations: Registrations,
    start: Start,
    plan: Plan,
    *,
    folder: Path | None = None,
    execution: Execution = SERIAL,
    initial: Estimate | None = None,
    mirror: Mirror | None = None,
    border: float = BORDER,
) -> PoseModel:
    """Run a plan from a template, a tree and segments, or from an `initial` estimate.

    With a `folder`, the run is saved there after every block, and continues from there when it is
    called again; the result is the same to the last bit. If a checkpoint cannot be written, the
    log warns once and the run continues. The first poses are fitted to edges.
    `mirror` is that of `start` where it is not given. The first weights change over `border` metres
    between two segments: take less for a hand, whose bones are as short as a body's borders.

    Raises BadArgument for registrations that do not fit the start, NotLowered if a block raises
    the cost, which is checked after every block, and BadFile if there is no such folder, or it
    holds a checkpoint of another training.
    """
    check_registrations(registrations, len(start.template))
    if folder is not None and not folder.is_dir():
        raise BadFile(f"cannot keep a checkpoint in {folder}: there is no such folder; make it")
    keep = Keeping()
    registrations = in_memory(registrations)
    weights = start.weights(border)
    mirror = start.mirror() if mirror is None else mirror
    if initial is None:
        rings = joint_guess(start, weights, registrations)
        first = first_estimate(registrations, start, weights=weights, rings=rings)
    else:
        rings, first = means_at(start.template, initial.joints.mean(axis=0)), initial
    locality = None
    if plan.reach is not None:
        locality = local_features(first.weights, start.parents, plan.reach)
        first = replace(first, posedirs=first.posedirs * locality[:, None])
    fixed = [start.template, start.faces, start.segmentation]
    if mirror is not None:
        fixed += [mirror.vertices, mirror.joints]
    identity = fingerprint(registrations, first, astuple(plan), *fixed)
    steps = plan.steps
    state = read_checkpoint(folder, identity, first, [b for _, b in steps]) if folder else None
    with limited_threads():
        if state is None:
            if initial is None:
                first = first_poses(first, registrations, start, execution=execution)
            state = TrainingCheckpoint(first, (), identity)
            if folder:
                keep(partial(state.save, folder))
        sigmas = steps[0][0].sigmas
        objective = Objective(
            registrations, rings, weights, mirror, sigmas, start.template, locality
        )
        began, already = time.perf_counter(), len(state.log)
        for number in range(already, len(steps)):
            stage, block = steps[number]
            objective = replace(objective, sigmas=stage.sigmas)
            state = _after_block(objective, state, block, start, stage, execution)
            if folder:
                keep(partial(state.save, folder))
            ended = Progress.since(began, already, number + 1, len(steps), state.log[-1])
            execution.report.block(ended)
    return PoseModel(state.estimate, replace(objective, sigmas=steps[-1][0].sigmas), state.log)


def _after_block(
    objective: Objective,
    state: TrainingCheckpoint,
    block: str,
    start: Start,
    stage: Stage,
    execution: Execution,
) -> TrainingCheckpoint:
    began = time.perf_counter()
    before = objective.costs(state.estimate)
    context = BlockInput(objective, start.faces, stage.options, replace(execution, task=block))
    estimate, facts = BLOCKS[block](context, state.estimate)
    after = objective.costs(estimate)
    entry = LogEntry(block, before, after, facts, time.perf_counter() - began)
    entry.check_lowered()
    if (kkt := facts.get("kkt", 0.0)) > KKT_TOLERANCE:
        raise NotLowered(f"block {block!r} left weights with a KKT residual of {kkt:.1e}")
    return replace(state, estimate=estimate, log=(*state.log, entry))


def upsampled(estimate: Estimate, coarse: Start, fine: Start) -> Estimate:
    """An estimate on the mesh of `on`, interpolated to the mesh of `to`; their templates agree.

    The differences of the subjects from the template are interpolated, and not the subjects, so
    that the new template keeps its fine detail.
    """
    between = barycentric_weights(coarse.template, coarse.faces, fine.template)
    S, N = len(estimate.templates), len(fine.template)
    n, P = len(coarse.template), estimate.posedirs
    away = (estimate.templates - coarse.template).transpose(1, 2, 0).reshape(n, -1)
    return replace(
        estimate,
        templates=fine.template + (between @ away).reshape(N, 3, S).transpose(2, 0, 1),
        posedirs=(between @ P.reshape(n, -1)).reshape(N, 3, -1),
        weights=at_most(between @ estimate.weights, MOST_WEIGHTS),
        regressor=None,
    )


def train_coarse_first(
    registrations: Registrations,
    start: Start,
    plan: Plan,
    *,
    folder: Path | None = None,
    execution: Execution = SERIAL,
    coarse: int = COARSE_VERTICES,
) -> PoseModel:
    """Run `train_poses` on at most `coarse` vertices, and finish on all of them.

    The last blocks have the sigmas and options of the plan's last stage. A mesh that has no more
    vertices is trained at once, and so is one with a segment that the chosen vertices miss.
    """
    mirror = start.mirror()
    few = subsample(
        start.template, start.faces, coarse, None if mirror is None else mirror.vertices
    )
    vertices = few.vertices
    missed = set(start.segmentation.tolist()) - set(start.segmentation[vertices].tolist())
    if len(vertices) == len(start.template) or missed:
        return train_poses(registrations, start, plan, folder=folder, execution=execution)
    coarse_start = replace(
        start,
        template=start.template[vertices],
        faces=few.faces,
        segmentation=start.segmentation[vertices],
    )
    coarse_folder = None if folder is None else folder / "coarse"
    if coarse_folder is not None:
        try:
            coarse_folder.mkdir(exist_ok=True)
        except OSError as error:
            LOG.warning("going on without a checkpoint of the coarse mesh: %s", error)
            coarse_folder = None
    model = train_poses(
        few.registrations(in_memory(registrations)),
        coarse_start,
        plan,
        folder=coarse_folder,
        execution=execution,
        mirror=None if mirror is None else few.mirror(mirror),
    )
    fine = train_poses(
        registrations,
        start,
        finishing(plan.stages[-1], plan.reach),
        folder=folder,
        execution=execution,
        initial=upsampled(model.estimate, coarse_start, start),
        mirror=mirror,
    )
    return replace(fine, log=(*model.log, *fine.log))


def finishing(last: Stage | None = None, reach: int | None = None) -> Plan:
    """The plan for an estimate that was interpolated from a coarser mesh.

    It runs the blocks that need every vertex, and fits the poses once. Sigmas and options are
    those of `last`, or of the last stage of `alternation`; but poses are fitted to every vertex,
    because a finer mesh has more vertices in some places, such as the hands, which then count for
    more.
    """
    blocks = ("surfaces", "weights", "regressor", "poses", "surfaces")
    stage = alternation().stages[-1] if last is None else last
    options = replace(stage.options, pose_vertices=NO_LIMIT)
    return Plan((Stage(stage.sigmas, blocks, 1, options),), reach)
