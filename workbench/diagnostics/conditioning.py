"""How far columns are from parallel, and which ones make a Jacobian ill-conditioned."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.linalg import norm
from scipy.sparse import csc_array, triu

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.problem.storage import by_nonzeros

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

PARALLEL = 1e-8  # sine of the angle up to which columns are called parallel
NEARLY_PARALLEL = 1e-3  # sine of the angle up to which columns are called nearly parallel
MOST_LISTED = 20  # pairs, or entries of a direction


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
    """Few columns that nearly cancel, and the rows that remain: d has length 1, |J d| is small.

    Attributes:
        vector: d (n,), in characteristic scales.
        change: |J d|, the singular value, in sigmas per characteristic scale.
        columns: the unknowns that make up most of d.
        rows: the rows that make up most of J d.
    """

    vector: Array
    change: float
    columns: tuple[int, ...]
    rows: tuple[int, ...]


def parallel_columns(
    here: Linearization, within: float = NEARLY_PARALLEL
) -> tuple[ParallelPair, ...]:
    """Pairs of columns whose angle has a sine of at most `within`, the nearest first."""
    norms = here.column_norms
    read = np.flatnonzero(norms > 1e-14 * norms.max(initial=0.0))
    normal = here.columns(read).scaled(1 / norms[read]).normal
    stored = csc_array(normal) if isinstance(normal, np.ndarray) else by_nonzeros(normal)
    cosines = triu(stored, 1).tocoo()
    near = abs(cosines.data) > np.sqrt(max(0.0, 1 - within**2)) - 1e-12
    i, j, size = cosines.row[near], cosines.col[near], abs(cosines.data[near])
    pairs = []
    for k in np.argsort(-size, kind="stable")[: 50 * MOST_LISTED]:
        a, b = int(read[i[k]]), int(read[j[k]])
        x, y = here.column(a) / norms[a], here.column(b) / norms[b]
        # a sine, because cosines of 1e-9 and 1e-10 are equal
        pairs.append(ParallelPair(a, b, float(min(norm(x - y), norm(x + y)))))
    return tuple(sorted((p for p in pairs if p.sine <= within), key=lambda p: p.sine)[:MOST_LISTED])


def weakest(d: "Diagnosis", most: int = 3) -> tuple[WeakestDirection, ...]:
    """The directions of the smallest singular values above the tolerance, under the constraints."""
    if d.sparse is not None:
        here, vectors = d.sparse.here, d.sparse.weakest(most)[1]
    else:
        here, spectrum = d.measured.here, d.measured.reduced.spectrum
        smallest = slice(max(0, spectrum.rank - most), spectrum.rank)
        vectors = spectrum.Vt[smallest][::-1].T
        vectors = d.measured.tangent @ vectors if len(d.measured.rows) else vectors
    directions = []
    for v in vectors.T:
        change = here.along(v)
        directions.append(WeakestDirection(v, float(norm(change)), _main(v), _main(change)))
    return tuple(directions)


def _main(v: Array) -> tuple[int, ...]:
    """The few entries that make up nine tenths of a vector's square."""
    order = np.argsort(-abs(v))[:MOST_LISTED]
    share = np.cumsum(v[order] ** 2) / max(float(v @ v), 1e-300)
    return tuple(int(i) for i in order[: int(np.searchsorted(share, 0.9)) + 1])
