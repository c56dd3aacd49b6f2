"""The surface by compiled code, generated from the functions of `vertex`."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.motion import Motion, Slopes
from workbench.bodies.numeric import SurfaceArrays
from workbench.bodies.vertex import motion_column, vertex_columns

Array = NDArray[np.float64]
PACKED_TOGETHER = 1024  # vertices, so that packing needs little memory beside the result
BLOCKS = ("pose", "betas", "trans")


@dataclass(frozen=True, eq=False)
class CompiledSurface:
    """N vertices, as many side by side as the processor takes at a time; see Arithmetic."""

    library: ctypes.CDLL
    packed: Array  # (N / lanes, rows, lanes), at an address that is a multiple of 64
    count: int  # N
    sizes: tuple[int, int]  # K, B

    @staticmethod
    def of(
        library: ctypes.CDLL, arrays: SurfaceArrays, vertices: slice | list[int]
    ) -> CompiledSurface:
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
        return CompiledSurface(
            library, packed, N, (arrays.weights.shape[1], arrays.shapedirs.shape[2])
        )

    def points(self, motion: Motion, betas: Array) -> Array:
        """(N, 3) m, before translation."""
        found = np.empty((self.count, 3))
        self._run("points", motion_column(motion, betas), _address(found))
        return found

    def tangent(
        self,
        motion: Motion,
        slopes: Slopes,
        betas: Array,
        into: Mapping[str, Array],
        scale: Array | None,
        points: Array | None = None,
    ) -> None:
        """Transposed, into[name] (size, 3 N), each column times scale (3 N,); and the points."""
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        targets = {name: _plain(array) for name, array in into.items()}
        where: list[int | None] = []
        for name in BLOCKS:
            array = targets.get(name)
            where += [None, 0] if array is None else [_address(array), array.strides[0] // 8]
        column = motion_column(motion, betas, slopes)
        factors = None if factor is None else _address(factor)
        found = None if points is None else _address(points)
        self._run("tangent", column, factors, *where, found)
        for name, array in into.items():
            if targets[name] is not array:
                array[...] = targets[name]

    def adjoint(self, motion: Motion, betas: Array, pull: Array) -> tuple[Array, Array, Array]:
        """The gradients of sum(pull * points), pull (N, 3), by G, the features and betas."""
        K, B = self.sizes
        pulled = np.ascontiguousarray(pull, dtype=np.float64)
        felt = np.empty(B + len(motion.features) + 12 * K)
        self._run("adjoint", motion_column(motion, betas), _address(pulled), _address(felt))
        on_betas, on_features, on_G = np.split(felt, [B, B + len(motion.features)])
        return on_G.reshape(K, 3, 4), on_features, on_betas

    def _run(self, name: str, numbers: Array, *words: int | None) -> None:
        shared = self.count, _address(self.packed), _address(numbers)
        function = getattr(self.library, name)
        function(*(ctypes.c_ssize_t(word or 0) for word in (*shared, *words)))


def _plain(array: Array) -> Array:
    """The array itself if its rows are float64 in one piece, else room for it."""
    whole = array.strides[1] == 8 and array.strides[0] % 8 == 0 and array.dtype == np.float64
    return array if whole and array.flags.writeable else np.empty(array.shape)


def _aligned(shape: tuple[int, int, int]) -> Array:
    """Zeros that begin where a cache line does."""
    size = int(np.prod(shape))
    room = np.zeros(size + 8)
    first = -room.ctypes.data % 64 // 8
    return room[first : first + size].reshape(shape)


def _address(array: Array) -> int:
    return int(array.ctypes.data)
