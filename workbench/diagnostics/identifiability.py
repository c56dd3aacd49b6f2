"""What is known of each number, and from whom: Laplace's approximation, the data and the priors.

With J_d the data's rows and J_p the priors', (J_d; J_p) = (Q_d; Q_p) R, and the singular values
c of Q_d say of every direction which share of its information comes from the data: c^2 = 1 where
the priors say nothing, 0 where only they do. Their sum is the number of directions that the data
really decide, the effective degrees of freedom.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Layout
from workbench.diagnostics.held import Tied
from workbench.problem import Linearization

Array = NDArray[np.float64]
UNCHANGED = 0.9  # posterior over prior sigma from which on the data have told nothing


class Verdict(Enum):
    """How well one entry is known; the value says what it means."""

    STRUCTURAL = "no residual reads it, or too few rows read it and its neighbours"
    NUMERICAL = "it takes part in a direction that no residual notices"
    PRACTICAL = "the residuals notice it, but know it no better than its prior or its yardstick"
    IDENTIFIED = "known"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Per entry of the free vector, at one point. Sigmas are in the entries' own units."""

    sigma: Array  # (n,) posterior; infinite where the null space takes part
    prior_sigma: Array  # (n,) by the priors alone; infinite where they say nothing
    correlations: tuple[tuple[int, int, float], ...]  # the strongest, largest first
    data_share: Array = field(repr=False)  # c^2 (rank,), falling
    verdicts: tuple[Verdict, ...] = field(repr=False)

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
    tied: Tied, prior_rows: NDArray[np.bool_], prior: Array, yardsticks: Array,
    unread: NDArray[np.int64], under: NDArray[np.int64],
) -> Identifiability:  # fmt: skip
    """Which entries are known; `prior_rows` (m,) says which rows are priors.

    An entry is held against what the priors alone say of it, `prior` (n,), or against its
    yardstick (n,) where they say nothing.
    """
    sigma, half = tied.laplace
    blind = np.isinf(sigma)
    share = _data_share(tied.here, prior_rows, half)
    verdicts = _verdicts(sigma, prior, yardsticks, blind, unread, under)
    return Identifiability(sigma, prior, _correlated(half, blind), share, verdicts)


def _data_share(here: Linearization, prior_rows: NDArray[np.bool_], half: Array) -> Array:
    if not prior_rows.any():
        return np.ones(half.shape[1])
    from_priors = here.rows(np.flatnonzero(prior_rows)).along(half)  # Q_p, rotated
    left = np.linalg.eigvalsh(from_priors.T @ from_priors)  # 1 - c^2, rising
    return np.asarray(np.clip(1 - left, 0.0, 1.0))


def prior_sigma(here: Linearization, prior_rows: NDArray[np.bool_]) -> Array:
    """What the priors alone say of each entry (n,), infinite where they say nothing."""
    sigma = np.full(here.shape[1], np.inf)
    if not prior_rows.any():
        return sigma
    rows = here.rows(np.flatnonzero(prior_rows))
    read = np.flatnonzero(rows.column_norms)
    sigma[read] = Tied(rows.columns(read), np.zeros((0, read.size))).laplace[0]
    return sigma


def _verdicts(
    sigma: Array, prior: Array, yardsticks: Array, blind: NDArray[np.bool_],
    unread: NDArray[np.int64], under: NDArray[np.int64],
) -> tuple[Verdict, ...]:  # fmt: skip
    structural = np.zeros(sigma.size, dtype=bool)
    structural[unread] = True
    structural[under] |= blind[under]
    told = np.where(np.isfinite(prior), sigma < UNCHANGED * prior, sigma < yardsticks)
    return tuple(
        Verdict.STRUCTURAL if structural[i]
        else Verdict.NUMERICAL if blind[i]
        else Verdict.IDENTIFIED if told[i]
        else Verdict.PRACTICAL
        for i in range(sigma.size)
    )  # fmt: skip


def _correlated(half: Array, blind: NDArray[np.bool_], most: int = 20) -> tuple[
    tuple[int, int, float], ...
]:  # fmt: skip
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
    """What one residual adds to all the others."""

    term: str
    rank_without: int
    rank_with: int
    singular_values_without: Array = field(repr=False)
    singular_values_with: Array = field(repr=False)
    sigma_without: Mapping[str, float] = field(repr=False)  # by block: root mean square of sigma
    sigma_with: Mapping[str, float] = field(repr=False)


def contributions(tied: Tied, rows: Mapping[str, slice], free: Layout) -> tuple[Contribution, ...]:
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


def _known(tied: Tied, free: Layout) -> tuple[Array, int, dict[str, float]]:
    if not tied.here.shape[0]:
        return np.zeros(0), tied.count, dict.fromkeys(free.names, np.inf)
    variance = tied.laplace[0] ** 2
    rms = {name: float(np.sqrt(np.mean(variance[at]))) for name, at in free.slices.items()}
    return tied.reduced.spectrum.s, tied.rank, rms
