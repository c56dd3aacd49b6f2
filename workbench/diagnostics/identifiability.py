"""Each unknown's standard deviation, and where the information comes from: data or priors.

Standard deviations are those of Laplace's approximation.

With J_d the data's rows and J_p the priors', (J_d; J_p) = (Q_d; Q_p) R, and the singular values c
of Q_d are, for every direction, the root of the share of its information that comes from the data:
c^2 is 1 where the priors say nothing, and 0 where the data say nothing. The sum of c^2 is the
effective number of degrees of freedom, the directions that the data determine.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.problem import Linearization
from workbench.problem.storage import unblocked
from workbench.threads import limited_threads

MOST_CORRELATIONS = 20  # that are listed
STRONG_CORRELATION = 0.5  # size from which on one is listed
UNCHANGED = 0.9  # posterior over prior sigma from which on the data added nothing


class EntryIdentifiability(Enum):
    """How well one entry is identified; the value says what that means."""

    STRUCTURAL = "no residual depends on it, or too few rows depend on it and its neighbours"
    NUMERICAL = "it takes part in a null direction"
    PRACTICAL = (
        "the residuals depend on it, but its sigma is not below 0.9 of its prior's, or of a "
        "characteristic scale without a prior"
    )
    IDENTIFIED = "the residuals determine it"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Per entry of the free vector, at one point. Sigmas are in the entries' own units.

    Attributes:
        sigma: (n,) posterior standard deviations; infinite where a null direction takes part.
        prior_sigma: (n,) standard deviations by the priors alone; infinite where they say nothing.
        correlations: pairs of entries and their correlation, the strongest first; none where a
            sparse Jacobian was factorized.
        data_share: c^2 (rank,), falling: the data's share of the information on each direction,
            from 1 (the data alone) to 0 (the priors alone);
            None where a sparse Jacobian was factorized, without singular values.
        effective: effective degrees of freedom: how many directions the data decide, the sum of
            c^2.
        better_from_data: how many directions the data determine better than the priors do.
        verdicts: how well each entry is identified.
    """

    sigma: Array
    prior_sigma: Array
    correlations: tuple[tuple[int, int, float], ...]
    data_share: Array | None = field(repr=False)
    effective: float
    better_from_data: int
    verdicts: tuple[EntryIdentifiability, ...] = field(repr=False)

    @property
    def shrinkage(self) -> Array:
        """Posterior over prior sigma (n,): 0 without a prior, 1 where the data add nothing."""
        both = np.isfinite(self.sigma) & np.isfinite(self.prior_sigma)
        ratio = np.zeros_like(self.sigma)
        ratio[both] = self.sigma[both] / self.prior_sigma[both]
        ratio[~np.isfinite(self.sigma)] = 1.0
        return np.asarray(ratio)


def identifiability(
    constrained: ConstrainedJacobian,
    prior_rows: Mask,
    prior: Array,
    scales: Array,
    unread: Index,
    under: Index,
) -> Identifiability:
    """How well each entry is known; `prior_rows` (m,) says which rows are priors.

    The standard deviation of an entry is compared with that by the priors alone, `prior` (n,), or
    with its characteristic scale (n,) where no prior determines it. Whether an entry takes part in
    a null direction is also judged in these scales, so that units change no verdict. `unread` and
    `under` are the columns that nothing reads and those of the under-determined part.
    """
    sparse = constrained.sparse
    share: Array | None = None
    pairs: tuple[tuple[int, int, float], ...] = ()
    if sparse is not None:
        with limited_threads():
            sigma = np.sqrt(sparse.variances)
            decided = float(sparse.rank - len(sparse.forbidden))
            better = int(decided)
            if prior_rows.any():
                decided -= sparse.information_in(prior_rows)
                better = sparse.count_mostly_from(prior_rows)
    else:
        measured = constrained.measured(scales)
        sigma, half = measured.laplace
        pairs = _correlated(half, np.isinf(sigma))
        share = _data_share(measured.here, prior_rows, half)
        sigma = sigma * scales
        decided, better = float(share.sum()), int(np.sum(share > 0.5))
    verdicts = _verdicts(sigma, prior, scales, unread, under)
    return Identifiability(sigma, prior, pairs, share, decided, better, verdicts)


def _data_share(here: Linearization, prior_rows: Mask, half: Array) -> Array:
    if not prior_rows.any():
        return np.ones(half.shape[1])
    from_priors = here.rows(np.flatnonzero(prior_rows)).along(half)  # Q_p, rotated
    prior_share = np.linalg.eigvalsh(from_priors.T @ from_priors)  # 1 - c^2, rising
    return np.asarray(np.clip(1 - prior_share, 0.0, 1.0))


def sigma_of_priors(here: Linearization, prior_rows: Mask) -> Array:
    """Standard deviations by the priors alone (n,), infinite where they say nothing."""
    sigma = np.full(here.shape[1], np.inf)
    if not prior_rows.any():
        return sigma
    rows = here.rows(np.flatnonzero(prior_rows))
    read = np.flatnonzero(rows.column_norms)
    sigma[read] = 1 / rows.column_norms[read]
    if rows.estimated and csc_array(unblocked(rows.jacobian)).nnz == read.size:
        return sigma  # each row reads one of them
    unit = rows.columns(read).scaled(sigma[read])  # columns of length 1
    alone = ConstrainedJacobian(unit, np.zeros((0, read.size)))
    sparse = alone.sparse
    sigma[read] *= alone.laplace[0] if sparse is None else np.sqrt(sparse.variances)
    return sigma


def _verdicts(
    sigma: Array, prior: Array, scales: Array, unread: Index, under: Index
) -> tuple[EntryIdentifiability, ...]:
    null = np.isinf(sigma)
    structural = np.zeros(sigma.size, dtype=bool)
    structural[unread] = True
    structural[under] |= null[under]
    narrowed = np.where(np.isfinite(prior), sigma < UNCHANGED * prior, sigma < scales)
    verdicts = np.full(sigma.size, EntryIdentifiability.PRACTICAL, dtype=object)
    verdicts[narrowed] = EntryIdentifiability.IDENTIFIED
    verdicts[null] = EntryIdentifiability.NUMERICAL
    verdicts[structural] = EntryIdentifiability.STRUCTURAL
    return tuple(verdicts.tolist())


def _correlated(half: Array, null: Mask) -> tuple[tuple[int, int, float], ...]:
    known = np.flatnonzero(~null)
    rows = half[known] / np.maximum(np.linalg.norm(half[known], axis=1), 1e-300)[:, None]
    C = np.triu(rows @ rows.T, 1)
    order = np.argsort(-abs(C), axis=None)[:MOST_CORRELATIONS]
    pairs = [(int(a), int(b)) for a, b in zip(*np.unravel_index(order, C.shape), strict=True)]
    return tuple(
        (int(known[a]), int(known[b]), float(C[a, b]))
        for a, b in pairs
        if abs(C[a, b]) > STRONG_CORRELATION
    )


@dataclass(frozen=True, eq=False)
class Contribution:
    """What one residual adds to all the others.

    Attributes:
        residual: its name.
        rank_without: the rank of the problem without it.
        rank_with: the rank of the whole problem.
        sigma_without: by block, the root mean square of the standard deviations without it.
        sigma_with: the same for the whole problem.
    """

    residual: str
    rank_without: int
    rank_with: int
    sigma_without: Mapping[str, float] = field(repr=False)
    sigma_with: Mapping[str, float] = field(repr=False)


def contributions(
    constrained: ConstrainedJacobian, sizes: Array, rows: Mapping[str, slice], free: Layout
) -> tuple[Contribution, ...]:
    """What each residual contributes, found by leaving it out; nothing is solved again.

    What is known is judged with every unknown in its characteristic scale, `sizes` (n,).
    """
    m = constrained.here.shape[0]
    rank, sigma = _known(constrained, sizes, free)
    parts = []
    for residual, part in rows.items():
        others = np.delete(np.arange(m), part)
        rank_without, sigma_without = _known(constrained.only(others), sizes, free)
        parts.append(Contribution(residual, rank_without, rank, sigma_without, sigma))
    return tuple(parts)


def _known(
    constrained: ConstrainedJacobian, sizes: Array, free: Layout
) -> tuple[int, dict[str, float]]:
    """The rank, and by block the root mean square of the standard deviations."""
    if not constrained.here.shape[0]:
        return constrained.count, dict.fromkeys(free.names, np.inf)
    variance = (constrained.measured(sizes).laplace[0] * sizes) ** 2
    rms = {name: float(np.sqrt(np.mean(variance[part]))) for name, part in free.slices.items()}
    return constrained.rank, rms
