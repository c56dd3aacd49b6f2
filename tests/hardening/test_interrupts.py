"""Ctrl-C, once and twice, at any moment of every solver."""

import os
import random
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from types import FrameType
from typing import Any

import numpy as np
import pytest

from tests.sampling.densities import gaussian
from tests.solvers.problems import body_fit, decay
from workbench import SOLVERS, Problem, Staged, Status, Values
from workbench.interrupts import SIGNALS, Interrupts
from workbench.sampling import Progress, sample
from workbench.solvers import Ipopt, Iterate, LevenbergMarquardt, Solution, Sqp, exact_hessian

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")
MOMENTS = 12
SHORT = 60  # evaluations: an interrupt comes sooner than that
SHORTER: dict[str, Any] = {
    name: replace(solver, max_evaluations=SHORT)  # type: ignore[type-var]
    for name, solver in SOLVERS.items()
}
ENTRANTS = SHORTER | {
    "ipopt-own": Ipopt(hessian=lambda run, x, here: here.normal),
    "sqp-exact": Sqp(hessian=exact_hessian),
    "staged": Staged((("trans",), ("trans", "pose"))),
    "staged ipopt": Staged((("trans",), ("trans", "pose")), Ipopt()),
}
OURS = os.path.join("workbench", "solvers")


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Python's own handlers, also where the tests run in the background of a shell."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def task(name: str) -> tuple[Problem, Values]:
    if name == "nlopt-mlsl":  # which wants a box
        return decay(bounds={"x": (np.full(3, -1.0), np.full(3, 3.0))})
    return body_fit()


class Pressing:
    """Sends SIGINT as certain functions of the solvers begin, counted from the start of a solve.

    What Python calls from C++ is among them: at their first instruction an exception would be
    raised where only C++ could catch it.
    """

    def __init__(self, *moments: int) -> None:
        self._moments, self.calls, self.pressed = moments, 0, 0

    def __enter__(self) -> "Pressing":
        sys.setprofile(self._begun)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _begun(self, frame: FrameType, event: str, _: object) -> None:
        if event != "call" or OURS not in frame.f_code.co_filename:
            return
        self.calls += 1
        if self.calls in self._moments:
            self.pressed += 1
            signal.raise_signal(signal.SIGINT)


def spent(solution: Solution) -> int:
    counts = solution.evaluations
    return counts.residual + counts.gradient + counts.jacobian + counts.hessian


@pytest.mark.parametrize("times", [1, 2], ids=["once", "twice"])
@pytest.mark.parametrize("name", ENTRANTS)
def test_every_solver_hears_an_interrupt_at_any_moment(name: str, times: int) -> None:
    """It ends as interrupted, with the best point so far; or it raises KeyboardInterrupt, where it
    had not begun or was already over.
    """
    problem, start = task(name)
    solver = ENTRANTS[name]
    solver.solve(
        problem, start
    )  # functions are built, and a solver of CasADi is left for the next run
    with Pressing() as counting:
        whole: Solution = solver.solve(problem, start)
    assert not counting.pressed
    rng = random.Random(f"{name} {times}")
    for moment in sorted(rng.sample(range(1, counting.calls), MOMENTS)):
        again = moment + rng.choice([1, 2, 3, 10, 50])
        with Pressing(moment, *[again] * (times - 1)) as pressing:
            try:
                found = solver.solve(problem, start)
            except KeyboardInterrupt:
                found = None
        where = f"at call {moment} of {counting.calls}"
        assert pressing.pressed, where
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler, where
        if found is None:
            continue
        assert found.status is Status.STOPPED, (where, found.status, found.message)
        assert found.message.startswith("interrupted from the keyboard"), where
        assert not np.isfinite(found.cost) or found.cost >= whole.cost * (1 - 1e-6), where
        assert spent(found) <= spent(whole), where


@pytest.mark.parametrize("name", ["levenberg-marquardt", "ipopt", "sqp", "nlopt-lbfgs", "staged"])
def test_a_function_that_does_not_end_is_interrupted_at_once(name: str) -> None:
    """A callback of the user's waits for ever; the signal comes once it does."""
    waits = threading.Event()

    def press() -> None:
        assert waits.wait(60)
        os.kill(os.getpid(), signal.SIGINT)

    def wait(iterate: Iterate) -> None:
        waits.set()
        began = time.monotonic()
        while time.monotonic() - began < 60:
            time.sleep(0.01)
        raise AssertionError("it was not heard for a minute")

    thread = threading.Thread(target=press)
    thread.start()
    problem, start = task(name)
    solution = ENTRANTS[name].solve(problem, start, callback=wait)
    thread.join()
    assert solution.status is Status.STOPPED
    assert "keyboard" in solution.message


def test_after_convergence_it_is_still_said() -> None:
    problem, start = decay()

    def at_the_end(iterate: Iterate) -> None:
        if iterate.optimality <= 1e-6:
            signal.raise_signal(signal.SIGINT)

    solution = LevenbergMarquardt().solve(problem, start, callback=at_the_end)
    assert solution.status is Status.STOPPED
    assert solution.message == "interrupted from the keyboard, after it had converged"
    assert solution.optimality <= 1e-6


class Asked(BaseException):
    """What another handler raises."""


@pytest.mark.parametrize("name", ["ipopt", "nlopt-lbfgs", "gauss-newton"])
def test_what_another_handler_raises_comes_out(name: str) -> None:
    def asked(number: int, frame: FrameType | None) -> None:
        raise Asked

    problem, start = task(name)
    signal.signal(signal.SIGTERM, asked)
    with pytest.raises(Asked):
        ENTRANTS[name].solve(
            problem, start, callback=lambda iterate: signal.raise_signal(signal.SIGTERM)
        )
    assert signal.getsignal(signal.SIGTERM) is asked


def test_a_handler_that_raises_nothing_goes_on() -> None:
    counted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: counted.append(number))
    problem, start = body_fit()
    solution = Ipopt().solve(
        problem, start, callback=lambda iterate: signal.raise_signal(signal.SIGINT)
    )
    assert solution.status is Status.CONVERGED
    assert len(counted) == len(solution.trace)


def test_handlers_come_back_after_an_error_of_the_callback() -> None:
    def broken(iterate: Iterate) -> None:
        raise LookupError("of the caller")

    with pytest.raises(LookupError, match="of the caller"):
        Ipopt().solve(*body_fit(), callback=broken)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_leave_signals_alone() -> None:
    during: list[object] = []

    def look(iterate: Iterate) -> None:
        during.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=lambda: Ipopt().solve(*body_fit(), callback=look))
    thread.start()
    thread.join()
    assert set(during) == {signal.default_int_handler}


def test_the_third_signal_is_raised_wherever_the_program_is() -> None:
    with Interrupts() as interrupts:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            interrupts.check()
    assert interrupts.pressed


def test_an_error_that_c_code_made_of_an_interrupt_is_an_interrupt() -> None:
    def casadi_like() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise SystemError("error return without exception set") from None

    with (
        Interrupts() as interrupts,
        pytest.raises(KeyboardInterrupt),
        interrupts.raised_at_once(),
    ):
        casadi_like()


@pytest.mark.parametrize("times", [1, 2], ids=["once", "twice"])
def test_sampling_keeps_what_it_has(times: int) -> None:
    def press(progress: Progress) -> None:
        if progress.step >= 100:
            for _ in range(times):
                with suppress(KeyboardInterrupt):  # as much C code does
                    signal.raise_signal(signal.SIGINT)

    posterior = sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=400, callback=press)
    assert posterior.interrupted
    assert 50 < posterior.mixing.steps <= 100
