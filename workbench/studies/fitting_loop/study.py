"""The loop: the fits that were best so far teach a regressor, whose answers start the next fits.

SPIN (Kolotouros et al., Learning to Reconstruct 3D Human Pose and Shape via Model-fitting in the
Loop, 2019) keeps, for every image, the best fit that it ever had, and replaces it by one of lower
cost. Here the regressor sees keypoints instead of photographs, and is trained anew in each round.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.experiments.photographed import Shot
from workbench.fitting.pose_regressor import PoseRegressor, shipped_regressor
from workbench.fitting.regressor_training import people_in, trained
from workbench.studies.fitting_loop.people import Fitting, drawn_shots
from workbench.studies.pages import Report

FAILED = 150.0  # mm
REST, SHIPPED, TRUTH = "begun at rest", "begun by the shipped regressor", "begun at the truth"


@dataclass(frozen=True)
class LoopPlan:
    """What the study asks. Raises BadArgument for a plan that nothing can be learned from.

    Attributes:
        images: of the loop.
        held_out: images of other people, which the loop never sees.
        rounds: of learning and fitting.
        views: how many cameras, with other betas, a kept pose is seen by in a pass of training.
        passes: of training in each round.
        hidden: numbers in each of the two hidden layers of the regressor.
        noise: of a keypoint, in px.
        body: that is fitted, and that the people are made of.
        seed: of every draw.
    """

    images: int = 120
    held_out: int = 60
    rounds: int = 3
    views: int = 60
    passes: int = 20
    hidden: int = 128
    noise: float = 5.0
    body: str = "default"
    seed: int = 42

    def __post_init__(self) -> None:
        for name in ("images", "held_out", "rounds", "views", "passes", "hidden"):
            if getattr(self, name) < 1:
                raise BadArgument(f"{name} is a number from 1 on, not {getattr(self, name)}")
        if not 0 <= self.noise < np.inf:
            raise BadArgument(f"noise is a number of px from 0 on, not {self.noise:g}")


@dataclass(frozen=True)
class Errors:
    """Errors of some bodies, in mm, one for each image."""

    each: tuple[float, ...]

    @property
    def mean(self) -> float:
        """The mean error over all images, in mm."""
        return float(np.mean(self.each))

    @property
    def failed(self) -> int:
        """The number of images whose error is above 150 mm."""
        return sum(one > FAILED for one in self.each)


@dataclass(frozen=True)
class Round:
    """What there is after a round.

    Attributes:
        number: of the round; after round 0 there are only fits that were begun at rest.
        kept: errors of the kept fits of the loop's images.
        cost: their mean cost.
        replaced: how many fits were replaced in this round.
        alone: errors of the regressor's own answers to held-out images; None in round 0.
        begun: errors of fits to held-out images that it begins; None in round 0.
    """

    number: int
    kept: Errors
    cost: float
    replaced: int
    alone: Errors | None
    begun: Errors | None


@dataclass(frozen=True)
class LoopStudy:
    """All that was measured.

    Attributes:
        plan: what was asked for.
        recorded: whether the poses are those of a recording.
        rounds: round 0 and those of the loop.
        others: errors of fits to held-out images that begin otherwise, by name.
        shipped_alone: errors of the shipped regressor's own answers to held-out images.
        best: errors on the loop's images of fits that begin at the truth.
    """

    plan: LoopPlan
    recorded: bool
    rounds: tuple[Round, ...]
    others: dict[str, Errors]
    shipped_alone: Errors
    best: Errors


def loop_study(plan: LoopPlan, mocap: Path | None, report: Report) -> LoopStudy:
    """Make the images, go round the loop, and measure. Raises NotSupported without scikit-learn."""
    rng = np.random.default_rng(plan.seed)
    fitting = Fitting(load_skinned(plan.body))
    counts = plan.images, plan.held_out
    shots, others = drawn_shots(fitting.body, counts, plan.noise, mocap, rng)
    report(f"fitting {plan.images} images from rest")
    kept = [fitting.fit(shot) for shot in shots]

    def measured(number: int, replaced: int, *of_held_out: Errors | None) -> Round:
        errors = _errors(fitting, shots, [values for values, _ in kept])
        return Round(number, errors, float(np.mean([c for _, c in kept])), replaced, *of_held_out)

    rounds = [measured(0, 0, None, None)]
    for number in range(1, plan.rounds + 1):
        report(f"round {number}: learning from the kept fits")
        regressor = _taught(plan, fitting.body, np.array([v["pose"] for v, _ in kept]), rng)
        report(f"round {number}: fitting from what was learned")
        replaced = 0
        for i, shot in enumerate(shots):
            found = fitting.fit(shot, fitting.regressed(shot, regressor))
            if found[1] < kept[i][1]:
                kept[i], replaced = found, replaced + 1
        rounds.append(measured(number, replaced, *_held_out(fitting, others, regressor)))
    report("fitting held-out images from other starts")
    alone, begun = _held_out(fitting, others, shipped_regressor())
    ways = {
        REST: _errors(fitting, others, [fitting.fit(shot)[0] for shot in others]),
        SHIPPED: begun,
        TRUTH: _from_truth(fitting, others),
    }
    best = _from_truth(fitting, shots)
    return LoopStudy(plan, mocap is not None, tuple(rounds), ways, alone, best)


def _taught(
    plan: LoopPlan, body: SkinnedBody, poses: Array, rng: np.random.Generator
) -> PoseRegressor:
    """A regressor that has learned from these poses (N, K, 3) rad alone."""
    upright = poses.copy()
    upright[:, 0] = 0.0
    people = people_in(body, np.repeat(upright, plan.views, axis=0), rng)
    hidden = (plan.hidden, plan.hidden)
    return trained(body, people, plan.passes, hidden, rng, lambda done, loss: None)


def _held_out(
    fitting: Fitting, others: list[Shot], regressor: PoseRegressor
) -> tuple[Errors, Errors]:
    """Errors of a regressor's own answers, and of the fits that they begin."""
    starts = [fitting.regressed(shot, regressor) for shot in others]
    ends = [fitting.fit(shot, start)[0] for shot, start in zip(others, starts, strict=True)]
    return _errors(fitting, others, starts), _errors(fitting, others, ends)


def _from_truth(fitting: Fitting, shots: list[Shot]) -> Errors:
    return _errors(fitting, shots, [fitting.fit(shot, shot.truth)[0] for shot in shots])


def _errors(fitting: Fitting, shots: list[Shot], found: list[Values]) -> Errors:
    return Errors(tuple(map(fitting.error, found, shots)))
