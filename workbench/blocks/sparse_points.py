"""Points whose derivative by some blocks is sparse, and whose source knows where it is zero.

The derivative of N points by a block of n numbers is a matrix (3 N, n), whose rows are x, y, z of
point after point. It is sparse by structure where each number moves few of the points: a vertex of
the template moves itself, a frame's pose moves the points of this frame.
"""

from typing import Protocol, cast

from scipy.sparse import csc_array

from workbench.blocks.points import NumericPoints, PointsAt


class SparsePoints(Protocol):
    """What NumericPoints may provide in addition: where a derivative can be nonzero."""

    def pattern(self, name: str) -> csc_array | None:
        """Where the points' derivative by a block can be nonzero at any values, (3 N, size).

        The numbers that are stored in it have no meaning; each entry is stored once. None for a
        block by which the derivative is dense. By a block that has a pattern, the points at one set
        of values are asked for `jacobian`, and never for `tangent`.
        """


class SparsePointsAt(Protocol):
    """What PointsAt of such points provide in addition."""

    def jacobian(self, name: str) -> csc_array:
        """The points' derivative by a block that has a pattern, (3 N, size), each entry once.

        It has no nonzeros outside of the pattern, and may leave out zeros inside of it.
        """


def pattern_of(source: NumericPoints, name: str) -> csc_array | None:
    """Where the points' derivative by a block can be nonzero; None if it is dense."""
    if not hasattr(source, "pattern"):
        return None
    return cast(SparsePoints, source).pattern(name)


def jacobian_of(here: PointsAt, name: str) -> csc_array:
    """The sparse derivative by a block of which `pattern_of` has a pattern, (3 N, size)."""
    return cast(SparsePointsAt, here).jacobian(name)
