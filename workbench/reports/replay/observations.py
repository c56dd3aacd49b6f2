"""What cameras observed, for a replay."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.bodies.body import Body
from workbench.fitting.setup import View

NOWHERE: dict[str, Any] = {"rows": [], "columns": [], "weights": []}
JOINTS = "joints"  # what `View.landmarks` is called where joints were observed


def spread(count: int, most: int) -> Index:
    """At most `most` of the numbers from 0 to `count` - 1, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def landmark_data(body: Body, name: str | None) -> dict[str, Any]:
    """A set of landmarks as means of vertices, or the joints; empty for a name the body lacks."""
    if name == JOINTS and name not in body.landmarks:
        return {"names": list(body.joint_names), "joints": True, **NOWHERE}
    if name is None or name not in body.landmarks:
        return {"names": [], **NOWHERE}
    landmarks = body.landmarks[name]
    entries = landmarks.regressor.tocoo()
    return {
        "names": list(landmarks.names),
        "rows": entries.row.tolist(),
        "columns": entries.col.tolist(),
        "weights": [float(f"{weight:.9g}") for weight in entries.data],
    }


def landmarks_of_views(body: Body, views: Sequence[View]) -> dict[str, Any]:
    """The landmarks that all views observed; empty if they did not observe the same ones."""
    names = {view.landmarks for view in views}
    return landmark_data(body, names.pop() if len(names) == 1 else None)


def view_data(view: View, values: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """A camera, and what it observed in one image: that of the first frame if there are several."""
    several = np.ndim(view.observed) == 3
    observed, confidence = (a[0] if several else a for a in (view.observed, view.confidence))
    numbers = {
        name: np.ravel(values[getattr(view.camera, name).name]).tolist()
        for name in ("focal", "centre", "distortion", "rotation", "translation")
    }
    return {
        "name": view.name,
        "size": list(view.size),
        "held_out": view.held_out,
        "observed": np.round(observed, 2).tolist(),
        "confidence": np.round(confidence, 3).tolist(),
        **numbers,
    }
