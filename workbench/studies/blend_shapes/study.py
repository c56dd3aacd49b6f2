"""The study of predictors of blend shapes, from seeds: `predictor_study(PredictorPlan())`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.priors.recordings import held_out_poses
from workbench.studies.blend_shapes import questions
from workbench.studies.blend_shapes.predictors import Result, accuracy, fit_predictors, ranked
from workbench.studies.blend_shapes.questions import ByExamples, ByPenalty
from workbench.studies.blend_shapes.training_data import PosedSurfaces, TrainingData
from workbench.studies.pages import Report
from workbench.synthetic.teacher import body_on_teachers_rig, teacher_of

EXAMPLE_COUNTS = (25, 50, 100, 200, 400, 800)
EVERY = 4  # of the test poses: where many predictors are tested, only every fourth is used
TURNED = "neck"  # the joint of the lecture's demonstration
RECORDED = (
    "real poses: every good frame of whole clips of motion capture that neither the pose prior nor "
    "any predictor was learned from, the pelvis unturned"
)
DRAWN = (
    "further draws from the shipped pose prior, which is a Gaussian: they are like the training "
    "poses, and errors are smaller than on real poses"
)


@dataclass(frozen=True)
class PredictorPlan:
    """How many poses of each kind the study takes.

    Raises BadArgument for counts with which it cannot be carried out.

    Attributes:
        body: `default` or `small`.
        training: poses to fit to, drawn from the pose prior.
        validation: further draws, on which ridges and kernel widths are chosen.
        test: draws once more, if there is no recording.
        examples: training poses between which two of the predictors interpolate.
        seed: of every draw.
    """

    body: str = "default"
    training: int = 1500
    validation: int = 200
    test: int = 400
    examples: int = 800
    seed: int = 0

    def __post_init__(self) -> None:
        if not 10 <= self.examples <= self.training:
            raise BadArgument(
                f"{self.examples} examples cannot be taken from {self.training} training poses; "
                "take at least 10 and at most as many as there are"
            )
        if min(self.validation, self.test) < 20:
            raise BadArgument("validation and test need at least 20 poses each")


@dataclass(frozen=True, eq=False)
class PredictorStudy:
    """All that was measured; distances are to the teacher's vertices.

    Attributes:
        plan: what was asked for.
        test: which poses were tested on, in a sentence.
        n_test: how many these were.
        results: of every predictor, the best first.
        by_examples: see `questions.by_examples`, and likewise for the others.
        by_factor: name -> (FACTORS,) mm.
        by_angle: name -> (TURNS,) mm.
        by_distance_penalty: a row for each penalty.
        by_group_penalty: a row for each penalty.
    """

    plan: PredictorPlan
    test: str
    n_test: int
    results: tuple[Result, ...]
    by_examples: tuple[ByExamples, ...]
    by_factor: Mapping[str, Array]
    by_angle: Mapping[str, Array]
    by_distance_penalty: tuple[ByPenalty, ...]
    by_group_penalty: tuple[ByPenalty, ...]


def predictor_study(plan: PredictorPlan, mocap: Path | None, report: Report) -> PredictorStudy:
    """Fit every predictor to the same data and test them on the held-out clips of `mocap`.

    Without a recording they are tested on further draws of the pose prior. Raises BadFile for a
    body without a teacher, or a file that is no recording.
    """
    body, prior = load_skinned(plan.body), shipped_gaussian()
    teacher, linear = teacher_of(body), body_on_teachers_rig(body)
    rng = np.random.default_rng(plan.seed)
    training, validation, test = (
        draw_poses(prior, n, rng) for n in (plan.training, plan.validation, plan.test)
    )
    if mocap is not None:
        test = held_out_poses(mocap)
    report(f"the teacher poses {len(training) + len(validation) + len(test)} times")
    data = TrainingData(
        linear, PosedSurfaces.of(teacher, training), PosedSurfaces.of(teacher, validation)
    )
    tested = PosedSurfaces.of(teacher, test)
    results = [
        Result(predictor.name, predictor.parameters, accuracy(predictor.body, tested))
        for predictor in fit_predictors(data, plan.examples, report)
    ]
    report("computing the correctives for further questions")
    wanted = data.correctives(linear)
    fewer = tested.some(slice(None, None, EVERY))
    report("accuracy and time by the number of examples")
    counts = [n for n in EXAMPLE_COUNTS if n < plan.examples] + [plan.examples]
    by_examples = questions.by_examples(data, wanted, fewer, counts, report)
    report("poses that are exaggerated, and a neck that turns")
    by_factor = questions.by_factor(data, wanted, plan.examples)
    by_angle = questions.by_angle(data, wanted, TURNED)
    report("blend shapes near their joints")
    by_distance = questions.by_distance_penalty(data, wanted, fewer, report)
    report("sparse blend shapes")
    by_group = questions.by_group_penalty(data, wanted, fewer, report)
    return PredictorStudy(
        plan,
        DRAWN if mocap is None else RECORDED,
        len(tested),
        tuple(ranked(results)),
        tuple(by_examples),
        by_factor,
        by_angle,
        tuple(by_distance),
        tuple(by_group),
    )
