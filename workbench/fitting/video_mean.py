"""The mean of the posterior of a video in place of its mode, from draws of some of its frames.

The likeliest motion and the expected one differ, as in single images (`sampling.posterior_mean`).
Draws of all frames at once would take minutes. Each frame counts n / T times in a video
(`video_fit`). Smoothness lets about T / n frames tell of one pose, so that a pose is taken to be as
uncertain as one frame by itself leaves it, given the shape. The mean of that posterior is found in
a few frames, and its difference from the likeliest pose and place, which changes slowly, is
interpolated and smoothed over time.
"""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter1d

from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.fitting.setup import Setup
from workbench.fitting.video_start import FEWEST
from workbench.fitting.videos import EVIDENCE
from workbench.sampling.posterior_mean import posterior_mean

APART, BLUR = 1 / 12, 0.1  # s: between frames that are drawn; sd of the Gaussian that smooths


def video_mean(
    setup: Setup,
    values: Values,
    *,
    seed: int = 0,
    told: Callable[[int, int], object] = lambda done, all_: None,
) -> Values:
    """The expected pose and trans in every frame, given the shape; other blocks as they are.

    `setup` is one of `video_fit`, and `values` are its solution. `told` is called with the number
    of frames that have been drawn, and of all that will be. Frames with less than four keypoints in
    every image are not drawn, because they do not place a body. Raises BadArgument for a setup
    without frames.
    """
    moving = setup.moving
    if moving is None or moving.frame is None:
        raise BadArgument("this setup is not that of a video; give one that `video_fit` made")
    pose, _, trans = (block.name for block in moving.body.blocks())
    own = moving.frame.freeing(trans, pose)
    framed = {name for name, block in setup.problem.known.items() if block.framed}
    counts = [(view.confidence > 0).sum(axis=1) for view in moving.views]
    seen = np.flatnonzero(np.max(counts, axis=0) >= FEWEST)
    step = max(1, round(APART * moving.fps))
    drawn = np.unique(np.append(seen[::step], seen[-1]))
    moved: dict[str, list[np.ndarray]] = {pose: [], trans: []}
    T = len(values[trans])
    for done, t in enumerate(drawn):
        here = {n: values[n][t] if n in framed else values[n] for n in own.known}
        mean = posterior_mean(own, here | {EVIDENCE: np.ones(1)}, seed=seed * T + int(t)).values
        for name, differences in moved.items():
            differences.append(mean[name] - here[name])
        told(done + 1, len(drawn))
    found = dict(values)
    times = np.arange(T)
    for name, differences in moved.items():
        each = np.reshape(differences, (len(drawn), -1)).T
        whole = np.stack([np.interp(times, drawn, one) for one in each], axis=1)
        whole = gaussian_filter1d(whole, BLUR * moving.fps, axis=0, mode="nearest")
        found[name] = values[name] + whole.reshape(values[name].shape)
    return found
