"""What was observed, for a replay: keypoints in images, and points in space."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.fitting.setup import View
from workbench.problem import Problem
from workbench.reports.replay.recording import packed
from workbench.residuals import Residual

NOWHERE: dict[str, Any] = {"rows": [], "columns": [], "weights": []}
JOINTS = "joints"  # what `View.landmarks` is called where joints were observed
MOST = 300  # points of one residual to which lines are drawn


@dataclass(frozen=True, eq=False)
class ObservedPoints:
    """Points in space with which a residual compares points of a body.

    Attributes:
        name: the name of the residual.
        found: (M, 3) m, the points of the body.
        places: (M, 3) m, where they were observed; NaN where they were not.
        labels: the names of the points, where they have names.
        count: how many points the residual compares: M, or more if only some are given.
    """

    name: str
    found: Array
    places: Array
    labels: tuple[str, ...] | None
    count: int


def observed_points(residuals: Iterable[Residual], values: Values) -> list[ObservedPoints]:
    """The points in space that residuals compare with points of a body.

    A residual p_k - o_k in metres is known by its expression: where all points p are moved by the
    same d, its rows change by d, and they are minus the observed places where p is zero. Of a
    point of weight zero the place is NaN.
    """
    found = (_observed(residual, values) for residual in residuals)
    return [one for one in found if one is not None]


def _observed(residual: Residual, values: Values) -> ObservedPoints | None:
    if residual.unit != "m" or residual.rows_per_point != 3 or len(residual.points) != 1:
        return None
    (points,) = residual.points
    numeric = points.source.numeric
    if 3 * points.count != residual.size or numeric is None:
        return None
    blocks = [s for s in cs.symvar(residual.expression) if s.name() != points.symbol.name()]
    if not {*(s.name() for s in blocks), *numeric.reads} <= values.keys():
        return None
    evaluate = cs.Function("rows", [points.symbol, *blocks], [residual.expression])
    given = [_columns(values[s.name()], s) for s in blocks]
    moved = np.random.default_rng(0).normal(size=(2, points.count, 3)) * [[[1.0]], [[0.0]]]
    at, zero = (np.asarray(evaluate(p.T, *given)).reshape(-1, 3) for p in moved)
    if not np.allclose(at - zero, moved[0], atol=1e-9):
        return None
    places, weights = -zero, _weights(residual, values)
    if weights is not None:
        seen: Mask = np.asarray((weights > 0).reshape(len(places), -1).all(axis=1))
        places = np.where(seen[:, None], places, np.nan)
    body_points = np.asarray(numeric.evaluate(values).points)
    some = spread(points.count, MOST)
    labels = points.source.labels
    names = None if labels is None else tuple(labels[i] for i in some)
    return ObservedPoints(residual.name, body_points[some], places[some], names, points.count)


def spread(count: int, most: int) -> Index:
    """At most `most` of the numbers from 0 to `count` - 1, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _columns(value: ArrayLike, symbol: cs.MX) -> cs.DM:
    """A value of a block as CasADi holds it, (3, N) for (N, 3)."""
    return cs.reshape(cs.DM(np.ravel(value)), *symbol.shape)


def _weights(residual: Residual, values: Values) -> Array | None:
    """The weights of a residual, for points or rows; None if all are one or they are not known."""
    given = residual.weights
    if not isinstance(given, cs.MX):
        return None if given is None or np.ndim(given) == 0 else np.asarray(given, dtype=float)
    read = cs.symvar(given)
    if given.numel() == 1 or not {s.name() for s in read} <= values.keys():
        return None
    numbers = cs.Function("weights", read, [given])(*(_columns(values[s.name()], s) for s in read))
    return np.ravel(np.asarray(numbers))


def observed_data(problem: Problem, values: Values, body: SkinnedBody) -> dict[str, Any] | None:
    """The first observed points that a page can compare with the body it poses, as it takes them.

    These are joints, vertices or landmarks of the body without offsets. None if there are none.
    """
    for residual in problem.residuals:
        for one in observed_points([residual], values):
            on = _on_body(one, body)
            if on is not None:
                return {"name": one.name, "places": packed(one.places, "f4"), **on}
    return None


def _on_body(one: ObservedPoints, body: SkinnedBody) -> dict[str, Any] | None:
    """Where the points lie on the body: joints, or means of vertices."""
    if one.labels is None:
        if one.count != body.n_vertices:
            return None
        some = spread(one.count, MOST).tolist()
        return {"rows": list(range(len(some))), "columns": some, "weights": [1.0] * len(some)}
    if one.labels == tuple(body.joint_names):
        return {"joints": True}
    for name, landmarks in body.landmarks.items():
        if landmarks.names == one.labels:
            return {k: v for k, v in landmark_data(body, name).items() if k != "names"}
    return None


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
