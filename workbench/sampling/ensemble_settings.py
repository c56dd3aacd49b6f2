"""How ensembles are sampled: how many walkers and steps, what is kept, and when it is enough."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.sampling.mixing import Mixing
from workbench.sampling.moves import Moves

KEPT = 2e7  # numbers that are kept in memory: 160 MB
CHECKED = (1 / 16, 1 / 8, 1 / 4, 1 / 2)  # of the steps: when usable then, that is enough
BURNT = 0.1  # share of the steps that is discarded at least
BURNT_TIMES = 5.0  # autocorrelation times that are discarded, but no more than half of the steps


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes:
        step: how many steps each walker has taken.
        steps: how many it takes at most.
        acceptance: the share of the proposals that were accepted.
        seconds: the time since the run began.
        all_free: whether all free numbers are being sampled, by Hamiltonian Monte Carlo.
    """

    step: int
    steps: int
    acceptance: float
    seconds: float
    all_free: bool = False


# called after each step; the run stops if it returns True
Callback = Callable[[Progress], object] | None


@dataclass(frozen=True)
class EnsembleSettings:
    """How to sample: several independent ensembles of walkers.

    A run ends early, after 1/16, 1/8, 1/4 or 1/2 of the steps, if its draws are usable by then.

    Attributes:
        walkers: how many walkers an ensemble has.
        ensembles: how many independent ensembles there are.
        steps: how many steps each walker takes at most.
        thin: every how many steps one is kept.
        seed: the seed of all random numbers.
        moves: emcee's moves with their weights.
        whole: whether to take all steps, even if the draws are usable earlier.
    """

    walkers: int
    ensembles: int
    steps: int
    thin: int
    seed: int
    moves: Moves = field(repr=False)
    whole: bool = False

    def generator(self, stream: int) -> np.random.Generator:
        """Random numbers of what follows the ensembles, one stream for each purpose."""
        key = (self.ensembles + stream,)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))

    @property
    def kept(self) -> int:
        """How many steps of each walker are kept."""
        return self.steps // self.thin

    @property
    def checks(self) -> list[int]:
        """After how many kept steps the draws are judged: the early checks, and the end."""
        early = [] if self.whole else [int(self.kept * share) for share in CHECKED]
        return [*(n for n in early if n >= 20), self.kept]


def thinning(walkers: int, ensembles: int, steps: int, size: int) -> int:
    """Every how many steps one is to be kept, so that all that is kept fits into memory."""
    kept = np.clip(KEPT / (walkers * ensembles * size), 200, 4000)
    return max(1, int(np.ceil(steps / kept)))


def without_burn_in(chain: Array, thin: int, acceptance: float, labels: tuple[str, ...]) -> Mixing:
    """The mixing of chains (E, S, W, k) without their burn-in.

    A tenth of the steps is discarded, or five autocorrelation times if that is more, but no more
    than half of the steps.
    """
    _, S, _, k = chain.shape
    labels = labels or tuple(map(str, range(k)))
    first = int(np.ceil(BURNT * S))
    before = Mixing(labels, chain[:, first:], acceptance, first * thin, thin)
    longest = before.times.max() / thin if S - first > 1 else 0.0
    wanted = min(BURNT_TIMES * longest, S / 2)
    if wanted <= first:
        return before
    first = int(np.ceil(wanted))
    return Mixing(labels, chain[:, first:], acceptance, first * thin, thin)
