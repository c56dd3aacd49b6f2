"""People in photographs whose answer is known, and drawings of bodies as a camera sees them.

One person is real: that of `balance`, whom four cameras saw, and whose answer is the fit to all of
them. The others are made up.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.experiments.balance import observations
from workbench.fitting import keypoint_fit
from workbench.fitting.observations import Observations, photograph
from workbench.fitting.setup import View
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots.body import painted
from workbench.plots.palette import BLUE, VERMILLION
from workbench.solvers import solve

CAMERA = "camera"  # what every camera is called, so that all shots share one problem
FOCAL, SIZE, TALL = 1200.0, 1100, 1.7  # px, px and m
HEIGHTS = (400.0, 900.0)  # px, of a person in the image


@dataclass(frozen=True, eq=False)
class Shot:
    """What one camera saw of a person.

    Attributes:
        observed: the keypoints in one photograph, whose name is `CAMERA`.
        truth: pose, betas and trans of the person.
    """

    observed: Observations
    truth: Values


def made_up_shots(
    body: SkinnedBody, poses: Array, facings: Array, rng: np.random.Generator, *, noise: float
) -> list[Shot]:
    """People in given poses (N, K, 3) rad with betas from N(0, 1), 400 to 900 px tall.

    `facings` (N, 3, 3) take the world to each camera, and keypoints have `noise` px in each
    coordinate.
    """
    names = body.landmark_names("coco")
    K = np.array([[FOCAL, 0, SIZE / 2], [0, FOCAL, SIZE / 2], [0, 0, 1]])
    found = []
    for pose, R in zip(poses, facings, strict=True):
        betas = rng.standard_normal(body.n_betas)
        truth = {"pose": pose, "betas": betas, "trans": -body.joints(pose, betas).mean(axis=0)}
        t = np.array([0.0, 0.0, FOCAL * TALL / rng.uniform(*HEIGHTS)])
        seen = body.landmark("coco", *truth.values()) @ R.T + t
        pixels = FOCAL * seen[:, :2] / seen[:, 2:] + SIZE / 2
        pixels = pixels + noise * rng.standard_normal(pixels.shape)
        points = np.column_stack([pixels, np.ones(len(names))])
        shot = photograph(CAMERA, (SIZE, SIZE), points, {"K": K, "R": R, "t": t})
        found.append(Shot(Observations(tuple(names), (shot,)), truth))
    return found


def shots_of_balance(body: SkinnedBody, frames: Iterable[int]) -> list[Shot]:
    """Each of the four cameras alone, in each of these frames; the truth is the fit to all four."""
    found = []
    for frame in frames:
        observed, _ = observations(frame)
        whole = keypoint_fit(observed, body, "")
        values = solve(whole.problem, whole.start).values
        for photo in observed.photographs:
            alone = replace(observed, photographs=(replace(photo, name=CAMERA),))
            found.append(Shot(alone, {block.name: values[block.name] for block in body.blocks()}))
    return found


def in_camera(places: Array, view: View, values: Values) -> Array:
    """World points (N, 3) m in the camera's frame: right, down, away."""
    R = matrix_from_vector(values[view.camera.rotation.name])
    return np.asarray(places @ R.T + values[view.camera.translation.name])


def draw_in_image(body: SkinnedBody, view: View, values: Values, *, ax: Axes) -> None:
    """The body, its keypoints (crosses) and those observed (circles), as the camera sees them."""
    arguments = [values[block.name] for block in body.blocks()]
    skin, found = body.vertices(*arguments), body.landmark(view.landmarks, *arguments)
    flat, solid = view.camera.pixels(skin, values), in_camera(skin, view, values) * [1, -1, -1]
    ax.add_collection(painted(flat, solid, body.faces, contrast=0.4))
    known = view.confidence > 0
    ax.plot(*view.camera.pixels(found, values)[known].T, "x", color=BLUE, ms=5, label="fitted")
    ax.plot(*view.observed[known].T, "o", mfc="none", color=VERMILLION, ms=6, label="observed")
    ax.set(xlabel="u (px)", ylabel="v (px)", aspect="equal")
    ax.invert_yaxis()


def draw_from_aside(body: SkinnedBody, view: View, values: Values, *, ax: Axes) -> None:
    """The body from the camera's right: the distance from the camera to the right, and up."""
    skin = in_camera(body.vertices(*[values[block.name] for block in body.blocks()]), view, values)
    solid = skin[:, [2, 1, 0]] * [1, -1, 1]
    ax.add_collection(painted(solid[:, :2], solid, body.faces, contrast=0.4))
    ax.autoscale_view()
    ax.set(xlabel="distance from the camera (m)", ylabel="up (m)", aspect="equal")
