"""Markers on a body: landmarks that are single vertices, with a nominal place off the surface.

A reflective ball sits on skin or clothes. Its centre is therefore a place on the surface plus an
offset, which is not known exactly (Loper, Mahmood and Black, MoSh: Motion and Shape Capture from
Sparse Markers, 2014).
"""

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import Landmarks, SkinnedBody
from workbench.errors import BadArgument, BadFile, check_known, some, some_of
from workbench.geometry.solids import vertex_normals
from workbench.reading.facts import facts, json_in, whole

MARKER_HEIGHT = 0.0095  # m from the surface to the centre of a marker, as in MoSh
MARKERS = "markers"  # the name of the landmark set
ALONG_WORTH = 0.1  # of a metre along a ray beside a metre off it: the outermost surface
LEAST_FACING = 0.3  # cosine between a ray and the normal, which keeps to the outer surface
Ray = tuple[str, str, float, tuple[float, float, float]]


@dataclass(frozen=True, eq=False)
class MarkerSet:
    """M markers on a body.

    Attributes:
        names: the label of each marker.
        vertices: (M,) the vertex on which each one sits.
        nominal: (M, 3) m from the vertex to the centre of the marker, on the body at rest.
    """

    names: tuple[str, ...]
    vertices: Index
    nominal: Array

    @staticmethod
    def of(
        body: SkinnedBody, vertices: Mapping[str, int], out: float = MARKER_HEIGHT
    ) -> "MarkerSet":
        """Markers on numbered vertices, each `out` m away from the surface along its normal.

        Raises BadArgument for no markers, for what is no vertex, and for two markers on one.
        """
        names = tuple(vertices)
        if not names:
            raise BadArgument("a marker set has one marker or more; give vertices by their names")
        for name, i in vertices.items():
            if not isinstance(i, (int, np.integer)) or not 0 <= i < body.n_vertices:
                raise BadArgument(
                    f"marker {name!r} is on vertex {i!r}, but body {body.name!r} has the vertices "
                    f"0 to {body.n_vertices - 1}"
                )
        chosen = np.array([vertices[name] for name in names], dtype=np.int64)
        used, first = np.unique(chosen, return_index=True)
        if len(used) < len(chosen):
            again = next(i for i in range(len(chosen)) if i not in first)
            same = names[int(np.flatnonzero(chosen == chosen[again])[0])]
            raise BadArgument(
                f"the markers {same!r} and {names[again]!r} are on the same vertex "
                f"{chosen[again]}; give each marker a vertex of its own"
            )
        return MarkerSet(names, chosen, out * vertex_normals(body.template, body.faces)[chosen])

    def on(self, body: SkinnedBody) -> SkinnedBody:
        """The body with these markers as its landmark set `markers`."""
        M = len(self.names)
        entries = (np.ones(M), (np.arange(M), self.vertices))
        regressor = csr_array(entries, shape=(M, body.n_vertices))
        return replace(
            body, landmarks={**body.landmarks, MARKERS: Landmarks(self.names, regressor)}
        )

    def leaders(self, body: SkinnedBody) -> Index:
        """(M,) the joint that each marker follows most."""
        return np.asarray(np.argmax(body.weights[self.vertices], axis=1))

    def only(self, labels: Sequence[str]) -> "MarkerSet":
        """The markers with these labels, in this order. Raises UnknownName."""
        for label in labels:
            check_known("marker", label, self.names)
        some_of = np.array([self.names.index(label) for label in labels], dtype=np.int64)
        return MarkerSet(tuple(labels), self.vertices[some_of], self.nominal[some_of])


def read_marker_set(path: Path, body: SkinnedBody) -> MarkerSet:
    """A marker set in JSON: `{"LFHD": 412, "RFHD": 77, ...}`, vertices of the body by their names.

    Raises BadFile for what is no such file, and for vertices that the body does not have.
    """
    content = json_in(path)
    try:
        entries = facts(content, "").entries
        vertices = {name: whole(i, name) for name, i in entries.items()}
        return MarkerSet.of(body, vertices)
    except (BadFile, BadArgument) as error:
        raise BadFile(
            f'{path} is no marker set, {{"name": number of a vertex, ...}}: {error}'
        ) from error


def default_markers(body: SkinnedBody) -> MarkerSet:
    """41 markers on a body with SMPL's joints: 4 on the head, 9 on the torso, 7 on each limb.

    Each one sits on the vertex nearest to a ray from a point between two joints of the body at
    rest. Names are in the style of motion capture, such as LFHD, C7 or RANK; the places are our
    own, and no marker protocol's. Raises UnknownName for a body without these joints.
    """
    return MarkerSet.of(body, _placed(body, usual=True))


def known_markers(body: SkinnedBody) -> MarkerSet:
    """All 72 markers whose places are known: the 41, and those that other marker sets have."""
    return MarkerSet.of(body, _placed(body, usual=False))


def _table(name: str) -> list[list[str]]:
    """The rows of a table in `data/markers`, without its head."""
    text = (files("workbench") / "data" / "markers" / name).read_text(encoding="utf-8")
    return [*csv.reader(text.splitlines())][1:]


def _rays(usual: bool) -> dict[str, tuple[Ray, int]]:
    """Rays by the names of markers, and the side on which each must end, as the sign of x.

    A ray starts between two joints (the share is that of the second one), in a direction of the
    rest pose: x to the body's left, y up, z to the front. Those with a star are on both sides.
    """
    rays: dict[str, tuple[Ray, int]] = {}
    for name, a, b, share, *towards, of_the_41 in _table("places.csv"):
        if usual and of_the_41 != "yes":
            continue
        x, y, z = map(float, towards)
        for label, side, sign in (("L", "left", 1), ("R", "right", -1))[: 1 + name.startswith("*")]:
            joints = a.replace("*", side), b.replace("*", side)
            ray = (*joints, float(share), (sign * x, y, z))
            rays[name.replace("*", label)] = ray, sign if "*" in name else 0
    return rays


def _placed(body: SkinnedBody, usual: bool) -> dict[str, int]:
    """The vertex nearest to each ray, none of them twice. Raises UnknownName for a joint."""
    joints, normals = body.joints(), vertex_normals(body.template, body.faces)
    chosen: dict[str, int] = {}
    for name, ((a, b, share, towards), side) in _rays(usual).items():
        for joint in (a, b):
            check_known("joint", joint, body.joint_names)
        start, end = (joints[body.joint_names.index(joint)] for joint in (a, b))
        offset = body.template - (1 - share) * start - share * end
        direction = np.array(towards) / np.linalg.norm(towards)
        along = offset @ direction
        off = np.linalg.norm(offset - along[:, None] * direction, axis=1) - ALONG_WORTH * along
        facing = (along > 0) & (normals @ direction > LEAST_FACING)
        usable = facing & (side * body.template[:, 0] >= 0)
        off[~usable | np.isin(np.arange(len(off)), list(chosen.values()))] = np.inf
        chosen[name] = int(np.argmin(off))
    return chosen


@cache
def known_labels() -> dict[str, str]:
    """What the labels of usual marker sets, in capitals, mean: `LASI` is LFWT, `L_FCC` LHEE.

    `data/markers/labels.csv` names the set of each label, and where it is described.
    """
    return {
        label.replace("*", side).upper(): marker.replace("*", side)
        for marker, label, *_ in _table("labels.csv")
        for side in ("LR" if "*" in marker else " ")
    }


def _meaning(label: str, names: Mapping[str, str]) -> tuple[str, str] | None:
    """What precedes a label, such as a subject's name, and which marker the rest of it means."""
    ends = [0, *(m.end() for m in re.finditer(r"[:_. -]", label))]
    for end in ends:
        rest = label[end:].strip().upper()
        if rest in names:
            return label[:end].upper(), names[rest]
    return None


def matched(
    labels: Sequence[str], markers: MarkerSet
) -> tuple[MarkerSet, tuple[int, ...], tuple[str, ...]]:
    """The markers that were observed, their places among the labels, and notes on other labels.

    Labels may be in small letters, begin with a subject's name (`Anna:LHEE`, `s01_LHEE`), or be
    those of usual marker sets (`known_labels`). Of several subjects that with most markers is
    taken, and of labels with the same meaning the first. Raises BadArgument if none is known.
    """
    names = {k: v for k, v in known_labels().items() if v in markers.names}
    names |= {name.upper(): name for name in markers.names}
    meanings = [
        ("", label) if label in markers.names else _meaning(label, names) for label in labels
    ]
    subjects = Counter(meaning[0] for meaning in meanings if meaning)
    if not subjects:
        raise BadArgument(
            f"none of the labels {some(labels)} is one of the marker set's {some(markers.names)}; "
            "say which marker each one is (--labels MAP.csv), or give a marker set with the names "
            "of your labels (--marker-set FILE.json)"
        )
    named, best = [name for name in subjects if name], subjects.most_common(1)[0][0]
    column_of: dict[str, int] = {}
    for subject in (best, *(named if len(named) == 1 else ()), ""):
        for place, meaning in enumerate(meanings):
            if meaning is not None and meaning[0] == subject:
                column_of.setdefault(meaning[1], place)
    order = sorted(column_of, key=lambda name: column_of[name])
    places = tuple(column_of[name] for name in order)
    notes = []
    if others := [label for place, label in enumerate(labels) if place not in places]:
        also = f", or that are not of {best!r}" if len(named) > 1 else ""
        notes.append(f"not fitted are {some(others)}, which the marker set does not have{also}")
    pairs = zip(order, places, strict=True)
    if meant := [f"{labels[i]} as {name}" for name, i in pairs if labels[i] != name]:
        notes.append(f"{len(meant)} of {len(order)} labels are understood: {some_of(meant)}")
    return markers.only(order), places, tuple(notes)
