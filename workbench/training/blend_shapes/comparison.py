"""The one table and its studies, from seeds: `compare_blend_shapes(Plan())`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.training.blend_shapes import studies
from workbench.training.blend_shapes.contest import Result, School, contenders, measured, ranked
from workbench.training.blend_shapes.lesson import Lesson, Report
from workbench.training.embedded.fine_weights import pupil_of, teacher_of
from workbench.training.pose_prior import (
    FILE_NAME,
    PosePrior,
    draw_poses,
    read_mocap,
    read_pose_prior,
)

Array = NDArray[np.float64]
SIZES = (25, 50, 100, 200, 400, 800)
EVERY = 4  # of the test poses, in the studies
TURNED = "neck"  # the joint of the lecture's demonstration


@dataclass(frozen=True)
class Plan:
    """How many of everything, and the seed of every draw."""

    body: str = "default"
    lesson: int = 1500  # poses to learn from, drawn from the pose prior
    trial: int = 200  # more draws, to make choices on
    test: int = 400  # draws again, if there is no recording
    examples: int = 800  # of the lesson, for interpolation between examples
    seed: int = 0

    def __post_init__(self) -> None:
        if not 10 <= self.examples <= self.lesson:
            raise BadArgument(
                f"{self.examples} examples cannot be taken from a lesson of {self.lesson} poses; "
                "take at least 10 and at most as many as there are"
            )
        if min(self.trial, self.test) < 20:
            raise BadArgument("a trial and a test need at least 20 poses each")


@dataclass(frozen=True, eq=False)
class Comparison:
    """All that was measured; distances in mm to the teacher's vertices."""

    plan: Plan
    test: str  # which poses were tested on, in a sentence
    n_test: int
    results: tuple[Result, ...]  # the best first
    by_size: tuple[studies.OfSize, ...]
    by_reach: Mapping[str, Array]
    by_turn: Mapping[str, Array]
    by_distance: tuple[studies.OfPrice, ...]
    by_sparsity: tuple[studies.OfPrice, ...]


def compare_blend_shapes(plan: Plan, mocap: Path | None, report: Report) -> Comparison:
    """Teach every predictor the same, test them on whole clips of `mocap` that nothing has seen.

    Without a recording they are tested on further draws of the pose prior. Raises BadFile for a
    body without a teacher, or a file that is no recording.
    """
    body, prior = load_skinned(plan.body), shipped_prior()
    teacher, pupil = teacher_of(body), pupil_of(body)
    rng = np.random.default_rng(plan.seed)
    lesson, trial, others = (
        draw_poses(prior, n, rng) for n in (plan.lesson, plan.trial, plan.test)
    )
    unseen, said = (others, DRAWN) if mocap is None else (held_out(mocap), RECORDED)
    report(f"the teacher poses {len(lesson) + len(trial) + len(unseen)} times")
    school = School(pupil, Lesson.by(teacher, lesson), Lesson.by(teacher, trial))
    test = Lesson.by(teacher, unseen)
    results = [measured(c, test) for c in contenders(school, plan.examples, report)]
    report("un-posing for the studies")
    shapes = school.bulges(pupil)
    fewer = test.some(slice(None, None, EVERY))
    report("what examples cost")
    sizes = [n for n in SIZES if n < plan.examples] + [plan.examples]
    of_size = studies.by_size(school, shapes, fewer, sizes, report)
    report("beyond the examples")
    of_reach = studies.by_reach(school, shapes, plan.examples)
    of_turn = studies.by_turn(school, shapes, TURNED)
    report("near their joints")
    of_distance = studies.by_distance(school, shapes, fewer, report)
    report("few of them")
    of_sparsity = studies.by_sparsity(school, shapes, fewer, report)
    return Comparison(
        plan,
        said,
        len(test),
        tuple(ranked(results)),
        tuple(of_size),
        of_reach,
        of_turn,
        tuple(of_distance),
        tuple(of_sparsity),
    )


RECORDED = (
    "real poses: every good frame of whole clips of motion capture that neither the pose prior nor "
    "any predictor was learned from, the pelvis unturned"
)
DRAWN = (
    "further draws from the shipped pose prior, which is a Gaussian: they are as the poses of the "
    "lesson are, and errors are smaller than on real poses"
)


def held_out(mocap: Path) -> Array:
    """The good frames of every fifth clip, (F, 24, 3) rad, the pelvis unturned."""
    _, clips = read_mocap(mocap).split()
    poses = clips.poses.copy()
    poses[:, 0] = 0
    return poses


def shipped_prior() -> PosePrior:
    """The Gaussian of poses that comes with the workbench."""
    with as_file(files("workbench") / "data" / "poses" / FILE_NAME) as path:
        return read_pose_prior(path)
