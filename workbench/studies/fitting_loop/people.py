"""The made-up images of the study, and how fits to them are judged."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadFile
from workbench.experiments.photographed import Shot, made_up_shots
from workbench.fitting.images import NEARLY, image_priors
from workbench.fitting.keypoints import KeypointProblem, keypoint_setup
from workbench.fitting.observations import LIMBS, SIDES, BadObservation
from workbench.fitting.placing import regressed_start
from workbench.fitting.pose_regressor import PoseRegressor
from workbench.fitting.regressor_training import draw_facings
from workbench.priors.mocap import read_mocap
from workbench.priors.poses import draw_poses, shipped_mixture
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
    than two held-out clips, and as `read_mocap` does.
    """
    if mocap is None:
        poses = draw_poses(shipped_mixture(), sum(counts), rng)
        sets = [poses[: counts[0]], poses[counts[0] :]]
    else:
        clips = read_mocap(mocap).split()[1]
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
