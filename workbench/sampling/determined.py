r"""Numbers that linear equations tie to what is sampled: they follow it.

With A the Jacobian of the equations, c the chosen numbers and o the others that equations tie to
them, A_c dz + A_o do = 0 says by how much the others move with z. The points that meet equations
have no volume among all points, but they have one in z, and where the equations are linear it is
the same everywhere: the density of z is exp(-cost) on them, up to a constant.
"""

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument, some_of
from workbench.problem import Linearization, Problem
from workbench.sampling.subspace import Subspace, fixed

CANCELLED = 1e-13  # of the largest move: zero, but for rounding
ROUNDED = 1e-10  # of the length of a row: zero, but for rounding


def determined(problem: Problem, here: Linearization, x: Array, chosen: Index) -> Subspace:
    """Numbers that equations tie to the chosen numbers follow them; all others are fixed.

    The equations must be linear, which `sample` and `laplace` check, and must determine every
    number that follows. Raises BadArgument if they leave one of these undetermined, or restrict the
    chosen numbers.
    """
    space, there = fixed(problem, here, x, chosen), here.constraints
    if there is None:
        return space
    A = there.rows(there.lower == there.upper)
    lengths = np.linalg.norm(A, axis=1)
    A = A[lengths > 0] / lengths[lengths > 0, None]
    ties, others = _tied(A, chosen)
    labels = problem.free.labels_of
    A = A[ties]
    moves, _, rank, _ = np.linalg.lstsq(A[:, others], -A[:, chosen])
    if rank < len(others):
        raise BadArgument(
            f"the equations leave open how {some_of(labels(others))} follow: of these "
            f"{len(others)} numbers they tell {rank}. Name {len(others) - rank} more of them"
        )
    if (abs(A[:, others] @ moves + A[:, chosen]) > ROUNDED).any():
        raise BadArgument(
            f"the equations tie {some_of(labels(chosen))} to each other, so they cannot all "
            "be drawn; name fewer of them, and the others follow"
        )
    # what is left of sums that cancel would count as a way to move
    moves[abs(moves) <= CANCELLED * abs(moves).max(initial=0.0)] = 0.0
    space.along[others] = moves
    return space


def _tied(A: Array, chosen: Index) -> tuple[Mask, Index]:
    """The equations that read what moves, and the numbers beside the chosen ones that they read."""
    moving = np.zeros(A.shape[1], dtype=bool)
    moving[chosen] = True
    while True:
        ties = (A[:, moving] != 0).any(axis=1)
        grown = moving | (A[ties] != 0).any(axis=0)
        if (grown == moving).all():
            moving[chosen] = False
            return ties, np.flatnonzero(moving)
        moving = grown
