r"""How walkers are moved.

By default this is differential evolution (ter Braak 2006; Nelson et al. 2014): a step is the
difference of two other walkers times 2.38 / sqrt(2 k), and every tenth time the whole difference,
which leads from mode to mode. All moves offered are invariant under affine maps, so there is
nothing to whiten.

The proposals are emcee's, accepted for half of the ensemble at once: emcee's own loop asks one
walker after the other, which costs more than a compiled posterior does.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import WorkbenchError
from workbench.sampling.emcee_interface import emcee

Moves = Sequence[tuple[Any, float]]  # moves of emcee's, or of the same form, with weights
SNOOKER_GAMMA = 1.7  # ter Braak and Vrugt 2008
JUMPS = 0.1  # of the steps


class BiasedMove(WorkbenchError):
    """The error for a move under which the posterior is not the stationary distribution."""


def propose_together(move: Any, model: Any, state: Any) -> tuple[Any, Mask]:
    """emcee's red-blue step in array operations, with the same random numbers in the same order."""
    walkers = len(state.coords)
    move.setup(state.coords)
    accepted = np.zeros(walkers, dtype=bool)
    group = np.arange(walkers) % move.nsplits
    if move.randomize_split:
        model.random.shuffle(group)
    for split in range(move.nsplits):
        ours = np.flatnonzero(group == split)
        others = [state.coords[group == j] for j in range(move.nsplits) if j != split]
        y, factors = move.get_proposal(state.coords[ours], others, model.random)
        log_prob, _ = model.compute_log_prob_fn(y)
        gain = factors + log_prob - state.log_prob[ours]
        taken = gain > np.log(model.random.rand(len(ours)))
        state.coords[ours[taken]], state.log_prob[ours[taken]] = y[taken], log_prob[taken]
        accepted[ours[taken]] = True
    return state, accepted


@dataclass(frozen=True)
class Together:
    """A red-blue move of emcee's, in array operations on all proposals of a step.

    Attributes:
        proposals: the move that proposes.
    """

    proposals: Any

    def propose(self, model: Any, state: Any) -> tuple[Any, Mask]:
        """The ensemble after a step, and which walkers (W,) have moved."""
        return propose_together(self.proposals, model, state)


class Snooker:
    r"""A step along the line to another walker (ter Braak and Vrugt 2008, eq. 3 and 4).

    With u the unit vector from walker z to x, and two more walkers z1 and z2,

        y = x + gamma u u'(z1 - z2),   accepted by p(y) |y - z|^(k-1) / (p(x) |x - z|^(k-1)).
    """

    nsplits = 2  # as emcee's red-blue moves: halves of the ensemble in turn, drawn anew
    randomize_split = True
    propose = propose_together

    def setup(self, coords: Array) -> None:
        """Nothing depends on where the walkers are; emcee's moves may have it otherwise."""

    def get_proposal(
        self, s: Array, c: Sequence[Array], random: np.random.RandomState
    ) -> tuple[Array, Array]:
        """Proposals (M, k) for walkers s (M, k), and the logarithms of their factors (M,)."""
        others = np.concatenate(c)
        i, j, m = _three(len(others), len(s), random)
        away = s - others[i]
        length = np.linalg.norm(away, axis=1)
        u = away / length[:, None]
        along = np.einsum("mk,mk->m", u, others[j] - others[m])
        y = s + SNOOKER_GAMMA * u * along[:, None]
        with np.errstate(divide="ignore"):
            factor = np.log(np.linalg.norm(y - others[i], axis=1)) - np.log(length)
        k = s.shape[1]
        return y, (k - 1) * factor if k > 1 else np.zeros(len(s))


def _three(n: int, count: int, random: np.random.RandomState) -> tuple[Index, ...]:
    """Draw `count` times three different numbers below n; one array (count,) for each of them."""
    i, j, m = (random.randint(n - gone, size=count) for gone in range(3))
    j = j + (j >= i)
    low, high = np.minimum(i, j), np.maximum(i, j)
    m = m + (m >= low)
    return i, j, m + (m >= high)


def differential_evolution() -> Moves:
    """Nine steps of differential evolution to a jump."""
    steps = Together(emcee().moves.DEMove())
    jumps = Together(emcee().moves.DEMove(gamma0=1.0))
    return ((steps, 1 - JUMPS), (jumps, JUMPS))


def with_snooker() -> Moves:
    """Differential evolution with a fifth of snooker moves."""
    return (*((move, 0.8 * weight) for move, weight in differential_evolution()), (Snooker(), 0.2))


def stretch() -> Moves:
    """Goodman and Weare's, emcee's own default: some four times slower to mix."""
    return ((Together(emcee().moves.StretchMove()), 1.0),)


MOVES: Mapping[str, Callable[[], Moves]] = {
    "de": differential_evolution,
    "de-snooker": with_snooker,
    "stretch": stretch,
}


def refuse_biased(moves: Moves) -> None:
    """Raise BiasedMove for emcee's snooker where it is wrong.

    Up to emcee 3.1.6 it divides by the root of the distance and halves the exponent of the
    factor: the variance of a standard normal comes out as 0.89 in 2 dimensions and 0.53 in 40.
    The check tries what the move does, whatever its version says.
    """
    for move, _ in moves:
        if isinstance(move, emcee().moves.DESnookerMove) and not _right_snooker(move):
            raise BiasedMove(
                f"emcee {emcee().__version__}'s DESnookerMove does not leave the posterior as it "
                "is (github.com/dfm/emcee/pull/531): its draws are too narrow. Use "
                "workbench.sampling.moves.Snooker, or differential evolution"
            )


def _right_snooker(move: Any) -> bool:
    """Whether proposals grow with the walkers, and factors are (k - 1) times a log ratio."""
    rng = np.random.default_rng(0)
    s, c = rng.standard_normal((1, 3)), [rng.standard_normal((1, 3)) for _ in range(3)]
    y, factor = move.get_proposal(s, c, np.random.RandomState(0))
    large, _ = move.get_proposal(10 * s, [10 * one for one in c], np.random.RandomState(0))
    if not np.allclose(large, 10 * y, rtol=1e-9):
        return False
    ratios = [np.log(np.linalg.norm(y - z) / np.linalg.norm(s - z)) for z in c]
    return any(np.isclose(factor[0], 2 * ratio, rtol=1e-6) for ratio in ratios)
