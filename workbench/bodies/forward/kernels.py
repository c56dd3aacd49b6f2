"""Loading compiled arithmetic for a kind of body, after trying it out.

From 1,000 vertices on, the arithmetic of a vertex (`vertex.py`, an SX function) is written as C
with loops over groups of vertices around it, compiled once and kept on disk; so is that of a joint.
Its numbers are compared with NumPy's before it is used (`kernel_trial.py`). Without a compiler, or
if anything fails, NumPy and CasADi do the same work, and the log says why.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.forward.arrays import SkinnedArrays
from workbench.bodies.forward.exact_storage import Stored
from workbench.bodies.forward.kernel_code import vertex_code
from workbench.bodies.forward.kernel_trial import agrees_with_numpy, packing_tried
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.packed_vertices import PackedVertices, Packing
from workbench.bodies.forward.rows import Rows, Target
from workbench.bodies.forward.vertex import motion_column, slopes_column, vertex_functions
from workbench.compiling import NoLibrary, address, function_of_addresses, library
from workbench.errors import NotSupported

LOG = logging.getLogger(__name__)
NAME = "vertex-kernels"
BLOCKS = ("pose", "betas", "trans")
_PACKINGS: WeakKeyDictionary[SkinnedArrays, Packing] = WeakKeyDictionary()
MANY_PLACES = 64  # of arrays whose rows' addresses are remembered
ARGUMENTS = {"points": 4, "tangent": 9, "clear": 2, "adjoint": 5}  # of the library's functions
FLAGS = ("-O3",)  # a quarter less time than with -O2, and the same numbers


@cache
def kernels(
    parents: tuple[int, ...], B: int, kind: Stored = Stored.DOUBLE
) -> tuple[ctypes.CDLL | None, str]:
    """The library for bodies with B betas on this tree, once per process; or None, and why.

    `kind` is the type in which shape and pose directions are stored.
    """
    try:
        source = vertex_code(vertex_functions(B), parents, B, kind)
        return library(NAME, source, partial(_agrees, parents, B, kind), FLAGS), ""
    except (NoLibrary, NotSupported) as error:
        LOG.info("surfaces are computed by NumPy: %s", error)
        return None, str(error)


def _agrees(parents: tuple[int, ...], B: int, kind: Stored, loaded: ctypes.CDLL) -> bool:
    """Whether the library says what NumPy says."""

    def compiled(packed: PackedVertices) -> Callable[..., CompiledSurface]:
        return partial(CompiledSurface, CompiledArithmetic(loaded, packed))

    packing = packing_tried(kind)
    return agrees_with_numpy(compiled, int(loaded.lanes()), parents, B, packing)


def _packing_of(arrays: SkinnedArrays) -> Packing:
    """How a body's directions are stored; all of them are looked at once."""
    if arrays not in _PACKINGS:
        _PACKINGS[arrays] = Packing.of(arrays)
    return _PACKINGS[arrays]


@dataclass(frozen=True, eq=False)
class CompiledArithmetic:
    """Vertices of a surface, as many side by side as the processor takes at a time; see Arithmetic.

    Attributes:
        library: the compiled functions.
        packed: the vertices.
    """

    library: ctypes.CDLL
    packed: PackedVertices

    @staticmethod
    def of(
        arrays: SkinnedArrays, parents: tuple[int, ...], vertices: slice | list[int]
    ) -> CompiledArithmetic | None:
        """A body's vertices, or some of them, in order; None if nothing can be compiled."""
        packing = _packing_of(arrays)
        B = arrays.shapedirs.shape[2]
        library, _ = kernels(parents, B, packing.bend.kind)
        if library is None:
            return None
        lanes = int(library.lanes())
        return CompiledArithmetic(
            library, PackedVertices.of(arrays, parents, vertices, lanes, packing)
        )

    def evaluate(self, motion: Motion, betas: Array) -> CompiledSurface:
        """The surface moved by a motion, of the person with these betas (B,)."""
        return CompiledSurface(self, motion, betas)

    def run(self, name: str, *arrays: NDArray[np.generic] | None) -> None:
        """A function of the library, for all vertices, which is given the addresses of arrays."""
        self._functions[name](self._here, *map(_address, arrays))

    @cached_property
    def _functions(self) -> dict[str, Callable[..., None]]:
        return {n: function_of_addresses(self.library, n, count) for n, count in ARGUMENTS.items()}

    @cached_property
    def _here(self) -> int:
        return address(self.packed.structure)


@dataclass(frozen=True, eq=False)
class CompiledSurface:
    """The points at one motion and shape, before translation; see AtOrigin."""

    of: CompiledArithmetic
    motion: Motion
    betas: Array

    @cached_property
    def points(self) -> Array:
        """The posed vertices before translation, (N, 3) m."""
        found = np.empty((self.of.packed.count, 3))
        self.of.run("points", *self._moved, found)
        return found

    def write_jacobian(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None
    ) -> None:
        """Write the transposed derivative into[name] (size, 3 N); keep the points as well.

        The points have the same bits as those that are computed alone.
        """
        self._write(slopes, into, scale, clear=True)

    def write_jacobian_over_zeros(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None
    ) -> None:
        """The same where `into` holds zeros for joints that leave vertices alone."""
        self._write(slopes, into, scale, clear=False)

    def _write(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None, clear: bool
    ) -> None:
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        copied: list[tuple[Array, Array]] = []  # what the library cannot write to, and room for it
        tables = {name: _addresses(target, copied) for name, target in into.items()}
        found = None if "points" in self.__dict__ else np.empty((self.of.packed.count, 3))
        if clear and "pose" in tables:
            self.of.run("clear", tables["pose"])
        wanted = factor, *(tables.get(name) for name in BLOCKS), found
        self.of.run("tangent", *self._moved, slopes_column(slopes), *wanted)
        if found is not None:
            self.__dict__["points"] = found  # as if they had been asked for
        for array, room in copied:
            array[...] = room

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """The gradients of cotangent (N, 3) . points by G, the features and betas."""
        (K, B), features = self.of.packed.sizes, len(self.motion.features)
        pulled = np.ascontiguousarray(cotangent, dtype=np.float64)
        felt = np.empty(B + features + 12 * K)
        self.of.run("adjoint", *self._moved, pulled, felt)
        on_betas, on_features, on_G = np.split(felt, [B, B + features])
        shape, bend = self.of.packed.steps
        return on_G.reshape(K, 3, 4), bend * on_features, shape * on_betas

    @cached_property
    def _moved(self) -> tuple[Array, Array]:
        """Betas and the motion, as the library takes them."""
        return np.ascontiguousarray(self.betas, dtype=np.float64), motion_column(self.motion)


def _addresses(target: Target, copied: list[tuple[Array, Array]]) -> NDArray[np.intp]:
    """The address that each row is written to, (count,); 0 for a row that is not wanted.

    An array whose rows are not float64 in one piece is written aside, and appended to `copied`.
    """
    one = target if isinstance(target, np.ndarray) else target.whole
    if one is not None and _plain(one):
        return _places(address(one), one.strides[0], len(one))
    rows = Rows.of(target)
    table = np.zeros(rows.count, dtype=np.intp)
    for first, array in rows.parts:
        room = array
        if not _plain(array):
            room = np.zeros(array.shape)
            copied.append((array, room))
        table[first : first + len(array)] = address(room) + room.strides[0] * np.arange(len(array))
    return table


@lru_cache(MANY_PLACES)
def _places(begin: int, stride: int, count: int) -> NDArray[np.intp]:
    """The addresses of rows one after the other; only the library reads them.

    Large Jacobians take turns in a few rooms, so that the same addresses are asked for again.
    """
    return begin + stride * np.arange(count)


def _plain(array: Array) -> bool:
    """Whether the library can write its rows."""
    return array.strides[1] == 8 and array.dtype == np.float64 and array.flags.writeable


def _address(array: NDArray[np.generic] | None) -> int | None:
    return None if array is None else address(array)
