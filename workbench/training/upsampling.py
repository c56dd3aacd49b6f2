"""An estimate on one mesh as a first guess on another mesh of the same people in the same poses.

Poses and joints belong to the people, not to the mesh. Templates, blend shapes and weights are
interpolated between the vertices of the coarse mesh.
"""

import logging
from dataclasses import replace
from pathlib import Path

from workbench.geometry.surface_tree import barycentric_weights
from workbench.training.estimate import Estimate
from workbench.training.executor import SERIAL, Execution
from workbench.training.first_guess import MOST_WEIGHTS, Start, at_most
from workbench.training.plan import NO_LIMIT, Plan, Stage, alternation
from workbench.training.pose_training import PoseModel, train_poses
from workbench.training.registrations import Registrations, in_memory
from workbench.training.subsampling import subsample

LOG = logging.getLogger(__name__)
COARSE = 1500  # vertices that are enough for a body with 24 joints


def upsampled(found: Estimate, on: Start, to: Start) -> Estimate:
    """An estimate on the mesh of `on`, interpolated to the mesh of `to`; their templates agree.

    The differences of the subjects from the template are interpolated, and not the subjects, so
    that the new template keeps its fine detail.
    """
    between = barycentric_weights(on.template, on.faces, to.template)
    S, N = len(found.templates), len(to.template)
    away = (found.templates - on.template).transpose(1, 2, 0).reshape(len(on.template), -1)
    P = found.posedirs
    return replace(
        found,
        templates=to.template + (between @ away).reshape(N, 3, S).transpose(2, 0, 1),
        posedirs=(between @ P.reshape(len(P), -1)).reshape(N, 3, -1),
        weights=at_most(between @ found.weights, MOST_WEIGHTS),
        regressor=None,
    )


def train_coarse_first(
    registrations: Registrations,
    start: Start,
    plan: Plan,
    *,
    folder: Path | None = None,
    execution: Execution = SERIAL,
    coarse: int = COARSE,
) -> PoseModel:
    """Run `train_poses` on at most `coarse` vertices, and finish on all of them.

    The last blocks have the sigmas and options of the plan's last stage. A mesh that has no more
    vertices is trained at once, and so is one with a segment that the chosen vertices miss.
    """
    mirror = start.mirror()
    few = subsample(
        start.template, start.faces, coarse, None if mirror is None else mirror.vertices
    )
    v = few.vertices
    missed = set(start.segmentation.tolist()) - set(start.segmentation[v].tolist())
    if len(v) == len(start.template) or missed:
        return train_poses(registrations, start, plan, folder=folder, execution=execution)
    on_few = replace(
        start, template=start.template[v], faces=few.faces, segmentation=start.segmentation[v]
    )
    own = None if folder is None else folder / "coarse"
    if own is not None:
        try:
            own.mkdir(exist_ok=True)
        except OSError as error:
            LOG.warning("going on without a checkpoint of the coarse mesh: %s", error)
            own = None
    model = train_poses(
        few.registrations(in_memory(registrations)),
        on_few,
        plan,
        folder=own,
        execution=execution,
        mirror=None if mirror is None else few.mirror(mirror),
    )
    fine = train_poses(
        registrations,
        start,
        finishing(plan.stages[-1], plan.reach),
        folder=folder,
        execution=execution,
        initial=upsampled(model.estimate, on_few, start),
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
