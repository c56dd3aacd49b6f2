"""Bodies that are shown one after the other: frames, stages, hypotheses, ends of solvers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.replay.packing import packed

FARTHEST = 65_534  # hundredths of a millimetre that a distance is stored as; above is none


@dataclass(frozen=True, eq=False)
class Series:
    """S states of one body, or of several side by side.

    Attributes:
        name: what it is a series of, in the plural: `frames`.
        labels: (S,) the name of each state.
        said: (S,) a sentence on each state.
        rows: (S, C, D) numbers of the bodies, NaN where there is none; or None.
        surfaces: (S, N, 3) m, where the bodies are not posed by the page, or (S, C, N, 3) of
            several bodies; or None.
        columns: (C,) the names of bodies side by side.
        opens: the number of the state that is shown first.
        fps: states a second, if they are played as frames are.
        links: (S, L, 3) m twice: points of the body, and the points in space that they are joined
            to; NaN where there is none.
        keypoints: (S, V, M, 2) px and (S, V, M), what V cameras observed in each state.
        scan: (M, 3) m, points of a scan, and (S, M) m how far they are from each surface;
            infinite without a contact.
        contact: in m, the distance up to which a point is coloured.
        scale: in m, the distance from which on all colours are the same.
        hidden: (N,) from 0 to 1, how orange the surface is.
    """

    name: str
    labels: Sequence[str]
    said: Sequence[str]
    rows: Array | None = None
    surfaces: Array | None = None
    columns: Sequence[str] = ("",)
    opens: int = 0
    fps: float | None = None
    links: tuple[Array, Array] | None = None
    keypoints: tuple[Array, Array] | None = None
    scan: tuple[Array, Array] | None = None
    contact: float = 0.0
    scale: float = 0.0
    hidden: Array | None = None

    def data(self) -> dict[str, Any]:
        """As `series.js` takes it."""
        return {
            "name": self.name,
            "labels": list(self.labels),
            "said": list(self.said),
            "columns": list(self.columns),
            "opens": self.opens,
            "fps": self.fps,
            "x": _packed(self.rows),
            "surfaces": _packed(self.surfaces),
            "links": None if self.links is None else [packed(one, "f4") for one in self.links],
            "pixels": None if self.keypoints is None else packed(self.keypoints[0], "f4"),
            "confidence": None if self.keypoints is None else packed(self.keypoints[1], "f4"),
            "scan": None if self.scan is None else packed(self.scan[0], "f4"),
            "far": None if self.scan is None else packed(_hundredths(self.scan[1]), "u2"),
            "contact": self.contact,
            "scale": self.scale,
            "hidden": _packed(self.hidden),
        }


def _packed(array: Array | None) -> dict[str, str] | None:
    return None if array is None else packed(array, "f4")


def _hundredths(metres: Array) -> Array:
    """Distances as whole hundredths of a millimetre; 65,535 for one that is not finite."""
    found = np.minimum(np.abs(np.where(np.isfinite(metres), metres, 0.0)) * 1e5, FARTHEST)
    return np.where(np.isfinite(metres), np.round(found), FARTHEST + 1)
