"""Recordings of frames, motions, named bodies, stages of a scan, and meshes side by side."""

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.forward.sources import Arguments
from workbench.fitting.setup import Setup
from workbench.geometry.surface_tree import SurfaceTree
from workbench.motions import Motion
from workbench.registration import Registration
from workbench.registration.coregistration.folder import FACING
from workbench.registration.doubts import NEAR
from workbench.reports.replay.recording import (
    Recording,
    Series,
    landmarks_of_views,
    packed,
    recording,
    shown_body,
    spread_evenly,
    view_data,
)

MOST_FRAMES = 400
OF_FRAMES = "The body in every frame. The slider goes through the frames. "
OF_SOME = "The body in {shown} of {count} frames. The slider goes through them. "
OF_VIEWS = (
    "Red lines lead from points of the body to the rays along which the cameras observed them. "
)


def recorded_frames(setup: Setup, values: Values) -> Recording | None:
    """The replay of a body that moves through frames, and of what was observed in each.

    None if no body moves, or one that a page cannot pose.
    """
    body = moving_body(setup)
    rows = None if body is None else rows_of_frames(body, values)
    shown = None if rows is None else shown_body(body)
    if rows is None or shown is None:
        return None
    some = spread_evenly(len(rows), MOST_FRAMES)
    views = () if setup.moving is None else setup.moving.views
    landmarks = landmarks_of_views(shown.body, views)
    lenses = [v.camera.focal.name for v in views]  # a camera is the same in all frames
    usable = landmarks["names"] and all(np.size(values.get(name, ())) == 2 for name in lenses)
    seen = [view_data(view, values) for view in views] if usable else []
    pixels = np.array([view.observed[some] for view in views]).swapaxes(0, 1) if seen else None
    sure = np.array([view.confidence[some] for view in views]).swapaxes(0, 1) if seen else None
    series = _series(
        rows,
        some,
        None if setup.moving is None else setup.moving.fps,
        keypoints=None if pixels is None or sure is None else (pixels, sure),
    )
    caption = _caption(len(some), len(rows)) + (OF_VIEWS if seen else "")
    return recording(shown, rows[0], caption, series=[series], landmarks=landmarks, views=seen)


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
    some = spread_evenly(T, MOST_FRAMES)
    return recording(shown, rows[0], _caption(len(some), T), series=[_series(rows, some, here.fps)])


def moving_body(setup: Setup) -> SkinnedBody | None:
    """The body that moves: of the setup, or the one whose points its residuals read."""
    named = setup.body if setup.moving is None else setup.moving.body
    if named is not None:
        return named if isinstance(named, SkinnedBody) else None
    for residual in setup.problem.residuals:
        for _, term in residual.by_frame:
            for points in term.points:
                arguments = getattr(points.source, "arguments", None)
                if isinstance(arguments, Arguments) and isinstance(arguments.body, SkinnedBody):
                    return arguments.body
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


def _series(
    rows: Array, some: Index, fps: float | None, keypoints: tuple[Array, Array] | None = None
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
        keypoints=keypoints,
    )


def _caption(shown: int, count: int) -> str:
    return OF_FRAMES if shown == count else OF_SOME.format(shown=shown, count=count)


MOST_POINTS, MOST_LINKS = 6_000, 400  # points of the scan: shown, and joined to the surface
MM = 1e3
OF_REGISTRATION = (
    "The points of the scan, and the surface on its way to them: the start that led to the result, "
    "the end of each stage, and the registration. Points in contact have the colour of their "
    "distance to the surface, others are grey. Where the surface is orange, the scan did not show "
    "it. Red lines lead from some of the points to the nearest place on the surface that faces "
    "their way. "
)


def recorded_registration(registration: Registration) -> Recording | None:
    """The surface at the start, at the end of each stage and at last, with points of the scan.

    Distances are signed in a `Registration`, and are shown without their sign. None for a
    registration that was made without `surfaces`.
    """
    if not registration.surfaces:
        return None
    rng = np.random.default_rng(0)
    scan = registration.scan.some(rng.permutation(registration.scan.n_points) < MOST_POINTS)
    joined = spread_evenly(scan.n_points, MOST_LINKS)
    tree = SurfaceTree(registration.vertices, registration.faces)
    distances, ends, said = [], [], []
    for name, vertices in registration.surfaces.items():
        closest = tree.moved(vertices).closest(scan.points, 10 * NEAR, scan.normals, FACING)
        touching = closest.faces >= 0
        unsigned = np.where(touching, np.abs(closest.distances), np.inf)
        distances.append(unsigned)
        ends.append(np.where(touching[joined, None], closest.points[joined], np.nan))
        said.append(_distance_sentence(name, unsigned, registration.reach))
    surfaces = np.array(list(registration.surfaces.values()))
    series = Series(
        "stages",
        list(registration.surfaces),
        said,
        surfaces=surfaces,
        opens=len(surfaces) - 1,
        links=(np.array(ends), np.tile(scan.points[joined], (len(ends), 1, 1))),
        scan=(scan.points, np.array(distances)),
        contact=registration.reach,
        scale=_scale(distances[-1], registration.reach),
        hidden=(~registration.seen).astype(float),
    )
    turn = registration.facing
    return recording(
        {"faces": packed(registration.faces, "u4")},
        None,
        OF_REGISTRATION.rstrip(),
        front=(float(np.sin(turn)), 0.0, float(np.cos(turn))),
        series=[series],
    )


def _scale(distances: Array, reach: float) -> float:
    """Where the colours end: 98 % of the points in contact at last are nearer, in whole mm."""
    near = distances[distances < reach]
    return float(np.ceil(MM * np.percentile(near, 98)) / MM) if len(near) else reach


def _distance_sentence(name: str, distances: Array, reach: float) -> str:
    """A sentence on one surface."""
    near = distances < reach
    begun = f"{name[0].upper()}{name[1:]}: "
    if not near.any():
        return f"{begun}none of the {len(distances):,} points shown is in contact."
    return (
        f"{begun}{100 * near.mean():.0f} % of the {len(distances):,} points shown are in contact, "
        f"nearer than {MM * reach:.0f} mm to the surface; half of these are within "
        f"{MM * float(np.median(distances[near])):.1f} mm."
    )
