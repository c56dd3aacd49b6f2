"""How far away a person in one image is, with an interval that was compared with measured data.

The landmarks of a detector are not those of a body: a hip, say, is always found a little farther
out. Detectors are marker sets whose markers have unknown offsets. If each keypoint k has an offset
of its own, o_k ~ N(0, (s m_k)^2) m in each direction, seen as s m_k f / z px at the distance z, and
it is integrated out, then the estimate x of the fit has another covariance than Laplace's
C = (J'J)^-1:

    C + (s f / (z sigma))^2 C J_d' J_d C

with the rows J_d of the keypoints, whitened (White, Maximum likelihood estimation of misspecified
models, 1982), both up to the curvature that Gauss and Newton's J'J leaves out. A keypoint that is
known less well has a larger offset too: m_k is its standard deviation in sigmas, 1 for a typical
keypoint of confidence 1 (`keypoint_precision`). The
estimate stays what it is: fits in which keypoints have this larger variance from the outset have
larger errors (`benchmarks/IMAGES.md`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.fitting.setup import Measure, Setup, View
from workbench.geometry.rotation import matrix_from_vector
from workbench.residuals import Residual

OFFSET = 0.015  # m, in each direction: how far a detector's landmarks are from the body's
Z90 = 1.6448536269514722  # 90 % of a normal distribution are within so many standard deviations
FOUND = (
    "The 90 % interval of the distance allows for landmarks of the detector that lie "
    f"{100 * OFFSET:g} cm (standard deviation in each direction) beside those of the body. It was "
    "tested on 100 images of one real person, whose distance was known from four calibrated "
    "cameras: it contained this distance in 100 % of the images, and in 93 % if the stature was "
    "given. Intervals 0.79 and 0.89 times as wide would have contained it in 90 %"
)
STEP = 1e-5  # of an unknown, for a central difference
Quantities = Callable[[Array, Array, Array], Array]  # (N, k) of N poses, betas and trans


@dataclass(frozen=True)
class DepthInterval:
    """How far the body's root is from the camera's plane, along the axis of the camera.

    Attributes:
        mean: the distance in m.
        sd: its standard deviation in m.
    """

    mean: float
    sd: float

    @property
    def low(self) -> float:
        """The lower end of the 90 % interval, m."""
        return self.mean - Z90 * self.sd

    @property
    def high(self) -> float:
        """The upper end of the 90 % interval, m."""
        return self.mean + Z90 * self.sd

    def __str__(self) -> str:
        return f"{self.mean:.2f} m (90 %: {self.low:.2f} to {self.high:.2f} m)"


def depth_interval(setup: Setup, values: Values, offset: float = OFFSET) -> DepthInterval | None:
    """The distance of the body in the one view that was fitted, at the solution `values`.

    `offset` is the standard deviation in m of the distance between a landmark of the detector and
    that of the body, in each direction; with 0 the interval is Laplace's. None if keypoints and
    priors do not determine the distance, or if not one view was fitted.
    """
    fitted = [view for view in setup.views if not view.held_out]
    if len(fitted) != 1 or setup.body is None or residual_of(setup, fitted[0]) is None:
        return None
    body, view = setup.body, fitted[0]
    R = matrix_from_vector(values[view.camera.rotation.name])
    t = values[view.camera.translation.name]

    def depth(pose: Array, betas: Array, trans: Array) -> Array:
        return np.asarray(body.joints(pose, betas, trans)[:, :1] @ R[2] + t[2])

    found, sd, lever = spreads(setup, view, values, depth)
    total = float(np.hypot(sd[0], offset * lever[0]))
    return DepthInterval(float(found[0]), total) if np.isfinite(total) else None


def depth_measures(setup: Setup, values: Values) -> tuple[Measure, ...]:
    """The distance of `depth_interval` and the ends of its interval; none where it is unknown."""
    found = depth_interval(setup, values)
    if found is None:
        return ()
    name, of = "distance from the camera", "end of the 90 % interval"
    return (
        Measure(name, found.mean, "m"),
        Measure(f"{name}, lower {of}", found.low, "m"),
        Measure(f"{name}, upper {of}", found.high, "m"),
    )


def spreads(setup: Setup, view: View, values: Values, of: Quantities) -> tuple[Array, Array, Array]:
    """Quantities of a body in one view, and how uncertain they are; (k,) each.

    What they are at `values`; Laplace's standard deviations; and what an offset of 1 m in each
    direction, as standard deviation of each typical landmark by itself, adds to that in quadrature.
    """
    body, free = setup.body, setup.problem.free
    assert body is not None
    blocks = [block.name for block in body.blocks()]
    at = [values[name] for name in blocks]
    slopes = np.zeros((free.size, len(of(*(one[None] for one in at))[0])))
    for i, name in enumerate(blocks):
        moves = STEP * np.eye(at[i].size).reshape(-1, *at[i].shape)
        count = 2 * len(moves)
        moved = [np.broadcast_to(one, (count, *one.shape)) for one in at]
        moved[i] = at[i] + np.concatenate([moves, -moves])
        ahead, behind = np.split(of(*moved), 2)
        slopes[free.slices[name]] = (ahead - behind) / (2 * STEP)
    here, keypoints = setup.problem.linearize(values), residual_of(setup, view)
    assert keypoints is not None
    by_data = here.covariance @ slopes
    depth = view.camera.depths(body.joints(*at)[:1], values)[0]
    px = np.mean(values[view.camera.focal.name]) / depth  # of 1 m
    data = here.dense[setup.problem.rows[keypoints.name]]
    lever = px / float(keypoints.sigma) * np.linalg.norm(data @ by_data, axis=0)
    return of(*(one[None] for one in at))[0], np.sqrt(np.sum(slopes * by_data, axis=0)), lever


def residual_of(setup: Setup, view: View) -> Residual | None:
    """The residual of the keypoints of a view, or None if the problem has none of its name."""
    name = f"keypoints({view.camera.prefix.rstrip('/')})"
    return next((one for one in setup.problem.residuals if one.name == name), None)
