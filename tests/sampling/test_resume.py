"""A run that was killed, stopped or interrupted goes on as if nothing had been."""

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
from workbench import Problem, WorkbenchError
from workbench.blocks import threaded
from workbench.sampling import Progress, sample
from workbench.sampling.checkpoint import load


def test_killed_in_the_middle_it_ends_bit_for_bit_as_uninterrupted(tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    command = [sys.executable, "-W", "error", "-m", "tests.sampling.interrupted_run", str(path)]
    child = subprocess.Popen(command, cwd=Path(__file__).parents[2])
    deadline = time.monotonic() + 60
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.3)
    child.send_signal(signal.SIGKILL)
    child.wait()
    saved, _ = load(path)
    done = [len(one.chain) for one in saved]
    assert 0 < min(done) < 200, f"{done} of 200 were drawn when it was killed"
    taken_up, whole = run(str(path)), run(None)
    np.testing.assert_array_equal(taken_up.draws, whole.draws)
    np.testing.assert_array_equal(taken_up.log_prob, whole.log_prob)
    assert taken_up.mixing.acceptance == whole.mixing.acceptance
    assert [p.name for p in tmp_path.iterdir()] == ["draws.h5"]  # and no litter


def test_a_checkpoint_is_emcees_own_file(tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    posterior = run(str(path))
    backend = emcee.backends.HDFBackend(str(path), name="ensemble 2", read_only=True)
    assert backend.iteration == 200
    kept = posterior.draws.shape[1]
    np.testing.assert_array_equal(backend.get_chain()[-kept:], posterior.draws[2])


def test_a_callback_stops_and_the_run_can_be_taken_up(tmp_path: Path) -> None:
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

    first = some(tmp_path / "a.h5", 50)
    assert first.interrupted  # type: ignore[attr-defined]
    np.testing.assert_array_equal(
        some(tmp_path / "a.h5", 10**9).draws,  # type: ignore[attr-defined]
        some(None, 10**9).draws,  # type: ignore[attr-defined]
    )


def test_an_interrupt_keeps_what_was_drawn() -> None:
    def interrupt(progress: Progress) -> None:
        if progress.step >= 100:
            raise KeyboardInterrupt

    posterior = sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=400, callback=interrupt)
    assert posterior.interrupted
    assert 50 < posterior.mixing.steps <= 100
    assert "interrupted" in str(posterior)


def test_a_finished_run_is_read_and_not_drawn_again(tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    first, steps = run(str(path)), []
    problem_again = run(str(path))
    np.testing.assert_array_equal(first.draws, problem_again.draws)
    assert steps == []


def test_another_run_is_refused(tmp_path: Path) -> None:
    path, at = tmp_path / "draws.h5", {"x": np.zeros(2)}

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
    with pytest.raises(WorkbenchError, match="no checkpoint"):
        draw(gaussian(np.eye(2)))


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(WorkbenchError, match="cannot write"):
        run(str(tmp_path / "nowhere" / "draws.h5"))


def test_seeds_reproduce() -> None:
    problem, at = gaussian(np.eye(3)), {"x": np.zeros(3)}
    one, same, other = (sample(problem, at, steps=60, seed=s).draws for s in (4, 4, 5))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert len(np.unique(one[:, -1, 0, 0])) == 4  # ensembles are independent


def test_draws_are_the_same_on_any_number_of_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    monkeypatch.setattr(threaded, "WORTH", 0.0)  # so that short rows are shared out too
    for count in (1, 2, 3):
        monkeypatch.setattr(threaded, "available_cores", lambda count=count: count)
        drawn.append(
            sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=60, walkers=20, seed=3).draws
        )
    np.testing.assert_array_equal(drawn[0], drawn[1])
    np.testing.assert_array_equal(drawn[0], drawn[2])
