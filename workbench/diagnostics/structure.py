"""What the pattern of a Jacobian alone allows: who reads what, and what cannot be determined.

Dulmage and Mendelsohn (Coverings of bipartite graphs, 1958) cut any pattern into three parts by a
maximum matching of rows with columns: an under-determined part with more columns than rows, an
over-determined one with more rows than columns, and a square one between them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.linalg import norm
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, vstack

from workbench.arrays import Array, Index
from workbench.blocks import Layout, Tree
from workbench.bodies.forward.sources import JointPoints, LandmarkPoints, SurfacePoints
from workbench.problem import Linearization, Problem
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
    """Rows and columns of a part of the decomposition, by their indices."""

    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class Structure:
    """The pattern (m, n), and what follows from it.

    Rows of constraints that hold come after the m of the residuals: they decide unknowns as well,
    so they count in the rank and in the three parts.

    Attributes:
        pattern: (m, n) where the Jacobian can be nonzero.
        rank: the structural rank, the largest rank that a matrix with this pattern can have.
        under: the under-determined part, with more columns than rows.
        square: the well-determined part, with as many rows as columns.
        over: the over-determined part, with more rows than columns.
        unread: the columns that no residual and no active constraint reads.
        idle: the rows that read nothing that is free.
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
    reads = _counts(pattern)
    kept = _enough(pattern, reads)
    m, n = len(kept), pattern.shape[1]
    place = np.full(pattern.shape[0], -1)
    place[kept] = np.arange(m)
    rows = [place[pattern.indices[i:j]] for i, j in pairwise(pattern.indptr.tolist())]
    rows = [some[some >= 0] for some in rows]
    starts = np.cumsum([0, *(len(some) for some in rows)])
    S = cs.Sparsity(m, n, starts.tolist(), [row for some in rows for row in some.tolist()])
    # rows in the order unmatched | over | square | under, columns over | square | under | unmatched
    _, p, q, _, _, row_edges, column_edges = S.btf()
    p, q = kept[np.array(p, dtype=np.int64)], np.array(q, dtype=np.int64)
    r, c = list(row_edges), list(column_edges)
    left = np.setdiff1d(np.arange(pattern.shape[0]), kept)
    return Structure(
        residuals,
        rank=n - (c[4] - c[3]),
        over=Submatrix(np.sort(np.concatenate([p[r[0] : r[2]], left])), np.sort(q[c[0] : c[1]])),
        square=Submatrix(np.sort(p[r[2] : r[3]]), np.sort(q[c[1] : c[2]])),
        under=Submatrix(np.sort(p[r[3] : r[4]]), np.sort(q[c[2] : c[4]])),
        unread=np.flatnonzero(np.diff(pattern.indptr) == 0),
        idle=np.flatnonzero(reads[: residuals.shape[0]] == 0),
    )


def _counts(pattern: csc_array) -> Index:
    """How many columns each row reads, (m,)."""
    found = np.zeros(pattern.shape[0], dtype=np.int64)
    for start, stop in pairwise(pattern.indptr.tolist()):
        found[pattern.indices[start:stop]] += 1
    return found


def _enough(pattern: csc_array, reads: Index) -> Index:
    """The rows that decide how the pattern comes apart, rising.

    Of rows that read the same k columns no more than k can be matched. So k + 1 of them are
    enough: one of these is left over, and the others that are not looked at belong where it does.
    """
    keys = np.zeros(pattern.shape[0])  # one for each set of columns
    weights = np.random.default_rng(0).random(pattern.shape[1])
    for weight, (start, stop) in zip(weights, pairwise(pattern.indptr.tolist()), strict=True):
        keys[pattern.indices[start:stop]] += weight
    order = np.argsort(keys, kind="stable")
    new = np.concatenate([[True], np.diff(keys[order]) != 0])[: len(keys)]
    first = np.maximum.accumulate(np.where(new, np.arange(len(keys)), 0))
    before = np.empty(len(keys), dtype=np.int64)  # how many rows of the same kind
    before[order] = np.arange(len(keys)) - first
    return np.flatnonzero(before <= reads)


def term_blocks(
    problem: Problem, structure: Structure, here: Linearization
) -> tuple[TermBlock, ...]:
    """The Jacobian as a table of terms by blocks."""
    found = structure.pattern
    edges = [(rows.start, rows.stop) for rows in problem.rows.values()]
    counts = np.zeros((found.shape[1], len(edges)), dtype=np.int64)
    for column, (start, stop) in enumerate(pairwise(found.indptr.tolist())):
        low, high = np.searchsorted(found.indices[start:stop], edges).T
        counts[column] = high - low
    return tuple(
        TermBlock(
            term,
            block,
            rows.stop - rows.start,
            columns.stop - columns.start,
            int(counts[columns, k].sum()),
            here.block(rows, columns).norm,
        )
        for k, (term, rows) in enumerate(problem.rows.items())
        for block, columns in problem.free.slices.items()
    )


def duplicates(problem: Problem, here: Linearization) -> tuple[tuple[str, str], ...]:
    """Pairs of residuals that say the same: equal rows, up to one factor and the sign.

    Seen at this point only. Where both are zero here, they have to read the same blocks as well.
    """
    found = []
    reads = {residual.name: set(residual.reads) for residual in problem.residuals}
    terms = list(problem.rows.items())
    for i, (name, rows) in enumerate(terms):
        for other, others in terms[i + 1 :]:
            if rows.stop - rows.start != others.stop - others.start:
                continue
            # a residual of zero does not tell one measurement from another
            told = np.any(here.residual[rows]) or reads[name] == reads[other]
            if told and _same(here, rows, others):
                found.append((name, other))
    return tuple(found)


def _same(here: Linearization, rows: slice, others: slice) -> bool:
    every = slice(0, here.shape[1])
    a, b = here.block(rows, every), here.block(others, every)
    r, s = here.residual[rows], here.residual[others]
    size, other = float(np.hypot(a.norm, norm(r))), float(np.hypot(b.norm, norm(s)))
    if not a.norm or not b.norm:
        return False
    return any(
        np.hypot(
            distance(a.jacobian, 1 / size, b.jacobian, sign / other),
            norm(r / size - sign * s / other),
        )
        < 1e-10
        for sign in (1, -1)
    )


def pose_moves_template(problem: Problem) -> bool:
    """Whether a free pose moves the surface of a body that has pose blend shapes."""
    free = set(problem.free.names)
    sources = [p.source for residual in problem.residuals for p in residual.points]
    return any(
        isinstance(source, SurfacePoints | LandmarkPoints)
        and not free.isdisjoint(symbol.name() for symbol in cs.symvar(source.at.pose))
        and bool(source.at.body.posedirs.any())
        for source in sources
    )


def named_groups(layout: Layout, columns: Index) -> str:
    """Entries of a vector in few words: whole blocks by name, rows gathered."""
    said = []
    slices: Mapping[str, slice] = layout.slices
    for name, part in slices.items():
        inside = columns[(columns >= part.start) & (columns < part.stop)]
        if layout[name].whole is None and inside.size == part.stop - part.start:
            said.append(name if inside.size == 1 else f"all of {name}")
        elif inside.size:
            said.extend(gathered([layout.label(int(i)) for i in inside]))
    return ", ".join(said)


def counted(number: int, noun: str) -> str:
    """A number with its noun: `1 row`, `2 rows`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def named_rows(rows: Mapping[str, slice], chosen: Index) -> str:
    """Rows by their residuals, and how many of each."""
    counts = {
        name: int(np.sum((chosen >= part.start) & (chosen < part.stop)))
        for name, part in rows.items()
    }
    return ", ".join(f"{count} of {name}" for name, count in counts.items() if count)


def gathered(entries: list[str]) -> list[str]:
    """`pose[head, x]`, `pose[head, y]` as `pose[head, x y]`."""
    rows: dict[str, list[str]] = {}
    for entry in entries:
        row, comma, last = entry.removesuffix("]").rpartition(", ")
        rows.setdefault(row + comma, []).append(last if comma else entry)
    return [row + " ".join(last) + "]" if row else ", ".join(last) for row, last in rows.items()]


def only_joints(
    problem: Problem, at: Mapping[str, ArrayLike]
) -> tuple[Tree, Array, tuple[int, ...]] | None:
    """The tree, the posed joints (K, 3) m and which of them are read, if nothing else is there.

    None unless all residuals read the joints of one body, coordinate by coordinate, and nothing is
    free but its pose and perhaps its translation.
    """
    points = {p.symbol.__hash__(): p for r in problem.residuals for p in r.points}
    if len(points) != 1:
        return None
    (found,) = points.values()
    tree, free = found.source.tree, problem.free
    if tree is None or not tree.rigid_bones or found.labels != tree.names:
        return None
    if sum(p < 0 for p in tree.parents) != 1:
        return None
    poses = [block for block in free.blocks if block.name in tree.blocks]
    if not len(tree.turned(free)) == len(tree.names) == sum(block.size for block in poses) / 3:
        return None  # the law is of joints that turn freely, each by three numbers of its own
    if any(residual.weights is not None for residual in problem.residuals):
        return None  # a weight of zero hides a joint
    others = [block for block in free.blocks if block.name not in tree.blocks]
    if [block.shape for block in others] not in ([], [(3,)]) or free.parts:
        return None
    if isinstance(found.source, JointPoints) and others:
        maps = found.source.at.maps
        if maps is None or maps[2].plain != others[0].name:
            return None
    stacked = cs.vertcat(*[residual.expression for residual in problem.residuals])
    own = {s.name() for s in cs.symvar(stacked)} & set(free.names)
    if own:  # a prior, or a residual of another kind
        return None
    by_points = cs.jacobian_sparsity(stacked, found.symbol)
    starts, rows = by_points.get_ccs()
    reads = np.diff(starts).reshape(-1, 3)
    # the law counts whole positions: every coordinate read, each by rows of its own
    if len(set(rows)) != len(rows) or not np.isin(reads, (0, 1)).all():
        return None
    seen = reads.all(axis=1)
    if (reads.any(axis=1) != seen).any():
        return None
    value = cs.Function(
        "joints", [b.symbol for b in found.source.blocks], [found.source.expression]
    )
    joints = value(
        *(
            np.asarray(at[b.name], dtype=float).reshape(b.symbol_shape, order="F")
            if len(b.shape) < 2
            else np.asarray(at[b.name], dtype=float).T
            for b in found.source.blocks
        )
    )
    return tree, np.asarray(joints).T, tuple(int(k) for k in np.flatnonzero(seen))
