"""The arrays of a surface in the order in which compiled arithmetic reads them.

Vertices are packed in groups of as many as the processor takes side by side. Most joints leave a
vertex alone: their weights and posedirs there are zero. So each group has lists of the joints that
do not, and holds the posedirs of these joints only.

What limits a posed surface is reading its shape and pose directions. Those of an embedded body are
whole multiples of one step, and those of many files are single precision: four bytes hold each of
them, and the processor makes eight of them again in its registers, the same to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Mask
from workbench.bodies.forward.kinematics import ancestors

if TYPE_CHECKING:
    from workbench.bodies.forward.compiled import TrialArrays
    from workbench.bodies.skinned import SkinnedBody

Scalar = TypeVar("Scalar", bound=np.generic)

TOGETHER = 1024  # vertices, so that packing needs little memory beside the result
LINE = 64  # bytes of a cache line
WORTH_NARROWING = 4e6  # bytes: below, making doubles costs more than reading them (measured)
SAMPLE = 100_000  # numbers from which a step is guessed
PIECE = 2**16  # numbers that are compared at a time


class Packing(NamedTuple):
    """How shapedirs and posedirs are stored: each number is what is stored, times a step.

    Attributes:
        single: whether single precision holds them; then it holds them exactly.
        steps: those of shapedirs and of posedirs.
    """

    single: bool = False
    steps: tuple[float, float] = (1.0, 1.0)

    @staticmethod
    def of(body: SkinnedBody) -> Packing:
        """What takes the least time: directions are stored as they are if the cache holds them."""
        arrays = body.shapedirs, body.posedirs
        if 8 * (arrays[0].size + np.count_nonzero(arrays[1])) < WORTH_NARROWING:
            return Packing()
        whole = whole_step(arrays[0]), whole_step(arrays[1])
        for steps in (whole, (1.0, 1.0)):
            if all(is_exact(array, step) for array, step in zip(arrays, steps, strict=True)):
                return Packing(True, steps)
        return Packing()

    @property
    def dtype(self) -> type[np.floating[Any]]:
        """The type of what is stored."""
        return np.float32 if self.single else np.float64

    def stored(self, array: Array, step: float) -> NDArray[Any]:
        """What is stored of the numbers of an array."""
        return (array if step == 1 else np.rint(array / step)).astype(self.dtype)


def whole_step(array: Array) -> float:
    """The number of which all entries seem to be whole multiples: the least distance of some."""
    entries = array[array != 0]
    some = entries[np.linspace(0, entries.size - 1, min(entries.size, SAMPLE)).astype(np.int64)]
    apart = np.diff(np.unique(np.abs(some)), prepend=0.0)
    return float(f"{apart.min(initial=1.0):.6g}") or 1.0


def is_exact(array: Array, step: float) -> bool:
    """Whether single precision times the step gives the numbers of an array, to the bit."""
    packing, flat = Packing(True), array.ravel()
    pieces = (flat[first : first + PIECE] for first in range(0, flat.size, PIECE))
    with np.errstate(over="ignore"):  # what is too large becomes infinite, which is not equal
        return all(
            np.array_equal(packing.stored(some, step) * np.float64(step), some) for some in pieces
        )


@dataclass(frozen=True, eq=False)
class PackedVertices:
    """N vertices of a surface with K joints and B betas, in groups; `mesh.c` reads them.

    Every array begins at an address that is a multiple of 64.

    Attributes:
        count: N, the number of vertices.
        sizes: K and B.
        vertices: (groups, 3 + K, lanes), template and weights.
        shapes: (groups, 3 B, lanes), as they are stored.
        posedirs: (., 27, lanes), as they are stored, for each group and each joint that has some.
        steps: (2,) by which the stored shapes and posedirs are multiplied.
        joints: for each group three lists, each after its length: the joints that have a weight on
            it, that have posedirs, and that have a weight on it at or below them.
    """

    count: int
    sizes: tuple[int, int]
    vertices: Array
    shapes: NDArray[Any]
    posedirs: NDArray[Any]
    steps: Array
    joints: NDArray[np.intp]

    @staticmethod
    def of(
        arrays: SkinnedBody | TrialArrays,
        parents: Sequence[int],
        vertices: slice | list[int],
        lanes: int,
        packing: Packing,
    ) -> PackedVertices:
        """Some vertices of a surface on this tree, in order."""
        chosen = np.arange(len(arrays.template))[vertices]
        K, B, N = arrays.weights.shape[1], arrays.shapedirs.shape[2], len(chosen)
        groups, (shape_step, pose_step) = -(-N // lanes), packing.steps
        packed = _aligned((groups, 3 + K, lanes), np.float64)
        shapes = _aligned((groups, 3 * B, lanes), packing.dtype)
        weighted, corrected = np.zeros((groups, K), dtype=bool), np.zeros((groups, K), dtype=bool)
        pieces = []
        for start in range(0, N, TOGETHER):
            some = chosen[start : start + TOGETHER]
            here = slice(start // lanes, start // lanes + -(-len(some) // lanes))
            pieces.append((some, here))
            of_vertex = np.concatenate([arrays.template[some].T, arrays.weights[some].T])
            packed[here] = _grouped(of_vertex, lanes)
            by_beta = arrays.shapedirs[some].transpose(2, 1, 0).reshape(3 * B, len(some))
            shapes[here] = _grouped(packing.stored(by_beta, shape_step), lanes)
            weighted[here] = (_grouped(arrays.weights[some].T, lanes) != 0).any(axis=2)
            which = (arrays.posedirs[some].reshape(len(some), 3, K - 1, 9) != 0).any(axis=(1, 3))
            corrected[here, 1:] = _grouped(which.T, lanes).any(axis=2)
        # Now that their number is known, the directions are written to where they will stay.
        posedirs, end = _aligned((int(corrected.sum()), 27, lanes), packing.dtype), 0
        for some, here in pieces:
            by_joint = arrays.posedirs[some].reshape(len(some), 3, K - 1, 9)
            planar = by_joint.transpose(2, 3, 1, 0).reshape(27 * (K - 1), len(some))
            joints = corrected[here, 1:]
            own = _grouped(planar, lanes).reshape(*joints.shape, 27, lanes)[joints]
            begin, end = end, end + len(own)
            posedirs[begin:end] = packing.stored(own, pose_step)
        moved = weighted @ ancestors(parents) > 0
        return PackedVertices(
            N,
            (K, B),
            packed,
            shapes,
            posedirs,
            np.array(packing.steps),
            _lists(weighted, corrected, moved),
        )

    @cached_property
    def structure(self) -> NDArray[np.intp]:
        """The `body_t` of `mesh.c`."""
        arrays = self.vertices, self.shapes, self.posedirs, self.steps, self.joints
        addresses = [array.ctypes.data for array in arrays]
        return np.array([self.count, *addresses], dtype=np.intp)


def _lists(*groups: Mask) -> NDArray[np.intp]:
    """For each group, the joints in each of some masks (groups, K), each list after its length."""
    found: list[int] = []
    for rows in zip(*groups, strict=True):
        for row in rows:
            joints = np.flatnonzero(row).tolist()
            found += [len(joints), *joints]
    return np.array(found, dtype=np.intp)


def _grouped(columns: NDArray[Scalar], lanes: int) -> NDArray[Scalar]:
    """Rows of vertices (r, n) in groups (., r, lanes), the last one filled up with zeros."""
    rows, n = columns.shape
    filled = np.pad(columns, ((0, 0), (0, -n % lanes)))
    return filled.reshape(rows, -(-n // lanes), lanes).transpose(1, 0, 2)


def _aligned(shape: tuple[int, int, int], dtype: type[np.floating[Any]]) -> NDArray[Any]:
    """Zeros that begin where a cache line does."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = np.zeros(size + LINE, dtype=np.uint8)
    first = -room.ctypes.data % LINE
    return room[first : first + size].view(dtype).reshape(shape)
