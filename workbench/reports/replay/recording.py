"""A recording: bodies, arrays and series as the scripts of a replay take them."""

import gzip
import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.forward.sources import arguments_from_values
from workbench.errors import BadArgument
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.setup import View
from workbench.problem import Problem

BodyNumbers = Callable[[Values], Array]  # values of blocks -> 3 K + B + 3 numbers of a body


@dataclass(frozen=True, eq=False)
class Recording:
    """A replay for a page."""

    # the arrays of the body, or its faces alone where all surfaces are in the data
    body: dict[str, Any]
    data: dict[str, Any]  # what else `replay.js` takes, as JSON
    caption: str  # what there is to see, in words

    @cached_property
    def key(self) -> str:
        """16 letters that are the same for the same body, whose arrays a page holds once."""
        return sha256(json.dumps(self.body).encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class ShownBody:
    """A body that a page can pose."""

    body: SkinnedBody  # the body
    arrays: dict[str, Any]  # what `smpl.js` takes of it

    def surface(self, numbers: Array) -> Array:
        """The vertices (N, 3) m of a row of 3 K + B + 3 numbers: pose, betas and trans."""
        return np.asarray(self.body.vertices(*self.split(numbers)))

    def split(self, numbers: Array) -> tuple[Array, Array, Array]:
        """The pose (K, 3), the betas (B,) and the trans (3,) of a row of numbers."""
        K, B = self.body.n_joints, self.body.n_betas
        pose, betas, trans = np.split(numbers, [3 * K, 3 * K + B])
        return pose.reshape(K, 3), betas, trans


def shown_body(body: Body | None) -> ShownBody | None:
    """The body for a page; None for one that a page cannot pose."""
    if not isinstance(body, SkinnedBody):
        return None
    try:
        return ShownBody(body, skinned_data(body, "f4"))
    except BadArgument:
        return None


def shown_with_row(
    body: Body | None, problem: Problem, known: Values
) -> tuple[ShownBody, BodyNumbers] | None:
    """The body, and how values of the problem's blocks become a row of its numbers.

    None if the values do not determine them, and for a body that a page cannot pose.
    """
    if not isinstance(body, SkinnedBody):
        return None
    row = row_of_body(body, problem, known)
    shown = None if row is None else shown_body(body)
    return None if row is None or shown is None else (shown, row)


LARGEST = 65_534  # hundredths of a millimetre that a distance is stored as; above is none


@dataclass(frozen=True, eq=False)
class Series:
    """S states of one body, or of several side by side."""

    name: str  # what it is a series of, in the plural: `frames`
    labels: Sequence[str]  # (S,) the name of each state
    said: Sequence[str]  # (S,) a sentence on each state
    rows: Array | None = None  # (S, C, D) numbers of the bodies, NaN where there is none; or None
    # (S, N, 3) m, where the bodies are not posed by the page, or (S, C, N, 3) of several bodies; or
    # None
    surfaces: Array | None = None
    columns: Sequence[str] = ("",)  # (C,) the names of bodies side by side
    opens: int = 0  # the number of the state that is shown first
    fps: float | None = None  # states a second, if they are played as frames are
    # (S, L, 3) m twice: points of the body, and the points in space that they are joined to; NaN
    # where there is none
    links: tuple[Array, Array] | None = None
    # (S, V, M, 2) px and (S, V, M), what V cameras observed in each state
    keypoints: tuple[Array, Array] | None = None
    # (M, 3) m, points of a scan, and (S, M) m how far they are from each surface; infinite without
    # a contact
    scan: tuple[Array, Array] | None = None
    contact: float = 0.0  # in m, the distance up to which a point is coloured
    scale: float = 0.0  # in m, the distance from which on all colours are the same
    hidden: Array | None = None  # (N,) from 0 to 1, how orange the surface is

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
            "links": None if self.links is None else [packed(ends, "f4") for ends in self.links],
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
    hundredths = np.minimum(np.abs(np.where(np.isfinite(metres), metres, 0.0)) * 1e5, LARGEST)
    return np.where(np.isfinite(metres), np.round(hundredths), LARGEST + 1)


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
        "series": [states.data() for states in series],
        "landmarks": landmarks,
        "views": list(views),
        "least_confidence": LEAST_CONFIDENCE,
        "live": live,
    }
    return Recording(shown.arrays if isinstance(shown, ShownBody) else shown, data, caption)


DTYPES = {kind: f"<{kind}" for kind in ("f4", "f8", "u2", "u4")}  # as `unpacked` in arrays.js


def packed(array: ArrayLike, kind: str) -> dict[str, str]:
    """An array, row by row, as `unpacked` in arrays.js reads it; `kind` is one of `KINDS`.

    >>> packed([1.0, 2.0], "f4")["kind"]
    'f4'
    """
    numbers = np.ascontiguousarray(array, dtype=DTYPES[kind])
    compressed = gzip.compress(numbers.tobytes(), 9, mtime=0)
    return {"kind": kind, "gzip": b64encode(compressed).decode("ascii")}


MOST_WEIGHTS = 4  # per vertex, as in SMPL


def skinned_data(body: Body, kind: str = "f8") -> dict[str, Any]:
    """The arrays for smpl.js; numbers but those of pose blend shapes are of the kind f4 or f8.

    Raises BadArgument for a body that is not SMPL's, is not bound in the pose zero, has free arrays
    or more than four weights in a vertex, or more than 65,536 vertices.
    """
    if not isinstance(body, SkinnedBody):
        raise BadArgument(
            why_not_skinned(body, "a page that poses it", "body.vertices(pose) moves it")
        )
    most = int(np.count_nonzero(body.weights, axis=1).max())
    for wrong, why in (
        (not body.is_smpl, "is not blended linearly with features of rotation elements"),
        (body.bind_pose.any(), "is drawn in a pose that is not zero"),
        (body.free, "has free arrays; give them values first"),
        (most > MOST_WEIGHTS, f"has {most} weights in a vertex, and the page knows four"),
        (body.n_vertices > 2**16, f"has {body.n_vertices:,} vertices, and the page knows 65,536"),
    ):
        if wrong:
            raise BadArgument(f"body {body.name!r} {why}; the page cannot show it")
    carriers = np.argsort(-body.weights, axis=1, kind="stable")[:, :MOST_WEIGHTS]
    carriers = np.pad(carriers, ((0, 0), (0, MOST_WEIGHTS - carriers.shape[1])))
    shares = np.take_along_axis(body.weights, carriers, axis=1)
    shares[:, body.n_joints :] = 0  # where there are fewer joints than weights
    skeleton = body.numeric.skeleton
    return {
        "model": "SMPL",
        "joint_names": list(body.joint_names),
        "parents": list(body.parents),
        "template": packed(body.template, kind),
        "faces": packed(body.faces, "u4"),
        "shapedirs": packed(body.shapedirs.transpose(2, 0, 1), kind),
        "joints_mean": packed(skeleton.mean, kind),
        "joints_move": packed(skeleton.by_betas.transpose(2, 0, 1), kind),
        "weights": packed(shares, kind),
        "carriers": packed(carriers, "u2"),
        "bulges": [_bulge(body, k) for k in range(1, body.n_joints)],
    }


def _bulge(body: SkinnedBody, joint: int) -> dict[str, Any]:
    """A joint's blend shapes, for the vertices that they move."""
    shapes = body.posedirs[:, :, 9 * (joint - 1) : 9 * joint]
    vertices = np.flatnonzero(shapes.any(axis=(1, 2)))
    return {
        "joint": joint,
        "vertices": packed(vertices, "u2"),
        "shapes": packed(shapes[vertices], "f4"),
    }


def row_of_body(body: Body, problem: Problem, known: Values) -> BodyNumbers | None:
    """A function from values to 3 K + B + 3 numbers; None if the problem does not determine them.

    `known` are the values of blocks that the given values lack.
    """

    def row(values: Values) -> Array:
        arguments = arguments_from_values(body, problem.points, dict(known) | dict(values))
        assert arguments is not None  # asked below
        return np.concatenate([np.ravel(argument) for argument in arguments])

    arguments = arguments_from_values(body, problem.points, known)
    shapes = tuple(block.shape for block in body.blocks())
    if arguments is None or tuple(np.shape(argument) for argument in arguments) != shapes:
        return None  # among them several frames
    return row


JOINTS = "joints"  # what `View.landmarks` is called where joints were observed


def spread_evenly(count: int, most: int) -> Index:
    """At most `most` of the numbers from 0 to `count` - 1, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def landmarks_of_views(body: Body, views: Sequence[View]) -> dict[str, Any]:
    """The landmarks that all views observed, as means of vertices, or the joints.

    Empty if they did not observe the same ones, or for a name that the body lacks.
    """
    names = {view.landmarks for view in views}
    name = names.pop() if len(names) == 1 else None
    if name == JOINTS and name not in body.landmarks:
        return NO_LANDMARKS | {"names": list(body.joint_names), "joints": True}
    if name is None or name not in body.landmarks:
        return NO_LANDMARKS
    landmarks = body.landmarks[name]
    entries = landmarks.regressor.tocoo()
    return {
        "names": list(landmarks.names),
        "rows": entries.row.tolist(),
        "columns": entries.col.tolist(),
        "weights": [float(f"{weight:.9g}") for weight in entries.data],
    }


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
