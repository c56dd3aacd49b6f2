"""What follows from the pattern of a Jacobian alone: the structural rank and its parts.

Dulmage and Mendelsohn (Coverings of bipartite graphs, 1958) cut any pattern into three parts by a
maximum matching of rows with columns.
"""

from dataclasses import dataclass, field
from itertools import combinations

import casadi as cs
import numpy as np
from numpy.linalg import norm
from scipy.sparse import csc_array, vstack

from workbench.arrays import Index
from workbench.problem import Linearization, Problem
from workbench.problem.sparsity import columns_of_nonzeros
from workbench.problem.storage import distance


@dataclass(frozen=True)
class TermBlock:
    """One residual's part of the Jacobian in one block's columns.

    Attributes:
        residual: the residual's name.
        block: the block's name.
        rows: how many rows the residual has.
        columns: how many free numbers the block has.
        nonzeros: how many entries can be nonzero.
        norm: the Frobenius norm in the whitened Jacobian.
    """

    residual: str
    block: str
    rows: int
    columns: int
    nonzeros: int
    norm: float


@dataclass(frozen=True, eq=False)
class Submatrix:
    """A part of the decomposition.

    Attributes:
        rows: the indices of its rows.
        columns: the indices of its columns.
    """

    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class Structure:
    """The pattern (m, n), and what follows from it.

    Rows of active constraints follow the m rows of the residuals: they determine unknowns as well,
    so they count in the rank and in the three parts.

    Attributes:
        pattern: (m, n) where the Jacobian can be nonzero.
        rank: the structural rank, the largest rank that a matrix with this pattern can have.
        under: the under-determined part, with more columns than rows.
        square: the well-determined part, with as many rows as columns.
        over: the over-determined part, with more rows than columns.
        unread: the columns on which no residual and no active constraint depends.
        idle: the rows that depend on no unknown.
    """

    pattern: csc_array = field(repr=False)
    rank: int
    under: Submatrix
    square: Submatrix
    over: Submatrix
    unread: Index
    idle: Index


def decomposed(residuals: csc_array, held: csc_array | None = None) -> Structure:
    """A pattern (m, n), cut by Dulmage's and Mendelsohn's decomposition.

    The rows of `held` (k, n) are those of bounds and constraints, below the others.
    """
    pattern = residuals
    if held is not None and held.shape[0]:
        pattern = csc_array(vstack([residuals, held]))
    reads = np.bincount(pattern.indices, minlength=pattern.shape[0])
    kept = _rows_that_suffice(pattern, reads)
    part = csc_array(pattern[kept])
    n = pattern.shape[1]
    S = cs.Sparsity(*part.shape, part.indptr.tolist(), part.indices.tolist())
    # rows in the order unmatched | over | square | under, columns over | square | under | unmatched
    _, p, q, _, _, row_edges, column_edges = S.btf()
    p, q = kept[np.array(p, dtype=np.int64)], np.array(q, dtype=np.int64)
    r, c = list(row_edges), list(column_edges)
    others = np.setdiff1d(np.arange(pattern.shape[0]), kept)
    return Structure(
        residuals,
        rank=n - (c[4] - c[3]),
        over=Submatrix(np.sort(np.concatenate([p[r[0] : r[2]], others])), np.sort(q[c[0] : c[1]])),
        square=Submatrix(np.sort(p[r[2] : r[3]]), np.sort(q[c[1] : c[2]])),
        under=Submatrix(np.sort(p[r[3] : r[4]]), np.sort(q[c[2] : c[4]])),
        unread=np.flatnonzero(np.diff(pattern.indptr) == 0),
        idle=np.flatnonzero(reads[: residuals.shape[0]] == 0),
    )


def _rows_that_suffice(pattern: csc_array, reads: Index) -> Index:
    """The rows that suffice for the decomposition, rising.

    Of all rows that read the same k columns at most k can be matched: k + 1 of them are enough.
    """
    weights = np.random.default_rng(0).random(pattern.shape[1])[columns_of_nonzeros(pattern)]
    keys = np.bincount(pattern.indices, weights, pattern.shape[0])  # one for each set of columns
    order = np.argsort(keys, kind="stable")
    new = np.concatenate([[True], np.diff(keys[order]) != 0])[: len(keys)]
    first = np.maximum.accumulate(np.where(new, np.arange(len(keys)), 0))
    before = np.empty(len(keys), dtype=np.int64)  # how many rows of the same kind
    before[order] = np.arange(len(keys)) - first
    return np.flatnonzero(before <= reads)


def term_blocks(
    problem: Problem, structure: Structure, here: Linearization
) -> tuple[TermBlock, ...]:
    """One entry for every residual and every block: the Jacobian as a table."""
    return tuple(
        TermBlock(
            term,
            block,
            rows.stop - rows.start,
            columns.stop - columns.start,
            int(structure.pattern[:, columns][rows].nnz),
            here.block(rows, columns).norm,
        )
        for term, rows in problem.rows.items()
        for block, columns in problem.free.slices.items()
    )


def duplicates(problem: Problem, here: Linearization) -> tuple[tuple[str, str], ...]:
    """Pairs of residuals with equal rows, up to one factor and the sign, at this point.

    Where both residuals are zero here, they must also read the same blocks.
    """
    pairs = []
    reads = {residual.name: set(residual.reads) for residual in problem.residuals}
    for (name, rows), (other, others) in combinations(problem.rows.items(), 2):
        if rows.stop - rows.start != others.stop - others.start:
            continue
        # a residual of zero does not distinguish one measurement from another
        comparable = np.any(here.residual[rows]) or reads[name] == reads[other]
        if comparable and _same(here, rows, others):
            pairs.append((name, other))
    return tuple(pairs)


def _same(here: Linearization, rows: slice, others: slice) -> bool:
    every = slice(0, here.shape[1])
    a, b = here.block(rows, every), here.block(others, every)
    r, s = here.residual[rows], here.residual[others]
    if not a.norm or not b.norm:
        return False
    size, other_size = float(np.hypot(a.norm, norm(r))), float(np.hypot(b.norm, norm(s)))
    for factor in (1 / other_size, -1 / other_size):
        of_jacobians = distance(a.jacobian, 1 / size, b.jacobian, factor)
        if np.hypot(of_jacobians, norm(r / size - s * factor)) < 1e-10:
            return True
    return False
