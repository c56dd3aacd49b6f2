"""What was found on one mesh, carried over to another mesh of the same people in the same poses.

Poses and joints are the people's, not the mesh's. Templates, blend shapes and weights are read
off between the coarse mesh's vertices, and are a first guess there.
"""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.geometry.closest_points import read_off
from workbench.training.crew import Crew, alone
from workbench.training.estimate import Estimate
from workbench.training.first_guess import MOST_WEIGHTS, Start, at_most
from workbench.training.plan import NO_LIMIT, Plan, Stage, alternation
from workbench.training.pose_training import SILENT, PoseModel, Report, train_poses
from workbench.training.registrations import Registrations, held
from workbench.training.thinning import thinned

LOG = logging.getLogger(__name__)
Array = NDArray[np.float64]
COARSE = 1500  # vertices that are enough for a body with 24 joints


def carried_over(found: Estimate, on: Start, to: Start) -> Estimate:
    """`found` on the mesh of `on`, as a first guess on the mesh of `to`; both templates agree.

    What subjects differ in from the template is read off as well, so that fine detail of the new
    template stays.
    """
    between = read_off(on.template, on.faces, to.template)
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
    report: Report = SILENT,
    crew: Crew = alone,
    coarse: int = COARSE,
) -> PoseModel:
    """`train_poses` on at most `coarse` vertices, carried over to all of them and finished there.

    The end is under the sigmas and with the effort of the plan's last stage. A mesh of so many
    vertices or fewer is trained at once, and so is one with a segment that few vertices miss.
    """
    N = len(start.template)
    if coarse >= N:
        return train_poses(registrations, start, plan, folder=folder, report=report, crew=crew)
    sides = start.mirror()
    few = thinned(start.template, start.faces, coarse, None if sides is None else sides.vertices)
    v = few.vertices
    if set(start.segmentation[v].tolist()) != set(start.segmentation.tolist()):
        return train_poses(registrations, start, plan, folder=folder, report=report, crew=crew)
    less = replace(
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
        few.registrations(held(registrations)), less, plan, folder=own, report=report, crew=crew,
        sides=None if sides is None else few.mirror(sides),
    )  # fmt: skip
    begun = carried_over(model.estimate, less, start)
    fine = train_poses(
        registrations, start, finishing(plan.stages[-1], plan.reach), folder=folder, report=report,
        crew=crew, begun=begun, sides=sides,
    )  # fmt: skip
    return replace(fine, log=(*model.log, *fine.log))


def finishing(last: Stage | None = None, reach: int | None = None) -> Plan:
    """For an estimate that was carried over: what every vertex is needed for, and poses once.

    Under the sigmas and with the effort of `last`, or of the end of `alternation`, but poses from
    every vertex: a finer mesh is finer in places, as at hands, which then count for more.
    """
    blocks = ("surfaces", "weights", "regressor", "poses", "surfaces")
    if last is None:
        last = alternation().stages[-1]
    effort = replace(last.effort, pose_vertices=NO_LIMIT)
    return Plan((Stage(last.sigmas, blocks, 1, effort),), reach)
