"""What `replay.js` takes, put together: whatever a recording lacks is empty."""

from collections.abc import Sequence
from typing import Any

from workbench.arrays import Array
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.replay.packing import packed
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording, ShownBody

VERSION = 2
NO_LANDMARKS: dict[str, Any] = {"names": [], "rows": [], "columns": [], "weights": []}


def recording(
    shown: ShownBody | dict[str, Any],
    here: Array | None,
    caption: str,
    *,
    front: Sequence[float] | None = None,
    runs: Sequence[dict[str, Any]] = (),
    directions: Sequence[dict[str, Any]] = (),
    draws: tuple[str, str, Sequence[Array]] = ("", "", ()),
    series: Sequence[Series] = (),
    landmarks: dict[str, Any] = NO_LANDMARKS,
    views: Sequence[dict[str, Any]] = (),
    observed: dict[str, Any] | None = None,
    live: bool = False,
) -> Recording:
    """The replay of a body that the page poses, or of surfaces, of which `shown` has the faces.

    `here` are the numbers of the body that the camera is set up for; without a body it is the last
    surface of the first series, which faces to `front`. `draws` are what they are called, what they
    are of, and the numbers of each.
    """
    name, by, drawn = draws
    data = {
        "kind": "replay",
        "version": VERSION,
        "here": None if here is None else packed(here, "f4"),
        "front": None if front is None else list(front),
        "runs": list(runs),
        "directions": list(directions),
        "draws": {"name": name, "by": by, "count": len(drawn), "x": packed(drawn, "f4")},
        "series": [one.data() for one in series],
        "landmarks": landmarks,
        "views": list(views),
        "observed": observed,
        "least_confidence": LEAST_CONFIDENCE,
        "live": live,
    }
    return Recording(shown.arrays if isinstance(shown, ShownBody) else shown, data, caption)
