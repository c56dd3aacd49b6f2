"""Surfaces side by side that change together: the same mesh in several ways, by an angle."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.replay.assembling import recording
from workbench.replay.packing import packed
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording

GRAIN = 2.0**-14  # m, to which vertices are rounded, so that they compress: 0.06 mm
RATE = 12.0  # angles a second, when it plays
Surface = Callable[[float], Array]


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
            fps=RATE,
        )
        for name, motion in named.items()
    ]
    return recording(
        {"faces": packed(faces, "u4")}, None, caption, front=list(front), series=series
    )


def _rounded(surfaces: Sequence[Sequence[Array]]) -> Array:
    return np.round(np.asarray(surfaces) / GRAIN) * GRAIN
