"""What is known about the unknowns that all frames of a sequence share."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout
from workbench.diagnostics.frame_rows import FrameRows
from workbench.diagnostics.null_space import WEAK
from workbench.diagnostics.sparse_bases import FRESH
from workbench.diagnostics.yardsticks import Yardsticks


@dataclass(frozen=True, eq=False)
class SharedUnknowns:
    """What T frames say about the b unknowns that they share.

    The rows of frame t are J_t x_t + B_t s. The projection P_t, orthogonal to the range of J_t,
    removes from them what the frame's own unknowns x_t can compensate. Unknown i is *seen* in frame
    t where the length of column i of P_t B_t is above the tolerance of the rank; it is seen *well*
    where a whole yardstick of it changes P_t B_t s by at least one sigma.

    Attributes:
        layout: the shared unknowns.
        yardsticks: the yardstick of each unknown.
        seen: (T, b) in which frames each unknown is seen.
        well: (T, b) in which frames each unknown is seen well.
        sigma: (b,) posterior standard deviations by all residuals; infinite where not identified.
        ranks: by block, its rank once all other unknowns are eliminated.
    """

    layout: Layout
    yardsticks: Yardsticks
    seen: Mask
    well: Mask
    sigma: Array
    ranks: dict[str, int]

    @staticmethod
    def of(
        rows: FrameRows, layout: Layout, sizes: Yardsticks, sigma: Array, null_vectors: csc_array
    ) -> "SharedUnknowns":
        """The shared unknowns of a sequence's rows and its null vectors (n, d)."""
        lengths = np.array(
            [
                _beside(R, len(own), rows.tolerance)
                for own, R in zip(rows.own, rows.triangles, strict=True)
            ]
        ).reshape(rows.count, len(rows.shared))
        per_unit = lengths * rows.lengths[rows.shared] * sizes.sizes
        hidden = null_vectors.tocsr()[rows.shared].toarray()
        ranks = {name: at.stop - at.start - _rank(hidden[at]) for name, at in layout.slices.items()}
        seen = lengths > rows.tolerance
        return SharedUnknowns(layout, sizes, seen, seen & (per_unit >= WEAK), sigma, ranks)

    @property
    def frames_seen(self) -> Index:
        """In how many frames each unknown is seen, (b,)."""
        return np.asarray(self.seen.sum(axis=0), dtype=np.int64)

    @property
    def frames_well(self) -> Index:
        """In how many frames each unknown is seen well, (b,)."""
        return np.asarray(self.well.sum(axis=0), dtype=np.int64)


def _beside(R: Array, own: int, tolerance: float) -> Array:
    """The lengths of the columns of P B, R = [J B] with `own` columns in J."""
    U, s, _ = np.linalg.svd(R[:, :own], full_matrices=False)
    U = U[:, s > tolerance]
    B = R[:, own:]
    return np.asarray(np.linalg.norm(B - U @ (U.T @ B), axis=0))


def _rank(A: Array) -> int:
    """The rank of parts of vectors of length 1."""
    return int(np.sum(np.linalg.svd(A, compute_uv=False) > FRESH)) if A.size else 0
