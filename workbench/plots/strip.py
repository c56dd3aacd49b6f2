"""Frames of a video side by side, and how errors are correlated from frame to frame."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.setup import Moving
from workbench.plots.labels import plain
from workbench.plots.palette import BLUE, FAINT, VERMILLION

MOST = 8  # frames of a strip
MARGIN = 1.15


def plot_strip(moving: Moving, values: Values, view: int, *, ax: Axes) -> Axes:
    """Up to eight frames of one camera: observed keypoints and the skeleton of the fitted body.

    All frames have the same scale, v down, and are cropped to the person.
    """
    camera = moving.views[view]
    chosen = _chosen(moving)
    marks = [(camera.observed[t], camera.confidence[t]) for t in chosen]
    bones = [_skeleton(moving, values, view, t) for t in chosen]
    places = [
        np.vstack([b.reshape(-1, 2), m[c > 0]]) for b, (m, c) in zip(bones, marks, strict=True)
    ]
    size = MARGIN * np.max([np.ptp(p, axis=0) for p in places], axis=0)
    for i, (place, bone, (mark, sure)) in enumerate(zip(places, bones, marks, strict=True)):
        middle = (place.min(axis=0) + place.max(axis=0)) / 2
        shift = np.array([i * size[0], 0.0]) - middle
        ax.add_collection(LineCollection(list(bone + shift), colors=BLUE, linewidths=1.4))
        seen = sure > 0
        opacity = np.clip(sure[seen], 0, 1)
        ax.scatter(
            mark[seen, 0] + shift[0],
            mark[seen, 1] + shift[1],
            s=13,
            facecolors="none",
            edgecolors=[(*to_rgb(VERMILLION), float(a)) for a in opacity],
            linewidths=1.1,
            zorder=3,
        )
        ax.text(i * size[0], size[1] / 2, str(chosen[i]), ha="center", va="top", fontsize=8)
    for i in range(1, len(chosen)):
        ax.axvline((i - 0.5) * size[0], color=FAINT, linewidth=0.5)
    ax.set(xlim=(-size[0] / 2, (len(chosen) - 0.5) * size[0]))
    ax.set(ylim=(0.58 * size[1], -size[1] / 2), aspect="equal", xticks=[], yticks=[])
    ax.grid(False)
    ax.set_title(f"{plain(camera.name)}: frames", loc="left")
    return ax


def caption_strip(moving: Moving, values: Values, view: int) -> str:
    """What `plot_strip` shows."""
    camera, T = moving.views[view], len(moving.views[view].observed)
    well = camera.confidence > LEAST_CONFIDENCE
    gaps = int(np.sum(~(camera.confidence > 0).any(axis=1)))
    unseen = f" In {gaps} of the {T} frames nothing was observed." if gaps else ""
    return (
        f"{camera.name}: {len(_chosen(moving))} of {T} frames at {moving.fps:g} frames per second, "
        f"in which {well.sum(axis=1).mean():.1f} keypoints on average have a confidence above "
        f"{LEAST_CONFIDENCE}.{unseen}"
    )


def plot_autocorrelation(r: Array, worth: float, *, ax: Axes) -> Axes:
    """The correlation of errors that are k frames apart, for all lags of which enough is known."""
    lags = np.flatnonzero(np.isfinite(r))
    ax.plot(lags, r[lags], color=BLUE)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.set(
        xlabel="frames apart", ylabel="correlation of errors", ylim=(min(-0.3, r[lags].min()), 1.05)
    )
    ax.set_title(f"{len(r)} frames are worth {worth:.1f} independent ones", loc="left")
    return ax


def caption_autocorrelation(r: Array, worth: float) -> str:
    """What `plot_autocorrelation` shows."""
    return (
        f"How alike the errors that the fit left are k frames apart: {r[1]:.2f} from one frame to "
        "the next. Errors are not reduced by their mean, because a constant error, such as a hip "
        f"that is always found too far out, is no new evidence either. {len(r)} frames are worth "
        f"{worth:.1f} independent ones for what they share."
    )


def _chosen(moving: Moving) -> list[int]:
    T = len(moving.views[0].observed)
    return sorted({int(t) for t in np.linspace(0, T - 1, min(T, MOST)).round()})


def _skeleton(moving: Moving, values: Values, view: int, t: int) -> Array:
    """The bones of frame t in one image, (K - 1, 2, 2) px: joint and parent."""
    pose, betas, trans = (values[block.name] for block in moving.body.blocks())
    joints = moving.body.joints(pose[t], betas[t] if betas.ndim == 2 else betas, trans[t])
    pixels = moving.views[view].camera.pixels(joints, values)
    parents = np.asarray(moving.body.parents)
    k = np.flatnonzero(parents >= 0)
    return np.stack([pixels[k], pixels[parents[k]]], axis=1)
