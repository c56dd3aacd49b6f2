"""How far columns are from parallel, and which ones make a Jacobian ill-conditioned."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.linalg import norm
from scipy.sparse import csc_array, triu

from workbench.arrays import Array, Index
from workbench.diagnostics.bases import sparsest
from workbench.problem import Linearization
from workbench.problem.storage import by_nonzeros

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

PARALLEL = 1e-8  # sine of the angle up to which columns are called parallel
NEARLY = 1e-3  # sine of the angle up to which columns are called nearly parallel
MOST = 20  # pairs, or entries of a direction, that are listed


@dataclass(frozen=True)
class ParallelPair:
    """Two columns that are nearly parallel.

    Attributes:
        first: the index of one.
        second: the index of the other.
        sine: the sine of the angle between them.
    """

    first: int
    second: int
    sine: float


@dataclass(frozen=True, eq=False)
class WeakestDirection:
    """A certificate of ill-conditioning: few columns that nearly cancel, and the rows that remain.

    |J d| is small although d has length 1; `columns` carry d, `rows` carry J d.

    Attributes:
        singular_value: the singular value, in sigmas per characteristic scale.
        vector: d (n,), in characteristic scales.
        change: |J d|, in sigmas.
        columns: the unknowns that make up most of d.
        rows: the rows that make up most of J d.
    """

    singular_value: float
    vector: Array
    change: float
    columns: tuple[int, ...]
    rows: tuple[int, ...]


def parallel_columns(here: Linearization, within: float = NEARLY) -> tuple[ParallelPair, ...]:
    """Pairs of columns whose angle has a sine of at most `within`, the nearest first."""
    norms = here.column_norms
    read = np.flatnonzero(norms > 1e-14 * norms.max(initial=0.0))
    least = np.sqrt(max(0.0, 1 - within**2)) - 1e-12
    i, j, cosine = _cosines(here, read, least)
    pairs = []
    for k in np.argsort(-cosine, kind="stable")[: 50 * MOST]:
        a, b = int(read[i[k]]), int(read[j[k]])
        # a sine, because cosines of 1e-9 and 1e-10 are equal; of J itself where R is an estimate
        x, y = (here.column(a), here.column(b)) if here.estimated else (here.R[:, a], here.R[:, b])
        x, y = x / norms[a], y / norms[b]
        pairs.append(ParallelPair(a, b, float(min(norm(x - y), norm(x + y)))))
    return tuple(sorted((p for p in pairs if p.sine <= within), key=lambda p: p.sine)[:MOST])


def _cosines(here: Linearization, read: Index, least: float) -> tuple[Index, Index, Array]:
    """Pairs of these columns whose cosine has a size above `least`: their places, and the size."""
    if here.estimated:
        unit = here.columns(read).scaled(1 / here.column_norms[read])
        normal = unit.normal  # in which most columns have no common row
        stored = csc_array(normal) if isinstance(normal, np.ndarray) else by_nonzeros(normal)
        products = triu(stored, 1).tocoo()
        size = abs(products.data)
        some = size > least
        return products.row[some], products.col[some], size[some]
    columns = here.R[:, read] / here.column_norms[read]
    cosines = np.triu(abs(columns.T @ columns), 1)
    i, j = np.nonzero(cosines > least)
    return i, j, cosines[i, j]


def weakest(d: "Diagnosis", most: int = 3) -> tuple[WeakestDirection, ...]:
    """The directions of the smallest singular values above the tolerance, under the constraints.

    Directions about as weak, within a factor of three, are separated into vectors that have few
    entries each, unless the Jacobian is sparse.
    """
    if d.sparse is not None:
        values, vectors = d.sparse.weakest(most)
        return tuple(
            _weak(d.sparse.here, float(s), v) for s, v in zip(values, vectors.T, strict=True)
        )
    constrained = d.measured
    s, Vt = constrained.reduced.spectrum.s, constrained.reduced.spectrum.Vt
    directions: list[WeakestDirection] = []
    k = constrained.reduced.spectrum.rank - 1
    while k >= 0 and len(directions) < most:
        group = np.flatnonzero(s[: k + 1] < 3 * s[k])[::-1]
        basis = Vt[group].T
        if 1 < group.size < 12:
            basis = sparsest(basis, np.zeros((len(basis), 0)))
        basis = constrained.tangent @ basis if len(constrained.rows) else basis
        for i, v in zip(group[: most - len(directions)], basis.T, strict=False):
            directions.append(_weak(constrained.here, float(s[i]), v))
        k -= group.size
    return tuple(directions)


def _weak(here: Linearization, singular_value: float, d: Array) -> WeakestDirection:
    moved = here.along(d)
    change = float(np.linalg.norm(moved))
    return WeakestDirection(singular_value, d, change, _main(d), _main(moved))


def _main(v: Array) -> tuple[int, ...]:
    """The few entries that make up nine tenths of a vector's square."""
    order = np.argsort(-abs(v))[:MOST]
    share = np.cumsum(v[order] ** 2) / max(float(v @ v), 1e-300)
    return tuple(int(i) for i in order[: int(np.searchsorted(share, 0.9)) + 1])


def leverage(here: Linearization) -> Array | None:
    """The leverage of each row, 0 to 1 (m,); they add up to the rank.

    A row of leverage 1 determines a direction alone. None where the Jacobian is sparse and large.
    """
    if here.estimated:
        return None
    if here.shape[0] < here.shape[1]:
        U, s, _ = here.svd
        return np.asarray(np.sum(U[:, s > here.spectrum.tolerance] ** 2, axis=1))
    s, seen = here.spectrum.determined
    if len(s) == here.shape[1]:
        Q = scipy.linalg.solve_triangular(here.R, here.dense.T, trans="T", lower=False)
        return np.asarray(np.sum(Q**2, axis=0))
    return np.asarray(np.sum(here.along_columns(seen.T / s).dense ** 2, axis=1))
