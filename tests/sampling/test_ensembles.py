"""Ensembles: moves leave a posterior as it is, and killed or stopped runs go on."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import emcee
import numpy as np
import pytest

from tests.sampling.densities import gaussian
from tests.sampling.interrupted_run import run
from tests.tiers import few
from workbench import Problem, WorkbenchError
from workbench.sampling import SamplingProgress, sample
from workbench.sampling.ensembles import stepped


def normal(x: np.ndarray) -> np.ndarray:
    return np.asarray(-0.5 * np.sum(x**2, axis=1))


@pytest.mark.parametrize("k", few((2, 10), 1))
def test_moves_are_unbiased(k: int) -> None:
    """From equilibrium, by the standard error of independent repeats."""
    found = []
    for repeat in range(12):
        rng = np.random.default_rng([3, k, repeat])
        random = np.random.RandomState(rng.integers(2**32, size=4, dtype=np.uint32))
        z = rng.standard_normal((max(32, 4 * k), k))
        log_p, squares = normal(z), []
        for _ in range(150):
            stepped(z, log_p, normal, random)
            squares.append(np.mean(z**2))
        found.append(np.mean(squares))
    assert abs(np.mean(found) - 1) < 4 * np.std(found, ddof=1) / np.sqrt(12)


def test_steps_are_those_of_emcee() -> None:
    start = np.random.default_rng(0).standard_normal((12, 3))
    moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.DEMove(gamma0=1.0), 0.1)]
    sampler = emcee.EnsembleSampler(12, 3, normal, moves=moves, vectorize=True)
    state = emcee.State(start, random_state=np.random.RandomState(1).get_state())
    sampler.run_mcmc(state, 200)
    z, log_p, random, accepted = start.copy(), normal(start), np.random.RandomState(1), np.zeros(12)
    for k in range(200):
        accepted += stepped(z, log_p, normal, random)
        np.testing.assert_array_equal(z, sampler.get_chain()[k])
        np.testing.assert_array_equal(log_p, sampler.get_log_prob()[k])
    np.testing.assert_array_equal(accepted / 200, sampler.acceptance_fraction)


@pytest.mark.thorough
def test_killed_run_ends_bit_for_bit_as_uninterrupted(tmp_path: Path) -> None:
    path = tmp_path / "draws.npz"
    command = [sys.executable, "-W", "error", "-m", "tests.sampling.interrupted_run", str(path)]
    child = subprocess.Popen(command, cwd=Path(__file__).parents[2])
    deadline = time.monotonic() + 60
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.3)
    child.send_signal(signal.SIGKILL)
    child.wait()
    with np.load(path) as saved:
        done = [len(saved[f"chain_{e}"]) for e in range(4)]
    assert 0 < min(done) < 200, f"{done} of 200 were drawn when it was killed"
    taken_up, whole = run(str(path)), run(None)
    np.testing.assert_array_equal(taken_up.draws, whole.draws)
    np.testing.assert_array_equal(taken_up.log_prob, whole.log_prob)
    assert taken_up.mixing.acceptance == whole.mixing.acceptance
    assert [p.name for p in tmp_path.iterdir()] == ["draws.npz"]  # and no litter


def test_stopped_runs_are_taken_up(tmp_path: Path) -> None:
    problem, at = gaussian(np.eye(2)), {"x": np.zeros(2)}

    def some(path: Path | None, stop: int) -> object:
        return sample(
            problem,
            at,
            steps=200,
            walkers=8,
            seed=1,
            checkpoint=path,
            stop_when_usable=False,
            callback=lambda p: p.step >= stop,
        )

    first = some(tmp_path / "a.npz", 50)
    assert first.interrupted  # type: ignore[attr-defined]
    np.testing.assert_array_equal(
        some(tmp_path / "a.npz", 10**9).draws,  # type: ignore[attr-defined]
        some(None, 10**9).draws,  # type: ignore[attr-defined]
    )


def test_interrupts_keep_draws() -> None:
    def interrupt(progress: SamplingProgress) -> None:
        if progress.step >= 100:
            raise KeyboardInterrupt

    posterior = sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=400, callback=interrupt)
    assert posterior.interrupted
    assert 50 < posterior.mixing.steps <= 100
    assert "interrupted" in str(posterior)


def test_checkpoints_of_other_runs_are_refused(tmp_path: Path) -> None:
    path, at = tmp_path / "draws.npz", {"x": np.zeros(2)}

    def draw(problem: object, seed: int = 1) -> None:
        sample(problem, at, steps=40, walkers=8, seed=seed, checkpoint=path)  # type: ignore[arg-type]

    draw(gaussian(np.eye(2)))
    with pytest.raises(WorkbenchError, match="its seed is 1, not 2"):
        draw(gaussian(np.eye(2)), seed=2)
    with pytest.raises(WorkbenchError, match="draws of another run"):
        draw(gaussian(np.eye(2), mean=1.0))
    for limits in ((-1.0, 1.0), (-2.0, 2.0)):  # of a density that is the same at the start
        problem = gaussian(np.eye(2))
        with pytest.raises(WorkbenchError, match="draws of another run"):
            draw(Problem(problem.residuals, "x", {"x": limits}, problem.free.blocks))
    path.write_bytes(b"no draws at all")
    with pytest.raises(WorkbenchError, match=r"no checkpoint.*remove it to begin anew"):
        draw(gaussian(np.eye(2)))


def test_missing_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(WorkbenchError, match="cannot write"):
        run(str(tmp_path / "nowhere" / "draws.npz"))


def test_seeds_reproduce() -> None:
    problem, at = gaussian(np.eye(3)), {"x": np.zeros(3)}
    one, same, other = (sample(problem, at, steps=60, seed=s).draws for s in (4, 4, 5))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert len(np.unique(one[:, -1, 0, 0])) == 4  # ensembles are independent
