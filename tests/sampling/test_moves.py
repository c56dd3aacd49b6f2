"""A move leaves a posterior as it is, or it is refused."""

import emcee
import numpy as np
import pytest

from tests.sampling.densities import gaussian
from workbench.sampling import MOVES, BiasedMove, sample
from workbench.sampling.moves import (
    Snooker,
    Together,
    differential_evolution,
    refuse_biased,
    stretch,
)

DIMENSIONS = (1, 2, 5, 10, 20)


def z_of_variance(moves: object, k: int, seed: int, steps: int, repeats: int = 12) -> float:
    """How many standard errors the variance is off after starting in equilibrium.

    The standard error is that of independent repeats, so no autocorrelation time is needed.
    """
    found = []
    for repeat in range(repeats):
        rng = np.random.default_rng([seed, k, repeat])
        random = np.random.RandomState(rng.integers(2**32, size=4, dtype=np.uint32))
        walkers = max(32, 4 * k)
        sampler = emcee.EnsembleSampler(
            walkers, k, lambda x: -0.5 * np.sum(x**2, axis=1), moves=moves, vectorize=True
        )
        start = emcee.State(rng.standard_normal((walkers, k)), random_state=random.get_state())
        sampler.run_mcmc(start, steps)
        found.append(np.mean(sampler.get_chain() ** 2))
    return float((np.mean(found) - 1) / (np.std(found, ddof=1) / np.sqrt(repeats)))


@pytest.mark.parametrize("k", DIMENSIONS)
@pytest.mark.parametrize("name", [*MOVES, "snooker alone"])
def test_every_move_offered_is_unbiased(name: str, k: int) -> None:
    moves = list(MOVES[name]()) if name in MOVES else Snooker()
    steps = 150 if "snooker" not in name else 100
    assert abs(z_of_variance(moves, k, seed=3, steps=steps)) < 4


@pytest.mark.parametrize("k", [2, 5, 10, 20])
def test_the_same_test_finds_emcees_snooker_wrong(k: int) -> None:
    if emcee.__version__ != "3.1.6":
        pytest.skip("corrected upstream")
    assert z_of_variance(emcee.moves.DESnookerMove(), k, seed=3, steps=200 if k < 5 else 60) < -4


def test_a_biased_move_is_refused() -> None:
    wrong = ((emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2))
    if emcee.__version__ == "3.1.6":
        with pytest.raises(BiasedMove, match="Snooker"):
            refuse_biased(wrong)
        with pytest.raises(BiasedMove):
            sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=20, moves=wrong)
    for moves in (differential_evolution(), stretch(), MOVES["de-snooker"]()):
        refuse_biased(moves)


def test_a_corrected_snooker_under_emcees_name_is_not_refused() -> None:
    class Corrected(emcee.moves.DESnookerMove):
        def get_proposal(self, s, c, random):  # type: ignore[no-untyped-def]
            return Snooker().get_proposal(s, c, random)

    refuse_biased(((Corrected(), 1.0),))


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (Together(emcee.moves.DEMove()), emcee.moves.DEMove()),
        (Together(emcee.moves.DEMove(gamma0=1.0)), emcee.moves.DEMove(gamma0=1.0)),
        (Together(emcee.moves.StretchMove()), emcee.moves.StretchMove()),
    ],
)
def test_accepting_together_is_emcees_own_chain(ours: Together, theirs: emcee.moves.Move) -> None:
    start = np.random.default_rng(0).standard_normal((12, 3))
    chains = []
    for move in (ours, theirs):
        sampler = emcee.EnsembleSampler(
            12, 3, lambda x: -0.5 * np.sum(x**2, axis=1), moves=move, vectorize=True
        )
        state = emcee.State(start, random_state=np.random.RandomState(1).get_state())
        sampler.run_mcmc(state, 200)
        chains.append((sampler.get_chain(), sampler.get_log_prob(), sampler.acceptance_fraction))
    for mine, other in zip(*chains, strict=True):
        np.testing.assert_array_equal(mine, other)


@pytest.mark.parametrize("move", [Snooker(), emcee.moves.DEMove(), emcee.moves.StretchMove()])
def test_moves_are_invariant_under_affine_maps(move: Snooker | emcee.moves.Move) -> None:
    """Scaling and turning; snooker's factor alone is not the same under a shear."""
    rng = np.random.default_rng(0)
    s, c = rng.standard_normal((6, 3)), [rng.standard_normal((7, 3))]
    Q = 4 * np.linalg.qr(rng.standard_normal((3, 3)))[0]
    move.setup(s)
    y, factor = move.get_proposal(s, c, np.random.RandomState(5))
    turned, again = move.get_proposal(s @ Q + 1, [c[0] @ Q + 1], np.random.RandomState(5))
    np.testing.assert_allclose(turned, y @ Q + 1, atol=1e-12)
    np.testing.assert_allclose(again, factor, atol=1e-12)


def test_snooker_takes_three_different_others() -> None:
    from workbench.sampling.moves import _three

    i, j, m = _three(3, 1000, np.random.RandomState(0))
    assert {frozenset(t) for t in zip(i.tolist(), j.tolist(), m.tolist(), strict=True)} == {
        frozenset({0, 1, 2})
    }
    pairs = np.bincount(3 * i + j, minlength=9)
    assert (pairs[[0, 4, 8]] == 0).all()
    assert (abs(pairs[[1, 2, 3, 5, 6, 7]] - 1000 / 6) < 60).all()
