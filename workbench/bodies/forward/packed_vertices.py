"""The arrays of a surface in the order in which compiled arithmetic reads them.

Vertices are packed in groups of as many as the processor takes side by side. Most joints neither
carry a vertex nor bend the skin around it (their weights and posedirs there are zero), which is why
each group has lists of the joints that do, and holds the posedirs of these joints only. Shape and
pose directions are stored in the smallest type that holds them exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Mask
from workbench.bodies.forward.arrays import SkinnedArrays, SurfaceArrays
from workbench.bodies.forward.exact_storage import Storage, Stored, storages
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.vertex import shape_columns, vertex_columns

Scalar = TypeVar("Scalar", bound=np.generic)

TOGETHER = 1024  # vertices, so that packing needs little memory beside the result
LINE = 64  # bytes of a cache line
WORTH_NARROWING = 4e6  # bytes: below, making doubles costs more than reading them (measured)


class Packing(NamedTuple):
    """How shapedirs and posedirs are stored."""

    shape: Storage
    bend: Storage

    @staticmethod
    def of(arrays: SkinnedArrays) -> Packing:
        """What takes the least time: directions are stored as they are if the cache holds them."""
        shapes, bends = arrays.shapedirs, arrays.posedirs
        if 8 * (shapes.size + np.count_nonzero(bends)) < WORTH_NARROWING:
            return PLAIN
        return Packing(*storages(shapes, bends))


PLAIN = Packing(Storage(Stored.DOUBLE), Storage(Stored.DOUBLE))


@dataclass(frozen=True, eq=False)
class PackedVertices:
    """N vertices of a surface with K joints and B betas, in groups; `vertex_loops.c` reads them.

    Every array begins at an address that is a multiple of 64.

    Attributes:
        count: N, the number of vertices.
        sizes: K and B.
        vertices: (groups, 3 + K, lanes).
        shapes: (groups, 3 B, lanes), as they are stored.
        bends: (., 27, lanes), as they are stored, for each group and each joint that bends it.
        steps: (2,) by which the stored shapes and bends are multiplied.
        joints: for each group three lists, each after its length: the joints that carry it, bend
            it, and have joints that carry it at or below them.
        still: (., 3) the stretches of vertices that a joint neither turns nor bends: the joint,
            the first vertex, and the number of vertices.
    """

    count: int
    sizes: tuple[int, int]
    vertices: Array
    shapes: NDArray[Any]
    bends: NDArray[Any]
    steps: Array
    joints: NDArray[np.intp]
    still: NDArray[np.intp]

    @staticmethod
    def of(
        arrays: SurfaceArrays,
        parents: Sequence[int],
        vertices: slice | list[int],
        lanes: int,
        packing: Packing = PLAIN,
    ) -> PackedVertices:
        """Some vertices of a surface on this tree, in order."""
        chosen = np.arange(len(arrays.template))[vertices]
        K, B, N = arrays.weights.shape[1], arrays.shapedirs.shape[2], len(chosen)
        groups, (shape, bend) = -(-N // lanes), packing
        packed = _aligned((groups, 3 + K, lanes))
        shapes = _aligned((groups, 3 * B, lanes), shape.kind)
        carried, bent = np.zeros((groups, K), dtype=bool), np.zeros((groups, K), dtype=bool)
        pieces = []
        for start in range(0, N, TOGETHER):
            some = chosen[start : start + TOGETHER]
            here = slice(start // lanes, start // lanes + -(-len(some) // lanes))
            pieces.append((some, here))
            packed[here] = _grouped(vertex_columns(arrays, some), lanes)
            shapes[here] = _grouped(shape.stored(shape_columns(arrays, some)), lanes)
            carried[here] = (_grouped(arrays.weights[some].T, lanes) != 0).any(axis=2)
            which = (arrays.posedirs[some].reshape(len(some), 3, K - 1, 9) != 0).any(axis=(1, 3))
            bent[here, 1:] = _grouped(which.T, lanes).any(axis=2)
        # Now that their number is known, the directions are written to where they will stay.
        bends, end = _aligned((int(bent.sum()), 27, lanes), bend.kind), 0
        for some, here in pieces:
            by_joint = arrays.posedirs[some].reshape(len(some), 3, K - 1, 9)
            planar = by_joint.transpose(2, 3, 1, 0).reshape(27 * (K - 1), len(some))
            joints = bent[here, 1:]
            own = _grouped(planar, lanes).reshape(*joints.shape, 27, lanes)[joints]
            begin, end = end, end + len(own)
            bends[begin:end] = bend.stored(own)
        moved = carried @ ancestors(parents) > 0
        return PackedVertices(
            N,
            (K, B),
            packed,
            shapes,
            bends,
            np.array([shape.step, bend.step]),
            _lists(carried, bent, moved),
            _stretches(moved | bent, lanes, N),
        )

    @cached_property
    def structure(self) -> NDArray[np.intp]:
        """The `body_t` of `vertex_loops.c`."""
        arrays = self.vertices, self.shapes, self.bends, self.steps, self.joints, self.still
        addresses = [array.ctypes.data for array in arrays]
        return np.array([self.count, *addresses, len(self.still)], dtype=np.intp)


def _lists(*groups: Mask) -> NDArray[np.intp]:
    """For each group, the joints in each of some masks (groups, K), each list after its length."""
    found: list[int] = []
    for rows in zip(*groups, strict=True):
        for row in rows:
            joints = np.flatnonzero(row).tolist()
            found += [len(joints), *joints]
    return np.array(found, dtype=np.intp)


def _stretches(moving: Mask, lanes: int, count: int) -> NDArray[np.intp]:
    """The joint, first vertex and number of vertices of every run of groups that are still."""
    still = np.zeros((moving.shape[1], len(moving) + 2), dtype=np.int8)
    still[:, 1:-1] = ~moving.T
    changes = np.diff(still, axis=1)
    joint, first = np.nonzero(changes == 1)
    _, last = np.nonzero(changes == -1)
    begin, end = lanes * first, np.minimum(lanes * last, count)
    return np.stack([joint, begin, end - begin], axis=1).astype(np.intp)


def _grouped(columns: NDArray[Scalar], lanes: int) -> NDArray[Scalar]:
    """Rows of vertices (r, n) in groups (., r, lanes), the last one filled up with zeros."""
    rows, n = columns.shape
    filled = np.pad(columns, ((0, 0), (0, -n % lanes)))
    return filled.reshape(rows, -(-n // lanes), lanes).transpose(1, 0, 2)


def _aligned(shape: tuple[int, int, int], kind: Stored = Stored.DOUBLE) -> NDArray[Any]:
    """Zeros that begin where a cache line does."""
    size = int(np.prod(shape)) * kind.dtype.itemsize
    room = np.zeros(size + LINE, dtype=np.uint8)
    first = -room.ctypes.data % LINE
    return room[first : first + size].view(kind.dtype).reshape(shape)
