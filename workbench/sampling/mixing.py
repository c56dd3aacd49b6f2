"""Whether draws may be believed: the verdict on a set of chains, and what to do about it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
import scipy.fft
import scipy.special

from workbench.arrays import Array
from workbench.environment import optional_library

CHAINS_AT_ONCE = 64  # in one transform
WINDOW = 5.0  # autocorrelation times: Sokal's compromise between bias and noise
LONG_TIMES = 50.0  # autocorrelation times that a chain must be long before its time is believed
SETTLED_TIMES = 20.0  # and where the time has settled, by what the first half alone says of it
SETTLED_GROWTH = 1.2  # of the time with twice the length: more, and it is still growing
MOST_R_HAT = 1.01  # Vehtari et al. 2021
R_HAT_APART = 1.05  # from which on ensembles are in different places
LEAST_DRAWS = 400.0  # effective ones
LEAST_ENSEMBLES = 4  # independent ones
UNLIKELY = 1e-3  # over all entries together: ensembles do not agree by chance
UNSETTLED_GROWTH = 1.4  # of the time with twice the length: it does not settle
GAUSSIAN_STEPS = 3.5  # per dimension, that differential evolution takes to forget a Gaussian
FAR_FROM_GAUSSIAN = 2.0  # times as long: no Gaussian's, and growing
LEAST_ACCEPTANCE = 0.01  # of the proposals
MARGIN = 1.3  # more steps than are needed if all estimates are right
FIRST_TIMES = 50.0  # autocorrelation times of a Gaussian: a first guess of what is needed
MANY_ENTRIES = 20  # that ensembles sample well
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)  # of which ensembles are compared


def integrated_time(draws: Array) -> float:
    """The integrated autocorrelation time in steps, at least 1 (Sokal 1997, emcee's window).

    Deviations are from the mean of everything, not of each walker: a walker that stays where it
    began has then an endless memory, as it should. Of constant draws it is infinite.
    """
    covariance, S = autocovariance(draws), draws.shape[1]
    if not covariance[0] > 0:
        return np.inf
    times = 2 * np.cumsum(covariance / covariance[0]) - 1
    inside = np.arange(S) < WINDOW * times
    window = int(np.argmin(inside)) if not inside.all() else S - 1
    return float(max(1.0, times[window]))


def autocovariance(draws: Array) -> Array:
    """The sum of products of deviations that are t steps apart, (S,), over all walkers.

    It is computed by the Fourier transform, padded so that the end does not meet the beginning.
    """
    S = draws.shape[1]
    deviations = (draws - draws.mean()).transpose(0, 2, 1).reshape(-1, S)
    n = scipy.fft.next_fast_len(2 * S)
    power = np.zeros(n // 2 + 1)
    for first in range(0, len(deviations), CHAINS_AT_ONCE):
        spectra = scipy.fft.rfft(deviations[first : first + CHAINS_AT_ONCE], n, axis=1)
        power += np.sum(spectra.real**2 + spectra.imag**2, axis=0)
    covariance: Array = scipy.fft.irfft(power, n)[:S]
    return covariance


class Usability(Enum):
    """Whether intervals from draws mean something."""

    USABLE = "usable"
    TOO_SHORT = "NOT CONVERGED: too short"
    NOT_MIXING = "NOT CONVERGED: not mixing"
    MODE_MISSED = "NOT CONVERGED: a mode is missed"
    NOT_GAUSSIAN = "NOT USABLE: not Gaussian"
    CONDITIONAL = "NOT USABLE: conditional"
    IMPROPER = "NOT USABLE: improper"


@dataclass(frozen=True, eq=False)
class Mixing:
    """What is known of chains (E, S, W, k) after `discarded` steps each; times are in steps."""

    labels: tuple[str, ...]  # the entries
    draws: Array = field(repr=False)  # (E, S, W, k) ensembles, steps, walkers, entries
    acceptance: float  # the share of all proposals that were accepted
    discarded: int  # how many steps were discarded as burn-in
    thin: int = 1  # how many steps lie between two draws that are kept
    exact: bool = False  # whether the draws are independent by construction
    # how many there were between two kept draws; 0 if there was one at every step
    proposals: int = 0

    @property
    def steps(self) -> int:
        """How many steps of each walker are left after the burn-in."""
        return int(self.draws.shape[1]) * self.thin

    @cached_property
    def times(self) -> Array:
        """The integrated autocorrelation time of each entry (k,)."""
        if self.exact:
            return np.ones(self.draws.shape[3])
        return self.thin * np.array([integrated_time(draws) for draws in self._each])

    @cached_property
    def growth(self) -> float:
        """The largest autocorrelation time, divided by the largest of the first half alone."""
        half = self.draws.shape[1] // 2
        if self.exact or half < 2:
            return 1.0
        before = self.thin * max(integrated_time(draws[:, :half]) for draws in self._each)
        return float(self.times.max() / before) if np.isfinite(before) else np.inf

    @property
    def length(self) -> float:
        """The length of the chains, in autocorrelation times of the slowest entry."""
        return float(self.steps / self.times.max())

    @property
    def long_enough(self) -> bool:
        """Whether the chains are long enough for their autocorrelation time to be believed.

        A chain that is short beside its memory makes that memory look too short. From 50 times on a
        chain tells its own time well enough (Sokal 1997; emcee's rule); many walkers tell it from
        20 times, where it is at most 1.2 times what the first half of the chains says.
        """
        return self.length >= LONG_TIMES or (
            self.length >= SETTLED_TIMES and self.growth <= SETTLED_GROWTH
        )

    @property
    def effective(self) -> Array:
        """Effective number of draws of each entry (k,)."""
        return np.asarray(self.draws[..., 0].size * self.thin / self.times)

    @cached_property
    def scales(self) -> Array:
        """The R-hat of each entry, (k,)."""
        return np.array([potential_scale(draws) for draws in self._each])

    @cached_property
    def chances(self) -> Array:
        """P-values (k,): how probable it is that ensembles of one distribution differ as much."""
        times = self.times / self.thin
        return np.array([disagreement(*each) for each in zip(self._each, times, strict=True)])

    @cached_property
    def stuck(self) -> int:
        """Walkers that did not move in the second half, where by their acceptance all should."""
        E, _, W, _ = self.draws.shape
        late = self.draws[:, self.draws.shape[1] // 2 :]
        by_chance = E * W * np.exp(-self.acceptance * late.shape[1] * (self.proposals or self.thin))
        if self.exact or late.shape[1] < 2 or by_chance > UNLIKELY:
            return 0
        return int(np.sum((late == late[:, :1]).all(axis=(1, 3))))

    @cached_property
    def apart(self) -> Array:
        """How far a quantile of an ensemble is at most from that of all draws, for each entry (k,).

        In interquartile ranges of all draws; of the quantiles at 5, 25, 50, 75 and 95 %.
        """
        E, k = self.draws.shape[0], self.draws.shape[3]
        each = np.quantile(self.draws.reshape(E, -1, k), QUANTILES, axis=1)  # (5, E, k)
        of_all = np.quantile(self.draws.reshape(-1, k), QUANTILES, axis=0)
        widths = of_all[3] - of_all[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(abs(each - of_all[:, None]).max(axis=(0, 1)) / widths)

    @property
    def slowest(self) -> str:
        """The entry with the longest memory."""
        return self.labels[int(np.argmax(self.times))]

    @cached_property
    def _each(self) -> Sequence[Array]:
        return [np.ascontiguousarray(self.draws[..., i]) for i in range(self.draws.shape[3])]

    @cached_property
    def judgement(self) -> tuple[Usability, str]:
        """The verdict, and its reason with what to do, and how far the ensembles are apart."""
        verdict, why = self._judged()
        E, S, _, _ = self.draws.shape
        if verdict is Usability.USABLE or self.exact or E < 2 or S < 2:
            return verdict, why
        worst = int(np.argmax(self.apart))
        if not np.isfinite(self.apart[worst]):
            return verdict, why
        return verdict, (
            f"{why}. The quantiles of single ensembles (5 to 95 %) are within "
            f"{self.apart[worst]:.2g} interquartile ranges of those of all draws "
            f"({self.labels[worst]})"
        )

    def _judged(self) -> tuple[Usability, str]:
        E, S, W, k = self.draws.shape
        if self.exact:
            if (count := E * S * W) < LEAST_DRAWS:
                return (
                    Usability.TOO_SHORT,
                    f"{count} draws of {LEAST_DRAWS:.0f} required; draw more",
                )
            return Usability.USABLE, f"{count} draws"
        if S < 2:
            more = self._more_steps(FIRST_TIMES * GAUSSIAN_STEPS * k)
            return Usability.TOO_SHORT, f"there is nothing to judge by; take {more}"
        fewer = "sample fewer entries" if k > 1 else "give it bounds: it may have no width"
        if self.acceptance < LEAST_ACCEPTANCE:
            return Usability.NOT_MIXING, (
                f"only {self.acceptance:.1%} of the proposals are accepted; {fewer}"
            )
        if self.stuck:
            return Usability.NOT_MIXING, (
                f"{self.stuck} of {E * W} walkers did not move at all in the second half; start "
                f"nearer to the mode, or {fewer}"
            )
        worst, scale = int(np.argmax(self.scales)), float(self.scales.max())
        if scale > R_HAT_APART:
            return Usability.NOT_MIXING, (
                f"independent ensembles are in different places (R-hat {scale:.2f} of "
                f"{self.labels[worst]}): several modes, or far too few steps. Look at the traces, "
                "and sample a block that holds the modes together"
            )
        if E < LEAST_ENSEMBLES:
            return Usability.TOO_SHORT, (
                f"{E} ensembles cannot vouch for each other; run at least {LEAST_ENSEMBLES}"
            )
        if not self.long_enough:
            return self._short()
        chance = np.nan_to_num(self.chances, nan=1.0)
        if chance.min() < UNLIKELY / k:
            return Usability.NOT_MIXING, (
                f"ensembles differ by more than their memory explains in "
                f"{self.labels[int(np.argmin(chance))]} (a chance of {chance.min():.0e}): they "
                "remember longer than their autocorrelation times say; take more steps, or " + fewer
            )
        if scale > MOST_R_HAT or self.effective.min() < LEAST_DRAWS:
            by_draws = LEAST_DRAWS / float(self.effective.min())
            by_r_hat = (scale**2 - 1) / (MOST_R_HAT**2 - 1)
            return Usability.TOO_SHORT, (
                f"R-hat is {scale:.3f} and the least effective number of draws "
                f"{self.effective.min():.0f}, where {MOST_R_HAT} and {LEAST_DRAWS:.0f} are "
                f"required; take {self._more_steps(MARGIN * self.steps * max(by_draws, by_r_hat))}"
            )
        return Usability.USABLE, (
            f"{self.length:.0f} autocorrelation times, R-hat {scale:.3f}, at least "
            f"{self.effective.min():.0f} effective draws"
        )

    def _short(self) -> tuple[Usability, str]:
        length = (
            f"{self.steps} steps are {self.length:.0f} autocorrelation times of {self.slowest} "
            f"({self.times.max():.0f} steps), and "
            + (
                f"below {SETTLED_TIMES:.0f} not even that time can be believed"
                if self.length < SETTLED_TIMES
                else f"that time, {self.growth:.1f} times what the first half says, has not settled"
            )
        )
        k = len(self.labels)
        enough = (
            self.steps > FIRST_TIMES * GAUSSIAN_STEPS * k
        )  # for a Gaussian: else it is merely too short
        if (
            enough
            and self.growth > UNSETTLED_GROWTH
            and self.times.max() > FAR_FROM_GAUSSIAN * GAUSSIAN_STEPS * k
        ):
            remedy = (
                f"sample fewer entries (about {MANY_ENTRIES})"
                if k > MANY_ENTRIES
                else "look at the traces: there may be several modes, or a long and bent ridge"
            )
            return Usability.NOT_MIXING, (
                f"{length}: it grew by a factor of {self.growth:.1f} when chains grew twice as "
                "long, so that these cannot tell how many steps are enough. Take several times as "
                f"many; if the time still grows then, {remedy}"
            )
        # of a short chain, times come out too short
        time = max(self.times.max(), GAUSSIAN_STEPS * k)
        more = self._more_steps(MARGIN * LONG_TIMES * time)
        return Usability.TOO_SHORT, f"{length}; take {more}"

    def _more_steps(self, needed: float) -> str:
        """In words, how many more steps to take for as many after the burn-in as are needed."""
        so_far = self.steps + self.discarded
        with_burn_in = max(needed * so_far / max(self.steps, 1), 1.1 * so_far)
        unit = 10.0 ** max(np.floor(np.log10(with_burn_in)) - 1, 1)
        total = int(np.ceil(with_burn_in / unit) * unit)
        return f"about {total - so_far:,} steps more ({total:,} in all for each walker)"

    @property
    def verdict(self) -> Usability:
        """Usable, too short, or not mixing."""
        return self.judgement[0]

    @property
    def usable(self) -> bool:
        """Whether intervals mean something."""
        return self.verdict is Usability.USABLE

    def __str__(self) -> str:
        verdict, why = self.judgement
        return f"{verdict.value}: {why}"


def potential_scale(draws: Array) -> float:
    """Rank-normalised split R-hat of ensembles (E, S, W), the larger of bulk and tails.

    1 where ensembles, and their first and second halves, have the same distribution (Vehtari et
    al. 2021). Raises MissingLibrary where arviz-stats is not installed.
    """
    E, S, _ = draws.shape
    half = S // 2
    if half == 0 or np.ptp(draws) == 0:
        return np.inf
    halves = np.concatenate([draws[:, :half], draws[:, S - half :]], axis=1).reshape(E, -1)
    stats = optional_library("arviz_stats.base", "comparing independent ensembles")
    with np.errstate(all="ignore"):
        scale = stats.array_stats.rhat(halves, chain_axis=0, draw_axis=1)
    return float(np.nan_to_num(scale, nan=np.inf))


def disagreement(draws: Array, time: float) -> float:
    """The chance that ensembles whose memory is `time` steps have means as far apart as these.

    With the memory right, (E - 1) times the variance of E means, over the one that it predicts,
    is chi-square of E - 1. A tiny chance says that the memory is longer than it looks.
    """
    E, S, W = draws.shape
    predicted = draws.var() * time / (S * W)
    if E < 2 or not np.isfinite(predicted) or predicted == 0:
        return np.nan
    actual = draws.reshape(E, -1).mean(axis=1).var(ddof=1)
    return float(scipy.special.chdtrc(E - 1, (E - 1) * actual / predicted))
