"""Loading compiled arithmetic for a kind of body, after trying it out."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.blocks.simd import C_OF, statements
from workbench.bodies.forward.arrays import SurfaceArrays
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.numeric import ChunkedArithmetic, ChunkedSurface, chunks_of
from workbench.bodies.forward.packed_vertices import PackedVertices
from workbench.bodies.forward.rows import Rows, Target
from workbench.bodies.forward.vertex import ADDED, OF_JOINT, motion_column, vertex_functions
from workbench.compiling import NoLibrary, library, vectors
from workbench.errors import NotSupported

LOG = logging.getLogger(__name__)
NAME = "vertex-kernels"
TRIED = 11  # vertices: all lanes full at least once, and some that are left over
TRIED_SHARE = 0.1  # of its joints that carry and bend each of them
SUMS_AND_PRODUCTS = {op: C_OF[op] for op in (cs.OP_ADD, cs.OP_SUB, cs.OP_MUL, cs.OP_NEG)}
BLOCKS = ("pose", "betas", "trans")


@cache
def kernels(parents: tuple[int, ...], B: int) -> tuple[ctypes.CDLL | None, str]:
    """The library for bodies with B betas on this tree, once per process; or None, and why."""
    try:
        source = vertex_code(vertex_functions(B), parents, B)
        return library(NAME, source, lambda loaded: _agrees(loaded, parents, B)), ""
    except (NoLibrary, NotSupported) as error:
        LOG.info("surfaces are computed by NumPy: %s", error)
        return None, str(error)


class _Arrays(NamedTuple):
    template: Array
    shapedirs: Array
    posedirs: Array
    weights: Array


def _agrees(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int) -> bool:
    """Whether the library says what NumPy says, about a few random vertices."""
    rng, K, N = np.random.default_rng(0), len(parents), TRIED
    bends, carries = rng.random((N, 1, K - 1, 1)) < TRIED_SHARE, rng.random((N, K)) < TRIED_SHARE
    arrays = _Arrays(
        rng.standard_normal((N, 3)),
        rng.standard_normal((N, 3, B)),
        (rng.standard_normal((N, 3, K - 1, 9)) * bends).reshape(N, 3, 9 * (K - 1)),
        rng.standard_normal((N, K)) * carries,
    )
    axes = rng.standard_normal((K, 3, 1, 3))
    motion = Motion(
        G=rng.standard_normal((K, 3, 4)),
        features=rng.standard_normal(9 * (K - 1)),
        joints=rng.standard_normal((K, 3)),
    )
    slopes = Slopes(
        turns=np.cross(np.eye(3), axes).reshape(K, 9, 3),  # antisymmetric, as of rotations
        d_features=rng.standard_normal((K - 1, 3, 9)),
        d_shift=rng.standard_normal((3 * B, K)),
    )
    betas, scale = rng.standard_normal(B), rng.standard_normal(3 * N)
    answers = [
        _answers(way.evaluate(motion, betas), slopes, betas, scale)
        for way in (
            CompiledArithmetic.of(loaded, arrays, parents, slice(None)),
            ChunkedArithmetic(chunks_of(arrays, slice(None)), parents),
        )
    ]
    return all(
        np.allclose(got, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max(initial=0)))
        for got, expected in zip(*answers, strict=True)
    )


def _answers(
    surface: CompiledSurface | ChunkedSurface, slopes: Slopes, betas: Array, scale: Array
) -> list[Array]:
    K = len(surface.motion.G)
    into = {
        name: np.zeros((size, len(scale)))
        for name, size in (("pose", 3 * K), ("betas", len(betas)), ("trans", 3))
    }
    surface.tangent(slopes, into, scale)
    alone = surface.of.evaluate(surface.motion, betas).points
    return [surface.points, alone, *into.values(), *surface.adjoint(scale.reshape(-1, 3))]


def vertex_code(functions: Mapping[str, cs.Function], parents: tuple[int, ...], B: int) -> str:
    """The whole source, for this tree and B betas: the kernels, and loops around them."""
    K = len(parents)
    sizes: dict[str, int | str] = {
        "PARENTS": "{" + ", ".join(map(str, parents)) + "}",
        "JOINTS": K,
        "BETAS": B,
        "SHAPEDIRS": 3,
        "WEIGHTS": 3 + 3 * B,
        "ROWS": 3 + 3 * B + K,
        "FEATURES": B,
        "MOTIONS": B + 9 * (K - 1),
        "CENTRES": B + 9 * (K - 1) + 12 * K,
        "OF_JOINTS": B + 9 * (K - 1) + 15 * K,
        "OF_JOINT": OF_JOINT,
        "OF_BETAS": B + 9 * (K - 1) + (15 + OF_JOINT) * K,
    }
    loops = files(__package__).joinpath("vertex_loops.c").read_text(encoding="utf-8")
    defines = [f"#define {name} {size}" for name, size in sizes.items()]
    kernels = [kernel(f, "+=" if name in ADDED else "=") for name, f in functions.items()]
    return "\n".join([vectors(), *defines, *kernels, loops])


def kernel(function: cs.Function, put: str = "=") -> str:
    """A function as C for several vertices; the input called `motion` is the same for all.

    `put` says whether outputs are set or, with `+=`, added to what is there.
    Raises NotSupported for any operation but sums and products.
    """
    shared = [function.name_in(i) == "motion" for i in range(function.n_in())]
    lines = [
        f"{to} {put} {text.format(*of)};"
        if to.startswith("o")
        else f"const v {to} = {text.format(*of)};"
        for to, of, text in statements(function, shared, SUMS_AND_PRODUCTS)
    ]
    inputs = [
        f"const {'double' if same else 'anywhere'} *restrict i{i}" for i, same in enumerate(shared)
    ]
    head = f"static ALWAYS_INLINE void {function.name()}({', '.join(inputs)}, v *restrict o0)"
    return "\n".join([head, "{", *lines, "}", ""])


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
        library: ctypes.CDLL,
        arrays: SurfaceArrays,
        parents: tuple[int, ...],
        vertices: slice | list[int],
    ) -> CompiledArithmetic:
        """A body's vertices, or some of them, in order."""
        return CompiledArithmetic(
            library, PackedVertices.of(arrays, parents, vertices, int(library.lanes()))
        )

    def evaluate(self, motion: Motion, betas: Array) -> CompiledSurface:
        """The surface moved by a motion, of the person with these betas (B,)."""
        return CompiledSurface(self, motion, betas)

    def run(self, name: str, numbers: Array, *words: int | None) -> None:
        """A function of the library, for all vertices; `words` are addresses or integers."""
        shared = _address(self.packed.structure), _address(numbers)
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
        found = np.empty((self.of.packed.count, 3))
        self.of.run("points", motion_column(self.motion, self.betas), _address(found))
        return found

    def tangent(self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into[name] (size, 3 N); keep the points as well."""
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        copied: list[tuple[Array, Array]] = []  # what the library cannot write to, and room for it
        tables = {name: _addresses(Rows.of(target), copied) for name, target in into.items()}
        found = None if "points" in self.__dict__ else np.empty((self.of.packed.count, 3))
        column = motion_column(self.motion, self.betas, slopes)
        wanted = (factor, *(tables.get(name) for name in BLOCKS), found)
        self.of.run("tangent", column, *(None if a is None else _address(a) for a in wanted))
        if found is not None:
            self.__dict__["points"] = found  # as if they had been asked for
        for array, room in copied:
            array[...] = room

    def adjoint(self, pull: Array) -> tuple[Array, Array, Array]:
        """The gradients of sum(pull * points), pull (N, 3), by G, the features and betas."""
        (K, B), features = self.of.packed.sizes, len(self.motion.features)
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


def _address(array: NDArray[np.generic]) -> int:
    return int(array.ctypes.data)
