"""People in photographs whose answer is known, and drawings of bodies as a camera sees them.

One person is real: that of `balance`, whom four cameras saw, and whose answer is the fit to all of
them. The others are made up.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.experiments.balance import observations
from workbench.experiments.photographed import CAMERA, Shot, made_up_shots
from workbench.fitting import keypoint_fit
from workbench.fitting.setup import View
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots.body import painted
from workbench.plots.palette import BLUE, VERMILLION
from workbench.solvers import solve

__all__ = [
    "CAMERA",
    "Shot",
    "draw_from_aside",
    "draw_in_image",
    "in_camera",
    "made_up_shots",
    "shots_of_balance",
]


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
