"""The normal equations of a Jacobian with many rows: J'J and J'r in one pass, by compiled code.

BLAS multiplies with the zeros too, and for some 100 columns it reaches half of what the processor
can do. The columns of a posed mesh are zero wherever a joint leaves the vertices alone, which is
in half of all places of an embedded body; `gram.c` leaves them out, block by block of rows.
"""

from __future__ import annotations

import ctypes
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from workbench.arrays import Array
from workbench.compiling import library_or_none, source_beside, vectors

NAME = "normal-equations"
MANY = 2e7  # multiplications, m n^2: below, BLAS is as fast as a call of anything else
WIDEST = 200  # columns: beyond, their sums do not stay near the processor (measured)
LINE = 64  # bytes of a cache line
TRIED = 301, 13  # rows and columns that the library is tried on: two full blocks and a part


def normal_equations(J: object, r: Array) -> tuple[Array, Array] | None:
    """J'J (n, n) and J'r (n,), for J (m, n) and r (m,); None where they come from elsewhere.

    That is so where J is small, is no array that is stored column by column, or nothing can be
    compiled.
    """
    if not isinstance(J, np.ndarray):
        return None
    m, n = J.shape
    if J.strides[0] != 8 or J.dtype != np.float64 or m != len(r) or not worthwhile(m, n):
        return None
    way = compiled()
    return None if way is None else way.products(J, np.ascontiguousarray(r, dtype=np.float64))


def worthwhile(m: int, n: int) -> bool:
    """Whether a Jacobian (m, n) is large enough, and not too wide."""
    return n <= WIDEST and m * n * n >= MANY


@cache
def compiled() -> CompiledGram | None:
    """The compiled products, loaded once per process; None where there is no compiler."""
    source = "\n".join([vectors(), source_beside(__package__, "gram.c")])
    loaded = library_or_none(NAME, source, _agrees, "normal equations are computed by BLAS")
    return None if loaded is None else CompiledGram(loaded)


@dataclass(frozen=True, eq=False)
class CompiledGram:
    """Products of columns by the functions of `gram.c`.

    Attributes:
        library: the compiled functions.
    """

    library: ctypes.CDLL
    _rooms: list[Array] = field(default_factory=list)  # memory that is used again

    def products(self, J: Array, r: Array) -> tuple[Array, Array]:
        """J'J (n, n) and J'r (n,), for J (m, n) stored column by column and r (m,)."""
        m, n = J.shape
        columns = np.empty(n + 1, dtype=np.intp)
        columns[:n] = J.ctypes.data + J.strides[1] * np.arange(n)
        columns[n] = r.ctypes.data
        room = self._room(n + 1)
        begin = room.ctypes.data + -room.ctypes.data % LINE
        found = np.empty((n + 1, n + 1))
        words = m, n + 1, columns.ctypes.data, begin, found.ctypes.data
        self.library.gram(*map(ctypes.c_ssize_t, words))
        self._rooms.append(room)
        return found[:n, :n].copy(), found[:n, n].copy()

    def _room(self, n: int) -> Array:
        """Memory for sums and packed columns, from a run before if that was not for fewer."""
        self.library.room_for.restype = ctypes.c_ssize_t
        size = self.library.room_for(ctypes.c_ssize_t(n)) + LINE // 8
        with suppress(IndexError):
            room = self._rooms.pop()  # at once, whatever other threads do
            if len(room) >= size:
                return room
        return np.empty(size)


def _agrees(loaded: ctypes.CDLL) -> bool:
    """Whether the library says what BLAS says, about random columns that are zero in some rows."""
    rng, (m, n) = np.random.default_rng(0), TRIED
    J, r = rng.standard_normal((n, m)).T, rng.standard_normal(m)
    J[: m // 2, : n // 2] = 0.0
    normal, gradient = CompiledGram(loaded).products(J, r)
    close = np.allclose(normal, J.T @ J, rtol=0, atol=1e-12 * m)
    return close and np.allclose(gradient, J.T @ r, rtol=0, atol=1e-12 * m)
