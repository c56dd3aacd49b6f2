"""Each unknown's standard deviation, and where the information comes from: data or priors.

Standard deviations are those of Laplace's approximation.

With J_d the data's rows and J_p the priors', (J_d; J_p) = (Q_d; Q_p) R, and the singular values
c of Q_d tell for every direction the share of its information that comes from the data: c^2 is 1
where the priors say nothing, and 0 where the data say nothing. The sum of c^2 is the effective
number of degrees of freedom, the directions that the data determine.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.problem import Linearization

UNCHANGED = 0.9  # posterior over prior sigma from which on the data have told nothing


class EntryIdentifiability(Enum):
    """How well one entry is identified; the value says what that means."""

    STRUCTURAL = "no residual depends on it, or too few rows depend on it and its neighbours"
    NUMERICAL = "it takes part in a null direction"
    PRACTICAL = "the residuals depend on it, but tell it no better than its prior or yardstick"
    IDENTIFIED = "the residuals determine it"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Per entry of the free vector, at one point. Sigmas are in the entries' own units.

    Attributes:
        sigma: (n,) posterior standard deviations; infinite where a null direction takes part.
        prior_sigma: (n,) standard deviations by the priors alone; infinite where they say nothing.
        correlations: pairs of entries and their correlation, the strongest first.
        data_share: c^2 (rank,), falling: the data's share of the information on each direction.
        verdicts: how well each entry is identified.
    """

    sigma: Array
    prior_sigma: Array
    correlations: tuple[tuple[int, int, float], ...]
    data_share: Array = field(repr=False)
    verdicts: tuple[EntryIdentifiability, ...] = field(repr=False)

    @property
    def effective(self) -> float:
        """Effective degrees of freedom: how many directions the data decide."""
        return float(self.data_share.sum())

    @property
    def better_from_data(self) -> int:
        """Directions better known from the data than from the priors."""
        return int(np.sum(self.data_share > 0.5))

    @property
    def shrinkage(self) -> Array:
        """Posterior over prior sigma (n,); 0 where there is no prior, 1 where nothing was told."""
        both = np.isfinite(self.sigma) & np.isfinite(self.prior_sigma)
        ratio = np.zeros_like(self.sigma)
        ratio[both] = self.sigma[both] / self.prior_sigma[both]
        ratio[~np.isfinite(self.sigma)] = 1.0
        return np.asarray(ratio)


def identifiability(
    tied: ConstrainedJacobian,
    prior_rows: Mask,
    prior: Array,
    yardsticks: Array,
    unread: Index,
    under: Index,
) -> Identifiability:
    """Which entries are known; `prior_rows` (m,) says which rows are priors.

    An entry is held against what the priors alone say of it, `prior` (n,), or against its
    yardstick (n,) where they say nothing.
    """
    sigma, half = tied.laplace
    blind = np.isinf(sigma)
    share = _data_share(tied.here, prior_rows, half)
    verdicts = _verdicts(sigma, prior, yardsticks, blind, unread, under)
    return Identifiability(sigma, prior, _correlated(half, blind), share, verdicts)


def _data_share(here: Linearization, prior_rows: Mask, half: Array) -> Array:
    if not prior_rows.any():
        return np.ones(half.shape[1])
    from_priors = here.rows(np.flatnonzero(prior_rows)).along(half)  # Q_p, rotated
    left = np.linalg.eigvalsh(from_priors.T @ from_priors)  # 1 - c^2, rising
    return np.asarray(np.clip(1 - left, 0.0, 1.0))


def prior_sigma(here: Linearization, prior_rows: Mask) -> Array:
    """What the priors alone say of each entry (n,), infinite where they say nothing."""
    sigma = np.full(here.shape[1], np.inf)
    if not prior_rows.any():
        return sigma
    rows = here.rows(np.flatnonzero(prior_rows))
    read = np.flatnonzero(rows.column_norms)
    sigma[read] = ConstrainedJacobian(rows.columns(read), np.zeros((0, read.size))).laplace[0]
    return sigma


def _verdicts(
    sigma: Array,
    prior: Array,
    yardsticks: Array,
    blind: Mask,
    unread: Index,
    under: Index,
) -> tuple[EntryIdentifiability, ...]:
    structural = np.zeros(sigma.size, dtype=bool)
    structural[unread] = True
    structural[under] |= blind[under]
    told = np.where(np.isfinite(prior), sigma < UNCHANGED * prior, sigma < yardsticks)
    return tuple(
        EntryIdentifiability.STRUCTURAL
        if structural[i]
        else EntryIdentifiability.NUMERICAL
        if blind[i]
        else EntryIdentifiability.IDENTIFIED
        if told[i]
        else EntryIdentifiability.PRACTICAL
        for i in range(sigma.size)
    )


def _correlated(half: Array, blind: Mask, most: int = 20) -> tuple[tuple[int, int, float], ...]:
    known = np.flatnonzero(~blind)
    rows = half[known] / np.maximum(np.linalg.norm(half[known], axis=1), 1e-300)[:, None]
    C = np.triu(rows @ rows.T, 1)
    order = np.argsort(-abs(C), axis=None)[:most]
    pairs = [(int(a), int(b)) for a, b in zip(*np.unravel_index(order, C.shape), strict=True)]
    return tuple(
        (int(known[a]), int(known[b]), float(C[a, b])) for a, b in pairs if abs(C[a, b]) > 0.5
    )


@dataclass(frozen=True, eq=False)
class Contribution:
    """What one residual adds to all the others.

    Attributes:
        residual: its name.
        rank_without: the rank of the problem without it.
        rank_with: the rank of the whole problem.
        singular_values_without: the singular values without it.
        singular_values_with: the singular values of the whole problem.
        sigma_without: by block, the root mean square of the standard deviations without it.
        sigma_with: the same for the whole problem.
    """

    residual: str
    rank_without: int
    rank_with: int
    singular_values_without: Array = field(repr=False)
    singular_values_with: Array = field(repr=False)
    sigma_without: Mapping[str, float] = field(repr=False)
    sigma_with: Mapping[str, float] = field(repr=False)


def contributions(
    tied: ConstrainedJacobian, rows: Mapping[str, slice], free: Layout
) -> tuple[Contribution, ...]:
    """Each residual left out in turn; nothing is solved again."""
    m = tied.here.shape[0]
    s, rank, sigma = _known(tied, free)
    found = []
    for term, part in rows.items():
        left = np.ones(m, dtype=bool)
        left[part] = False
        s0, rank0, sigma0 = _known(tied.only(np.flatnonzero(left)), free)
        found.append(Contribution(term, rank0, rank, s0, s, sigma0, sigma))
    return tuple(found)


def _known(tied: ConstrainedJacobian, free: Layout) -> tuple[Array, int, dict[str, float]]:
    if not tied.here.shape[0]:
        return np.zeros(0), tied.count, dict.fromkeys(free.names, np.inf)
    variance = tied.laplace[0] ** 2
    rms = {name: float(np.sqrt(np.mean(variance[at]))) for name, at in free.slices.items()}
    return tied.reduced.spectrum.s, tied.rank, rms
