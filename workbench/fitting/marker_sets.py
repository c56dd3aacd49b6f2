"""Markers on a body: landmarks that are single vertices, with a nominal place off the surface.

A reflective ball sits on skin or clothes. Its centre is therefore a place on the surface plus an
offset, which is not known exactly (Loper, Mahmood and Black, MoSh: Motion and Shape Capture from
Sparse Markers, 2014).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import Landmarks, SkinnedBody
from workbench.errors import BadArgument, BadFile, check_known, some
from workbench.geometry.solids import vertex_normals
from workbench.reading.facts import facts, json_in, whole

OUT = 0.0095  # m from the surface to the centre of a marker, as in MoSh
MARKERS = "markers"  # the name of the landmark set
FAR = 0.1  # how much a metre along a ray is worth beside a metre off it: the outermost surface
FACING = 0.3  # the least cosine between a ray and the normal, which keeps to the outer surface
# A marker's place: from a point between two joints (the share of the second one) in a direction of
# the rest pose, x to the body's left, y up, z to the front. Those on the left have a mirror image.
MIDDLE = {
    "C7": ("neck", "neck", 0.0, (0.0, 0.0, -1.0)),
    "T10": ("spine2", "spine3", 0.3, (0.0, 0.0, -1.0)),
    "CLAV": ("spine3", "neck", 0.7, (0.0, 0.0, 1.0)),
    "STRN": ("spine2", "spine3", 0.6, (0.0, 0.0, 1.0)),
    "RBAC": ("spine3", "right_shoulder", 0.6, (0.0, -0.5, -1.0)),
}
SIDES = {
    "FHD": ("neck", "head", 1.8, (0.6, 0.2, 1.0)),
    "BHD": ("neck", "head", 1.8, (0.6, 0.2, -1.0)),
    "SHO": ("left_collar", "left_shoulder", 0.9, (0.0, 1.0, 0.0)),
    "UPA": ("left_shoulder", "left_elbow", 0.5, (0.0, 0.6, -1.0)),
    "ELB": ("left_elbow", "left_elbow", 0.0, (0.0, -0.3, -1.0)),
    "FRM": ("left_elbow", "left_wrist", 0.5, (0.0, 1.0, 0.5)),
    "WRA": ("left_wrist", "left_wrist", 0.0, (0.0, 0.0, 1.0)),
    "WRB": ("left_wrist", "left_wrist", 0.0, (0.0, 0.0, -1.0)),
    "FIN": ("left_wrist", "left_hand", 0.9, (0.0, 1.0, 0.0)),
    "FWT": ("pelvis", "left_hip", 0.9, (0.3, 0.6, 1.0)),
    "BWT": ("pelvis", "left_hip", 0.5, (0.0, 0.6, -1.0)),
    "THI": ("left_hip", "left_knee", 0.55, (1.0, 0.0, 0.4)),
    "KNE": ("left_knee", "left_knee", 0.0, (1.0, 0.0, 0.0)),
    "SHN": ("left_knee", "left_ankle", 0.4, (0.3, 0.0, 1.0)),
    "ANK": ("left_ankle", "left_ankle", 0.0, (1.0, 0.0, 0.0)),
    "HEE": ("left_ankle", "left_ankle", 0.0, (0.0, -0.5, -1.0)),
    "TOE": ("left_ankle", "left_foot", 1.1, (-0.1, 1.0, 0.3)),
    "MT5": ("left_ankle", "left_foot", 0.9, (1.0, 0.0, 0.0)),
}


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
    def of(body: SkinnedBody, vertices: Mapping[str, int], out: float = OUT) -> "MarkerSet":
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
        taken, first = np.unique(chosen, return_index=True)
        if len(taken) < len(chosen):
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
        at = (np.ones(M), (np.arange(M), self.vertices))
        regressor = csr_array(at, shape=(M, body.n_vertices))
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
    given = json_in(path)
    try:
        entries = facts(given, "").entries
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
    rays = dict(MIDDLE)
    for name, (a, b, share, towards) in SIDES.items():
        rays["L" + name] = a, b, share, towards
        c, d = (joint.replace("left", "right") for joint in (a, b))
        rays["R" + name] = c, d, share, (-towards[0], *towards[1:])
    joints, normals = body.joints(), vertex_normals(body.template, body.faces)
    found: dict[str, int] = {}
    for name, (a, b, share, towards) in rays.items():
        for joint in (a, b):
            check_known("joint", joint, body.joint_names)
        start, end = (joints[body.joint_names.index(joint)] for joint in (a, b))
        offset = body.template - (1 - share) * start - share * end
        direction = np.array(towards) / np.linalg.norm(towards)
        along = offset @ direction
        off = np.linalg.norm(offset - along[:, None] * direction, axis=1) - FAR * along
        out = (along > 0) & (normals @ direction > FACING)
        off[~out | np.isin(np.arange(len(off)), list(found.values()))] = np.inf
        found[name] = int(np.argmin(off))
    return MarkerSet.of(body, found)


def matched(
    labels: Sequence[str], markers: MarkerSet
) -> tuple[MarkerSet, tuple[int, ...], tuple[str, ...]]:
    """The markers that were observed, their places among the labels, and a note on other labels.

    Labels may begin with a subject's name and a colon. Raises BadArgument if none is known.
    """
    plain = [label.rpartition(":")[2].strip() for label in labels]
    places = tuple(i for i, label in enumerate(plain) if label in markers.names)
    if not places:
        raise BadArgument(
            f"none of the labels {some(labels)} is one of the marker set's {some(markers.names)}; "
            "give a marker set with the names of your labels (--marker-set FILE.json)"
        )
    others = [labels[i] for i in range(len(labels)) if i not in places]
    note = f"not fitted are {some(others)}, which the marker set does not have"
    return markers.only([plain[i] for i in places]), places, (note,) if others else ()
