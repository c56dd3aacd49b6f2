"""Training of all that has to do with pose: {templates, joints, posedirs, weights, poses}.

The input are registrations of some people in many poses; blocks of unknowns are optimised in turn
(Loper et al., SMPL, section 4.1; the lectures Body Models II). The equations are published, but
the code is not.
"""

import time
from dataclasses import astuple, dataclass, replace
from functools import partial
from math import isfinite
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadFile
from workbench.geometry.mirror import Mirror
from workbench.geometry.rigid import procrustes
from workbench.threads import limited_threads
from workbench.training.blocks import BLOCKS, MAY_RISE, BlockInput
from workbench.training.checkpoint import Checkpoint, fingerprint, read_checkpoint
from workbench.training.estimate import Estimate
from workbench.training.executor import SERIAL, Execution
from workbench.training.first_guess import BORDER, Start
from workbench.training.locality import local_features
from workbench.training.objective import Objective
from workbench.training.plan import Plan, Stage
from workbench.training.poses import DataTerm, EdgeTerm, fitted_poses, poses_of_segments
from workbench.training.progress import LogEntry, NotLowered, Progress
from workbench.training.registrations import Registrations, batches, check_registrations, in_memory
from workbench.training.simplex import shares
from workbench.training.subsampling import subsample
from workbench.writing import Keeping

KKT = 1e-8  # the conditions of the weights hold to this
FIRST_STEPS = 5  # of the first fit of a pose
FIRST_SIGMA = 0.005  # m, of an edge on a template of somebody else
FIT, RING = 0.01, 0.05  # m: how far a segment is from rigid, and a ring's middle from the joint
NEAREST = 80  # vertices that a joint is a mean of


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
    at = read_checkpoint(folder, identity, first, [b for _, b in steps]) if folder else None
    with limited_threads():
        if at is None:
            if initial is None:
                first = first_poses(first, registrations, start, None, execution)
            at = Checkpoint(first, (), identity)
            if folder:
                keep(partial(at.save, folder))
        sigmas = steps[0][0].sigmas
        objective = Objective(
            registrations, rings, weights, mirror, sigmas, start.template, locality
        )
        began, already = time.perf_counter(), len(at.log)
        for number in range(already, len(steps)):
            stage, block = steps[number]
            objective = replace(objective, sigmas=stage.sigmas)
            at = _after_block(objective, at, block, start, stage, execution)
            if folder:
                keep(partial(at.save, folder))
            ended = Progress.since(began, already, number + 1, len(steps), at.log[-1])
            execution.report.block(ended)
    return PoseModel(at.estimate, replace(objective, sigmas=steps[-1][0].sigmas), at.log)


def _after_block(
    objective: Objective,
    at: Checkpoint,
    block: str,
    start: Start,
    stage: Stage,
    execution: Execution,
) -> Checkpoint:
    began = time.perf_counter()
    before = objective.costs(at.estimate)
    given = BlockInput(objective, start.faces, stage.options, replace(execution, task=block))
    found = BLOCKS[block](given, at.estimate)
    after = objective.costs(found.estimate)
    entry = LogEntry(block, before, after, found.facts, time.perf_counter() - began)
    if block not in MAY_RISE or not isfinite(sum(after.values())):
        entry.check_lowered()
    if found.facts.get("kkt", 0.0) > KKT:
        raise NotLowered(
            f"block {block!r} left weights with a KKT residual of {found.facts['kkt']:.1e}, "
            f"above {KKT:g}"
        )
    return replace(at, estimate=found.estimate, log=(*at.log, entry))


def first_estimate(
    registrations: Registrations, start: Start, *, weights: Array, rings: csr_array
) -> Estimate:
    """The estimate in which every subject is the template, in the zero pose."""
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
    data_term: DataTerm | None = None,
    execution: Execution = SERIAL,
) -> Estimate:
    """Poses by turning each segment onto its vertices, then by fitting edges of the template.

    Edges ignore where the body stands, and distinguish a bent knee from a long shin better than
    vertices do.
    """
    few = subsample(start.template, start.faces)
    registrations, sparse = few.registrations(registrations), few.estimate(first)
    poses = first.poses.copy()
    template, weights = start.template[few.vertices], sparse.weights
    for batch in batches(registrations):
        for at, (V, confidence) in enumerate(zip(batch.vertices, batch.trust, strict=True)):
            guess = poses_of_segments(template, weights, start.parents, V, confidence)
            poses[batch.some.start + at] = guess
    term = EdgeTerm(few.faces) if data_term is None else data_term.on(few.faces)
    execution = replace(execution, task="first poses")
    turned = replace(sparse, poses=poses)
    found = fitted_poses(
        turned, registrations, few.faces, term, FIRST_SIGMA, FIRST_STEPS, execution
    )
    return replace(first, poses=found.poses)


@dataclass(frozen=True, eq=False)
class SegmentMotions:
    """The rigid motion of each segment of a template in each registration.

    Attributes:
        R: (J, K, 3, 3) the rotations.
        t: (J, K, 3) the translations in metres.
    """

    R: Array
    t: Array


def motions_of_segments(
    start: Start, weights: Array, registrations: Registrations
) -> SegmentMotions:
    """The motions that take each segment of the template to its vertices in each registration."""
    J, K = len(registrations.subject), len(start.parents)
    R, t = np.empty((J, K, 3, 3)), np.empty((J, K, 3))
    for batch in batches(registrations):
        for at, (V, confidence) in enumerate(zip(batch.vertices, batch.trust, strict=True)):
            for k, trusted in enumerate(weights.T * confidence + 1e-9 * confidence):
                motion = procrustes(start.template, V, trusted)
                R[batch.some.start + at, k], t[batch.some.start + at, k] = motion.R, motion.t
    return SegmentMotions(R, t)


def rotation_centres(
    motions: SegmentMotions, subject: Index, parents: tuple[int, ...], rings: Array
) -> Array:
    """Joints (K, 3) m on the template, as means over all subjects.

    `rings` (K, 3) m are the means of the joints' priors.
    """
    found = rings.copy()
    prior = (FIT / RING) * np.eye(6)
    for k, parent in enumerate(parents[1:], start=1):
        both = np.tile(rings[k], 2)
        centres = []
        for s in np.unique(subject):
            own = subject == s
            A = np.concatenate([motions.R[own, parent], -motions.R[own, k]], axis=2).reshape(-1, 6)
            gap = (motions.t[own, k] - motions.t[own, parent]).ravel() - A @ both
            step = np.linalg.solve(A.T @ A + prior.T @ prior, A.T @ gap)
            centres.append(rings[k] + step.reshape(2, 3).mean(axis=0))
        found[k] = np.mean(centres, axis=0)
    return found


def means_at(template: Array, points: Array) -> csr_array:
    """Rows (K, N) of shares, as even as possible, that give the points (K, 3) on the template.

    A point outside of the convex hull of the vertices nearest to it is approximated.
    """
    rows = np.zeros((len(points), len(template)))
    for k, point in enumerate(points):
        near = np.argsort(np.linalg.norm(template - point, axis=1), kind="stable")[:NEAREST]
        away = template[near] - point
        gram = away @ away.T + 1e-6 * np.eye(len(near))  # m^2: evenness decides among exact ones
        first = np.full(len(near), 1 / len(near))
        rows[k, near] = shares(gram, np.zeros(len(near)), first)
    return csr_array(rows)


def joint_guess(start: Start, weights: Array, registrations: Registrations) -> csr_array:
    """The first guess of the joint regressor (K, N), which E_J uses until one is learned."""
    middles = start.rings() @ start.template
    motions = motions_of_segments(start, weights, registrations)
    centres = rotation_centres(motions, registrations.subject, start.parents, middles)
    return means_at(start.template, centres)
