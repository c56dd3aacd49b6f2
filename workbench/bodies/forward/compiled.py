"""The surface by compiled code, generated from the functions of `vertex`."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.forward.arrays import SurfaceArrays
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.rows import Rows, Target
from workbench.bodies.forward.vertex import motion_column, vertex_columns

PACKED_TOGETHER = 1024  # vertices, so that packing needs little memory beside the result
BLOCKS = ("pose", "betas", "trans")


@dataclass(frozen=True, eq=False)
class CompiledArithmetic:
    """N vertices, as many side by side as the processor takes at a time; see Arithmetic.

    Attributes:
        library: the compiled functions.
        packed: (N / lanes, rows, lanes), at an address that is a multiple of 64.
        count: N, the number of vertices.
        sizes: K and B, the numbers of joints and betas.
    """

    library: ctypes.CDLL
    packed: Array
    count: int
    sizes: tuple[int, int]

    @staticmethod
    def of(
        library: ctypes.CDLL, arrays: SurfaceArrays, vertices: slice | list[int]
    ) -> CompiledArithmetic:
        """A body's vertices, or some of them, in order."""
        chosen = np.arange(len(arrays.template))[vertices]
        rows, N = len(vertex_columns(arrays, chosen[:1])), len(chosen)
        lanes = int(library.lanes())
        packed = _aligned((-(-N // lanes), rows, lanes))
        for first in range(0, N, PACKED_TOGETHER):
            columns = vertex_columns(arrays, chosen[first : first + PACKED_TOGETHER])
            filled = np.pad(columns, ((0, 0), (0, -columns.shape[1] % lanes)))
            blocks = filled.reshape(rows, -1, lanes).transpose(1, 0, 2)
            packed[first // lanes :][: len(blocks)] = blocks
        return CompiledArithmetic(
            library, packed, N, (arrays.weights.shape[1], arrays.shapedirs.shape[2])
        )

    def evaluate(self, motion: Motion, betas: Array) -> CompiledSurface:
        """The surface moved by a motion, of the person with these betas (B,)."""
        return CompiledSurface(self, motion, betas)

    def run(self, name: str, numbers: Array, *words: int | None) -> None:
        """A function of the library, for all vertices; `words` are addresses or integers."""
        shared = self.count, _address(self.packed), _address(numbers)
        function = getattr(self.library, name)
        function(*(ctypes.c_ssize_t(word or 0) for word in (*shared, *words)))


@dataclass(frozen=True, eq=False)
class CompiledSurface:
    """The points at one motion and shape, before translation; see AtOrigin."""

    of: CompiledArithmetic
    motion: Motion
    betas: Array

    @cached_property
    def points(self) -> Array:
        """The posed vertices before translation, (N, 3) m."""
        found = np.empty((self.of.count, 3))
        self.of.run("points", motion_column(self.motion, self.betas), _address(found))
        return found

    def tangent(self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into[name] (size, 3 N); keep the points as well."""
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        copied: list[tuple[Array, Array]] = []  # what the library cannot write to, and room for it
        tables = {name: _addresses(Rows.of(target), copied) for name, target in into.items()}
        found = None if "points" in self.__dict__ else np.empty((self.of.count, 3))
        column = motion_column(self.motion, self.betas, slopes)
        wanted = (factor, *(tables.get(name) for name in BLOCKS), found)
        self.of.run("tangent", column, *(None if a is None else _address(a) for a in wanted))
        if found is not None:
            self.__dict__["points"] = found  # as if they had been asked for
        for array, room in copied:
            array[...] = room

    def adjoint(self, pull: Array) -> tuple[Array, Array, Array]:
        """The gradients of sum(pull * points), pull (N, 3), by G, the features and betas."""
        (K, B), features = self.of.sizes, len(self.motion.features)
        pulled = np.ascontiguousarray(pull, dtype=np.float64)
        felt = np.empty(B + features + 12 * K)
        column = motion_column(self.motion, self.betas)
        self.of.run("adjoint", column, _address(pulled), _address(felt))
        on_betas, on_features, on_G = np.split(felt, [B, B + features])
        return on_G.reshape(K, 3, 4), on_features, on_betas


def _addresses(rows: Rows, copied: list[tuple[Array, Array]]) -> NDArray[np.intp]:
    """The address that each row is written to, (count,); 0 for a row that is not wanted.

    An array whose rows are not float64 in one piece is written aside, and appended to `copied`.
    """
    if (one := rows.whole) is not None and _plain(one):
        return _address(one) + one.strides[0] * np.arange(rows.count)
    table = np.zeros(rows.count, dtype=np.intp)
    for first, array in rows.parts:
        room = array
        if not _plain(array):
            room = np.empty(array.shape)
            copied.append((array, room))
        table[first : first + len(array)] = _address(room) + room.strides[0] * np.arange(len(array))
    return table


def _plain(array: Array) -> bool:
    """Whether the library can write its rows."""
    return array.strides[1] == 8 and array.dtype == np.float64 and array.flags.writeable


def _aligned(shape: tuple[int, int, int]) -> Array:
    """Zeros that begin where a cache line does."""
    size = int(np.prod(shape))
    room = np.zeros(size + 8)
    first = -room.ctypes.data % 64 // 8
    return room[first : first + size].reshape(shape)


def _address(array: NDArray[np.generic]) -> int:
    return int(array.ctypes.data)
