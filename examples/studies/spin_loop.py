"""What is a loop of fitting and learning worth?

    python -m examples.studies.spin_loop [--mocap FILE] [--images 120] ...

SPIN (Kolotouros et al., Learning to Reconstruct 3D Human Pose and Shape via Model-fitting in the
Loop, 2019) keeps, for every image, the best fit that it ever had, replaces it by one of lower
cost, and teaches a regressor by the kept fits, which begins the next fits. Here the regressor sees
keypoints instead of photographs, and is trained anew in each round. The loop never sees a truth.
It needs scikit-learn and takes about a minute of one core. The last regressor is written as well.
"""

from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from builder.recordings import read_recording
from examples.studies.output import Report, arguments, report, write_study
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument, BadFile
from workbench.fitting.images import NEARLY, image_priors
from workbench.fitting.keypoints import KeypointProblem, keypoint_setup
from workbench.fitting.observations import LIMBS, SIDES, BadObservation
from workbench.fitting.placing import regressed_start
from workbench.fitting.pose_regressor import PoseRegressor, shipped_regressor
from workbench.lectures.material.photographs import Shot, made_up_shots
from workbench.lectures.material.regressor_training import (
    draw_facings,
    neural_networks,
    people_in,
    save_regressor,
    trained,
)
from workbench.plots.palette import FAINT, LINES, MARKERS
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.reports.page import Columns, Table
from workbench.residuals.kernels import geman_mcclure, scaled

SIGMA = 4.0  # px, of a keypoint in the fits
OUTLIER = 52.0  # px: 8 % of 650, the middle of the heights of people in the images


@dataclass(frozen=True, eq=False)
class Fitting:
    """Fits of one body to single images; all share one problem."""

    body: SkinnedBody

    @cached_property
    def problem(self) -> KeypointProblem:
        """Keypoints with Geman and McClure's kernel, and the priors of an image."""
        kernel = scaled(geman_mcclure, OUTLIER / SIGMA)
        return KeypointProblem(self.body, SIGMA, kernel, image_priors)

    def fit(self, shot: Shot, start: Values | None = None) -> tuple[Values, float]:
        """The body where a fit ends, and its cost. Without a start it begins at rest, where the
        torso was seen.
        """
        setup = keypoint_setup(self.problem, shot.observed, "")
        solution = NEARLY.solve(setup.problem, setup.start | (start or {}))
        found = setup.start | dict(solution.values)
        return {block.name: found[block.name] for block in self.body.blocks()}, solution.cost

    def regressed(self, shot: Shot, regressor: PoseRegressor) -> Values:
        """What a regressor makes of the keypoints; the body at rest, where the torso was seen, if
        it would be behind the camera, as that of a regressor may be that has learned little.
        """
        setup = keypoint_setup(self.problem, shot.observed, "")
        try:
            return regressed_start(regressor, self.body, setup.views[0], setup.start)
        except BadObservation:
            return {block.name: setup.start[block.name] for block in self.body.blocks()}

    def error(self, found: Values, shot: Shot) -> float:
        """The mean distance of 12 landmarks of the limbs from the truth, in mm, after the middles
        of the hips were brought together (MPJPE).
        """
        names = self.body.landmark_names("coco")
        rows = [names.index(f"{side}_{part}") for side in SIDES for part in LIMBS]
        hips = [names.index(f"{side}_hip") for side in SIDES]
        off = np.subtract(
            *(
                self.body.landmark("coco", *(at[block.name] for block in self.body.blocks()))
                for at in (found, shot.truth)
            )
        )
        return 1e3 * float(np.linalg.norm((off - off[hips].mean(axis=0))[rows], axis=1).mean())


def drawn_shots(
    body: SkinnedBody,
    counts: tuple[int, int],
    noise: float,
    mocap: Path | None,
    rng: np.random.Generator,
) -> tuple[list[Shot], list[Shot]]:
    """Images for the loop, and others that it never sees, so many of each.

    With a recording, people are in poses of its held-out clips, each clip being in one of the two
    sets; without one, in draws of the mixture of poses. Raises BadFile for a recording with fewer
    than two held-out clips, and as `read_recording` does.
    """
    if mocap is None:
        poses = draw_poses(shipped_mixture(), sum(counts), rng)
        sets = [poses[: counts[0]], poses[counts[0] :]]
    else:
        clips = read_recording(mocap).split()[1]
        numbers = np.unique(clips.clip)
        if len(numbers) < 2:
            raise BadFile(f"{mocap} holds fewer than two clips of which nothing was learned")
        sets = [
            _upright(clips.poses[np.isin(clips.clip, some)], count, rng)
            for some, count in zip((numbers[::2], numbers[1::2]), counts, strict=True)
        ]
    one, other = (
        made_up_shots(body, poses, draw_facings(len(poses), rng), rng, noise=noise)
        for poses in sets
    )
    return one, other


def _upright(poses: Array, count: int, rng: np.random.Generator) -> Array:
    """So many of the poses, whose pelvis is not turned: cameras are placed around the person."""
    chosen = poses[rng.choice(len(poses), count, replace=count > len(poses))]
    chosen[:, 0] = 0.0
    return chosen


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
        regressor: what the last round trained.
    """

    plan: LoopPlan
    recorded: bool
    rounds: tuple[Round, ...]
    others: dict[str, Errors]
    shipped_alone: Errors
    best: Errors
    regressor: PoseRegressor | None = None


def loop_study(plan: LoopPlan, mocap: Path | None, report: Report) -> LoopStudy:
    """Make the images, go round the loop, and measure. Raises NotSupported without scikit-learn."""
    neural_networks()  # before the first fits, which take most of the time
    rng = np.random.default_rng(plan.seed)
    fitting = Fitting(load_skinned(plan.body))
    counts = plan.images, plan.held_out
    shots, others = drawn_shots(fitting.body, counts, plan.noise, mocap, rng)
    report(f"fitting {plan.images} images from rest")
    kept = [fitting.fit(shot) for shot in shots]

    def measured(number: int, replaced: int, *of_held_out: Errors | None) -> Round:
        errors = _errors(fitting, shots, [values for values, _ in kept])
        return Round(number, errors, float(np.mean([c for _, c in kept])), replaced, *of_held_out)

    rounds, regressor = [measured(0, 0, None, None)], None
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
        TRUTH: _errors(fitting, others, [fitting.fit(s, s.truth)[0] for s in others]),
    }
    best = _errors(fitting, shots, [fitting.fit(s, s.truth)[0] for s in shots])
    return LoopStudy(plan, mocap is not None, tuple(rounds), ways, alone, best, regressor)


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


def _errors(fitting: Fitting, shots: list[Shot], found: list[Values]) -> Errors:
    return Errors(tuple(map(fitting.error, found, shots)))


def plot_rounds(s: LoopStudy, *, ax: Axes) -> Axes:
    """Mean errors against the number of rounds."""
    at = [one.number for one in s.rounds]
    ax.plot(at, [one.kept.mean for one in s.rounds], color=LINES[0], marker=MARKERS[0])
    ax.annotate("kept fits", (at[-1], s.rounds[-1].kept.mean), (4, 4), textcoords="offset points")
    for k, (what, name) in enumerate((("alone", "regressor alone"), ("begun", "fits it begins"))):
        means = [getattr(one, what).mean for one in s.rounds[1:]]
        ax.plot(at[1:], means, "--", color=LINES[k + 1], marker=MARKERS[k + 1], label=name)
    ax.plot([], [], color=LINES[0], marker=MARKERS[0], label="kept fits of the loop's images")
    for name, errors in s.others.items():
        ax.axhline(errors.mean, color=FAINT, linewidth=0.8)
        ax.annotate(name, (0, errors.mean), (0, 2), textcoords="offset points", fontsize=7)
    ax.set(xlabel="round", ylabel="mean error (mm)", ylim=(0, None), xticks=at)
    ax.legend(loc="lower right", title="dashed: held-out images")
    return ax


def tables(s: LoopStudy) -> list[Table]:
    """The rounds, and held-out images from other starts, in numbers."""
    of_rounds: Columns[Round] = {
        "round": lambda r: str(r.number),
        "kept fits (mm)": lambda r: _told(r.kept),
        "mean cost": lambda r: f"{r.cost:.2f}",
        "replaced": lambda r: str(r.replaced),
        "held out: regressor alone (mm)": lambda r: _told(r.alone),
        "held out: fits it begins (mm)": lambda r: _told(r.begun),
    }
    of_starts: Columns[tuple[str, Errors]] = {
        "held-out images": lambda row: row[0],
        "mean error (mm), above 150 mm": lambda row: _told(row[1]),
    }
    starts = [*s.others.items(), ("the shipped regressor's own answers", s.shipped_alone)]
    return [Table.of(s.rounds, of_rounds, tuple(range(6))), Table.of(starts, of_starts)]


def _told(errors: Errors | None) -> str:
    return "" if errors is None else f"{errors.mean:.1f} ({errors.failed} of {len(errors.each)})"


def main() -> None:
    """Carry out the study and write its folder."""
    plan, chosen = arguments(LoopPlan, __doc__, "--mocap")
    s = loop_study(plan, chosen.mocap, report)
    figures = {"rounds": (6.4, 4.6, partial(plot_rounds, s))}
    data = {"kind": "loop", "name": "loop", **asdict(replace(s, regressor=None))}
    del data["regressor"]
    files = {}
    if s.regressor is not None:
        files["regressor.npz"] = partial(save_regressor, s.regressor)
    write_study(chosen.out / "loop", tables(s), data, figures, files)


if __name__ == "__main__":
    main()
