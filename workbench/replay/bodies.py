"""Bodies that are shown one after the other: answers, or draws, each with its own name."""

from collections.abc import Mapping, Sequence

import numpy as np

from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument, NotSupported
from workbench.fitting.setup import View
from workbench.replay.assembling import recording
from workbench.replay.observations import landmarks_of_views, view_data
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording, shown_body

RATE = 2.5  # bodies a second, when they play


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
            fps=RATE,
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
