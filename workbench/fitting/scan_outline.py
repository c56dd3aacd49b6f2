"""The outline of a scan: where it is, however densely it was sampled, without clutter."""

import numpy as np

from workbench.arrays import Array, Index

MOST = 200_000  # points that are looked at
CELLS = 50  # cells along the longest side of the scan
SHARE = 0.1  # of the points of a usual cell: one with fewer is clutter
INNER = (1.0, 99.0)  # percentiles between which the scan's own size is looked for
SEED = 0


def outline(points: Array) -> Array:
    """The mean points (C, 3) of the cells that a scan (N, 3) fills; in the unit of the points.

    A cell with far fewer points than others is clutter. Dense and sparse regions count alike.
    """
    some = points
    if len(points) > MOST:
        some = points[np.random.default_rng(SEED).choice(len(points), MOST, replace=False)]
    means, cell, counts = means_of_cells(some, CELLS)
    enough = counts >= SHARE * np.median(counts[cell])
    return np.asarray(means[enough])


def means_of_cells(points: Array, along: int) -> tuple[Array, Index, Index]:
    """Means (C, 3) of the points (N, 3) in each cubic cell that holds some.

    There are `along` cells along the longest side of what holds 98 % of the points; points that are
    farther from it than it is long are left out. Also the cell of each point that is left, (M,),
    and how many points each cell holds, (C,). Points that are all at one place stay as they are.
    """
    low, high = np.percentile(points, INNER, axis=0)
    size = float((high - low).max())
    if not size > 0:
        return points, np.arange(len(points)), np.ones(len(points), dtype=np.int64)
    inside = points[((points > low - size) & (points < high + size)).all(axis=1)]
    numbers = np.floor((inside - low) / (size / along)).astype(np.int64)
    numbers -= numbers.min(axis=0)
    _, cell, counts = np.unique(
        np.ravel_multi_index(tuple(numbers.T), tuple(numbers.max(axis=0) + 1)),
        return_inverse=True,
        return_counts=True,
    )
    sums = np.stack([np.bincount(cell, inside[:, axis]) for axis in range(3)], axis=1)
    return np.asarray(sums / counts[:, None]), cell, counts


def principal_axes(cells: Array) -> Array:
    """Rows (3, 3): the direction along which an outline spreads most comes first."""
    return np.asarray(np.linalg.eigh(np.cov(cells.T))[1].T[::-1])
