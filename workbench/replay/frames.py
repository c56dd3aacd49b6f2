"""The replay of a body that moves through frames: a fitted clip or recording, or a motion."""

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.forward.sources import Arguments
from workbench.fitting.setup import Setup
from workbench.motions import Motion
from workbench.problem import Problem
from workbench.replay.assembling import recording
from workbench.replay.observations import (
    landmarks_of_views,
    observed_points,
    spread,
    view_data,
)
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording, shown_body
from workbench.residuals import Residual

MOST = 400  # frames of a replay
OF_FRAMES = "The body in every frame. The slider goes through the frames. "
OF_SOME = "The body in {shown} of {count} frames. The slider goes through them. "
OF_VIEWS = (
    "Red lines lead from points of the body to the rays along which the cameras observed them. "
)
OF_POINTS = "Red lines lead from points of the body to where they were observed. "


def recorded_frames(setup: Setup, values: Values) -> Recording | None:
    """The replay of a body that moves through frames, and of what was observed in each.

    None if no body moves, or one that a page cannot pose.
    """
    body = moving_body(setup)
    rows = None if body is None else rows_of_frames(body, values)
    shown = None if rows is None else shown_body(body)
    if rows is None or shown is None:
        return None
    some = spread(len(rows), MOST)
    views = () if setup.moving is None else setup.moving.views
    landmarks = landmarks_of_views(shown.body, views)
    usable = landmarks["names"] and all(_one_camera(v.camera.focal.name, values) for v in views)
    seen = [view_data(view, values) for view in views] if usable else []
    links = links_of_frames(setup.problem, values, some)
    pixels = np.array([view.observed[some] for view in views]).swapaxes(0, 1) if seen else None
    sure = np.array([view.confidence[some] for view in views]).swapaxes(0, 1) if seen else None
    series = _series(
        rows,
        some,
        None if setup.moving is None else setup.moving.fps,
        links=links,
        keypoints=None if pixels is None or sure is None else (pixels, sure),
    )
    caption = _caption(len(some), len(rows)) + (OF_VIEWS if seen else "")
    return recording(
        shown,
        rows[0],
        caption + (OF_POINTS if links is not None else ""),
        series=[series],
        landmarks=landmarks,
        views=seen,
    )


def recorded_motion(motion: Motion, body: Body, betas: Array | None = None) -> Recording | None:
    """The replay of a motion on a body; see `Motion.named` for joints that only one of them has.

    `betas` (T, B) take the place of the motion's own. None for a body that a page cannot pose.
    Raises BadArgument if they have no joint in common.
    """
    shown = shown_body(body)
    if shown is None:
        return None
    here = motion.named(body)
    T = len(here)
    each = np.broadcast_to(here.betas_on(body) if betas is None else betas, (T, body.n_betas))
    rows = np.hstack([here.pose.reshape(T, -1), each, here.trans])
    some = spread(T, MOST)
    return recording(shown, rows[0], _caption(len(some), T), series=[_series(rows, some, here.fps)])


def moving_body(setup: Setup) -> SkinnedBody | None:
    """The body that moves: of the setup, or the one whose points its residuals read."""
    named = setup.body if setup.moving is None else setup.moving.body
    if named is not None:
        return named if isinstance(named, SkinnedBody) else None
    for residual in setup.problem.residuals:
        for _, one in residual.by_frame:
            for points in one.points:
                at = getattr(points.source, "arguments", None)
                if isinstance(at, Arguments) and isinstance(at.body, SkinnedBody):
                    return at.body
    return None


def rows_of_frames(body: Body, values: Values) -> Array | None:
    """(T, 3 K + B + 3) numbers of the body in each frame; None if values hold no frames of it."""
    pose, betas, trans = (values.get(block.name) for block in body.blocks())
    shapes = [block.shape for block in body.blocks()]
    if pose is None or betas is None or trans is None or np.shape(pose)[1:] != shapes[0]:
        return None
    T = len(pose)
    each = np.broadcast_to(betas, (T, *shapes[1])) if np.ndim(betas) == 1 else np.asarray(betas)
    if np.shape(trans) != (T, 3) or each.shape != (T, *shapes[1]):
        return None
    return np.hstack([np.reshape(pose, (T, -1)), each, trans])


def links_of_frames(problem: Problem, values: Values, some: Index) -> tuple[Array, Array] | None:
    """Points of the body in some frames, and where they were observed in space, (S, L, 3) m twice.

    None if no residual compares such points in every frame.
    """
    for residual in problem.residuals:
        frames = dict(residual.by_frame)
        if not all(int(t) in frames for t in some):
            continue
        T, found = 1 + max(frames, default=0), []
        for t in map(int, some):
            found += observed_points([frames[t]], _of_frame(values, frames[t], t, T))
        if len(found) == len(some) and len({one.found.shape for one in found}) == 1:
            places = np.array([one.places for one in found])
            return np.array([one.found for one in found]), places
    return None


def _of_frame(values: Values, residual: Residual, t: int, count: int) -> Values:
    """The values of one frame: of blocks that have a row for each frame, that row."""
    read = [residual.expression, *([w] if isinstance(w := residual.weights, cs.MX) else [])]
    sizes = {symbol.name(): symbol.numel() for one in read for symbol in cs.symvar(one)}
    for points in residual.points:
        sizes |= {block.name: block.size for block in points.source.blocks}
    found = {}
    for name, value in values.items():
        array = np.asarray(value)
        framed = array.ndim and len(array) == count and sizes.get(name, -1) * count == array.size
        found[name] = array[t] if framed else array
    return found


def _one_camera(name: str, values: Values) -> bool:
    """Whether a camera is the same in all frames."""
    return name in values and np.size(values[name]) == 2


def _series(
    rows: Array,
    some: Index,
    fps: float | None,
    links: tuple[Array, Array] | None = None,
    keypoints: tuple[Array, Array] | None = None,
) -> Series:
    """The frames `some` of a motion of `fps` frames a second."""
    times = [f", at {t / fps:.2f} s" if fps else "" for t in some]
    said = [f"Frame {t + 1} of {len(rows)}{time}." for t, time in zip(some, times, strict=True)]
    rate = fps * (len(some) - 1) / max(len(rows) - 1, 1) if fps else None
    return Series(
        "frames",
        [str(t + 1) for t in some],
        said,
        rows=rows[some][:, None],
        fps=rate,
        links=links,
        keypoints=keypoints,
    )


def _caption(shown: int, count: int) -> str:
    return OF_FRAMES if shown == count else OF_SOME.format(shown=shown, count=count)
