"""Replays that lectures show: bodies one after the other, and surfaces side by side."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument, NotSupported
from workbench.fitting.setup import View
from workbench.reports.replay import Recording
from workbench.reports.replay.recording import (
    Series,
    landmarks_of_views,
    packed,
    recording,
    shown_body,
    view_data,
)

BODIES_PER_SECOND = 2.5  # , when they play
GRAIN = 2.0**-14  # m, to which vertices are rounded, so that they compress: 0.06 mm
ANGLES_PER_SECOND = 12.0  # , when it plays
Surface = Callable[[float], Array]


def recorded_bodies(
    body: Body,
    named: Mapping[str, Mapping[str, Values]],
    caption: str,
    *,
    said: Mapping[str, str] | None = None,
    views: Sequence[View] = (),
    cameras: Values | None = None,
) -> Recording:
    """The replay of a body that takes values one after the other.

    `named` are the series among which a reader chooses, each with the values of the body's blocks
    by their names; `said` has a sentence for some of these names. `views` are cameras to look
    through, with what they observed, and `cameras` the numbers of these. Raises BadArgument if
    nothing is given, and NotSupported for a body that a page cannot pose.
    """
    shown = shown_body(body)
    if shown is None:
        raise NotSupported(f"a page cannot pose body {body.name!r}; take a skinned body of SMPL's")
    blocks = [block.name for block in body.blocks()]
    series = [
        Series(
            name,
            list(every),
            [(said or {}).get(label, f"{label[0].upper()}{label[1:]}.") for label in every],
            rows=np.array([[_row(values, blocks)] for values in every.values()]),
            fps=BODIES_PER_SECOND,
        )
        for name, every in named.items()
        if every
    ]
    if not series:
        raise BadArgument("there is no body to show; give values of pose, betas and trans")
    landmarks = landmarks_of_views(body, views)
    seen = [view_data(view, cameras or {}) for view in views] if landmarks["names"] else []
    here = next(iter(next(iter(named.values())).values()))
    return recording(
        shown, _row(here, blocks), caption, series=series, landmarks=landmarks, views=seen
    )


def _row(values: Values, blocks: Sequence[str]) -> np.ndarray:
    return np.concatenate([np.ravel(values[name]) for name in blocks])


def recorded_side_by_side(
    faces: Index,
    angles: Sequence[float] | Array,
    named: Mapping[str, Mapping[str, Surface]],
    caption: str,
    *,
    say: Callable[[float], str] = lambda angle: f"Turned by {np.degrees(angle):.0f} degrees.",
    front: Sequence[float] = (0.0, 0.0, 1.0),
    opens: float = 1.0,
) -> Recording:
    """The replay of surfaces of the same faces (F, 3), by angles (A,) in rad on the slider.

    `named` are the motions among which a reader chooses ("twist", "bend"), each with the ways in
    which it is done side by side: functions from an angle to vertices (N, 3) in m. `say` is the
    sentence on an angle, `front` the direction from which one looks, and `opens` the share of the
    angles at which the page opens. Raises BadArgument if motions differ in their ways.
    """
    ways = list(dict.fromkeys(tuple(one) for one in named.values()))
    if len(ways) != 1 or not ways[0]:
        raise BadArgument("every motion is shown in the same ways, one of them at least")
    opening = round(opens * (len(angles) - 1))
    series = [
        Series(
            name,
            [f"{np.degrees(angle):.0f}°" for angle in angles],
            [say(float(angle)) for angle in angles],
            surfaces=_rounded([[way(float(a)) for way in motion.values()] for a in angles]),
            columns=ways[0],
            opens=opening,
            fps=ANGLES_PER_SECOND,
        )
        for name, motion in named.items()
    ]
    return recording(
        {"faces": packed(faces, "u4")}, None, caption, front=list(front), series=series
    )


def _rounded(surfaces: Sequence[Sequence[Array]]) -> Array:
    return np.round(np.asarray(surfaces) / GRAIN) * GRAIN
