"""A scan: points on a surface that nobody labelled, with what a scanner knows of each."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import WorkbenchError
from workbench.geometry.meshes import Mesh
from workbench.geometry.solids import face_vectors, sums_over_faces, vertex_normals

if TYPE_CHECKING:
    import trimesh

UNIT_TOLERANCE = 1e-3  # how far the length of a normal may be from 1: files may hold three digits


class BadScan(WorkbenchError):
    """The error for a scan that a fit cannot use."""


@dataclass(frozen=True, eq=False)
class Scan:
    """Points on a surface, in world coordinates, in no particular order.

    Raises BadScan if there are no points, if an array has another shape, if a number is not finite,
    if a normal is not of unit length, if a face names a point that does not exist, or if a weight
    is negative or all are zero.

    Attributes:
        points: (M, 3) m.
        normals: (M, 3) unit vectors that point out of the surface; None if they are not known.
        faces: (T, 3) triangles of the points' numbers, counterclockwise as seen from outside;
            None if it is not known which points are neighbours.
        weights: (M,) the area in m^2 that each point stands for; None if all count the same.
    """

    points: Array
    normals: Array | None = None
    faces: Index | None = None
    weights: Array | None = None

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise BadScan(f"the points of a scan are (M, 3) m, not {self.points.shape}")
        M = self.n_points
        if not M:
            raise BadScan("a scan has at least one point, but this one is empty")
        _check_finite("point", self.points)
        if self.normals is not None:
            _check_shape("normals", self.normals, (M, 3))
            wrong = ~(np.abs(np.linalg.norm(self.normals, axis=1) - 1) <= UNIT_TOLERANCE)  # nor NaN
            if wrong.any():
                i = int(np.argmax(wrong))
                raise BadScan(
                    f"normal {i} is {self.normals[i].tolist()}, whose length is not 1; divide "
                    "normals by their lengths, or leave out points whose normals are not known"
                )
        if self.faces is not None:
            check_faces(self.faces, M)
        if self.weights is not None:
            _check_shape("weights", self.weights, (M,))
            _check_finite("weight", self.weights)
            if (self.weights < 0).any() or not self.weights.any():
                i = int(np.argmin(self.weights))
                raise BadScan(
                    f"weight {i} is {self.weights[i]:g} m^2; areas are 0 for points that do not "
                    "count, above it for others, and not 0 for all"
                )

    @property
    def n_points(self) -> int:
        """M, the number of points."""
        return len(self.points)

    @classmethod
    def of(cls, mesh: "Scan | Mesh | trimesh.Trimesh") -> "Scan":
        """The scan of a mesh in m, y up: vertices, their normals and areas; a Scan as it is.

        Vertices around which there is no area are left out. Raises BadMesh for what is no mesh.
        """
        if isinstance(mesh, Scan):
            return mesh
        mesh = Mesh.of(mesh)
        points, faces = mesh.vertices, mesh.faces
        if not len(faces):
            return cls(points)
        normals = vertex_normals(points, faces)
        known: Mask = np.asarray(normals.any(axis=1))
        normals[~known] = [0.0, 1.0, 0.0]
        return cls(points, normals, faces, areas_of_faces(points, faces)).some(known)

    def some(self, chosen: Mask) -> "Scan":
        """The scan of the points that a mask (M,) chooses, and of the faces between them.

        Raises BadScan if no point is left, or for a mask of another shape.
        """
        if chosen.shape != (self.n_points,) or chosen.dtype != bool:
            raise BadScan(
                f"choose points by a mask of shape ({self.n_points},), not by an array of "
                f"{chosen.dtype} of shape {chosen.shape}"
            )
        return Scan(
            self.points[chosen],
            None if self.normals is None else self.normals[chosen],
            None if self.faces is None else faces_between(self.faces, chosen),
            None if self.weights is None else self.weights[chosen],
        )

    def thinned(self, most: int) -> "Scan":
        """At most so many of the points that have an area, drawn at random, without faces.

        Their areas are scaled, so that together they stand for the same surface. A scan that is
        small enough is returned as it is.
        """
        if self.n_points <= most:
            return self
        counts = np.flatnonzero(np.ones(self.n_points) if self.weights is None else self.weights)
        chosen = np.zeros(self.n_points, dtype=bool)
        chosen[counts[drawn(len(counts), most)]] = True
        few = replace(self, faces=None).some(chosen)
        if self.weights is None or few.weights is None:
            return few
        return replace(few, weights=few.weights * (self.weights.sum() / few.weights.sum()))


@dataclass(frozen=True, eq=False)
class ScanContents:
    """What a file of a scan holds, in the file's own unit and axes; numbers may be NaN, normals of
    any length, and faces (F, 3) may name points that do not exist.
    """

    points: Array
    normals: Array | None = None
    faces: Index | None = None
    camera_position: Array | None = None
    notes: tuple[str, ...] = ()


def areas_of_faces(points: Array, faces: Index) -> Array:
    """A third of the area of the faces around each point, (M,) m^2; the sum is the whole area."""
    thirds = np.linalg.norm(face_vectors(points, faces), axis=1, keepdims=True) / 3
    return sums_over_faces(thirds, faces, len(points))[:, 0]


def faces_between(faces: Index, chosen: Mask) -> Index:
    """The faces (T, 3) all of whose points a mask (M,) chooses, by the numbers of those."""
    return np.asarray((np.cumsum(chosen) - 1)[faces[chosen[faces].all(axis=1)]])


def drawn(n: int, most: int) -> Mask:
    """Which of n points are among `most` that are drawn at random; always the same ones."""
    chosen = np.zeros(n, dtype=bool)
    chosen[np.random.default_rng(0).choice(n, min(most, n), replace=False)] = True
    return chosen


def _check_shape(name: str, array: Array, expected: tuple[int, ...]) -> None:
    if array.shape != expected:
        raise BadScan(
            f"the {name} of {expected[0]} points must have the shape {expected}, not {array.shape}"
        )


def _check_finite(name: str, array: Array) -> None:
    bad = ~np.isfinite(array.reshape(len(array), -1)).all(axis=1)
    if bad.any():
        i = int(np.argmax(bad))
        raise BadScan(f"{name} {i} is {array[i].tolist()}; leave out what was not measured")


def check_faces(faces: Index, M: int) -> None:
    """Raise BadScan unless faces (T, 3) are whole numbers of the M points."""
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise BadScan(
            f"the faces of a scan are whole numbers (T, 3), not {faces.dtype} {faces.shape}"
        )
    wrong = ((faces < 0) | (faces >= M)).any(axis=1)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise BadScan(f"face {i} is {faces[i].tolist()}, but the points are 0 to {M - 1}")
