"""Ctrl-C, once and twice, at any moment of every solver."""

import os
import random
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import FrameType
from typing import Any

import numpy as np
import pytest

from tests.solvers.problems import body_fit
from tests.tiers import few
from workbench import SOLVERS, Staged, Status
from workbench.interrupts import SIGNALS
from workbench.solvers import Ipopt, Solution, Sqp, exact_hessian

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")
MOMENTS = 8
SHORT = 60  # evaluations: an interrupt comes sooner than that
SOLVED_BY = (
    *(
        "trust-region",
        "ipopt",
        "levenberg-marquardt",
        "gauss-newton",
        "dogleg",
        "sqp",
        "scipy-trf",
        "scipy-lm",
    ),
    *("nlopt-lbfgs", "newton"),
)
ENTRANTS: dict[str, Any] = {
    **{name: replace(SOLVERS[name], max_evaluations=SHORT) for name in SOLVED_BY},  # type: ignore[type-var]
    "ipopt-own": Ipopt(hessian=lambda run, x, here: here.normal),
    "sqp-exact": Sqp(hessian=exact_hessian),
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


@pytest.mark.parametrize("times", few([1, 2], 1))
@pytest.mark.parametrize("name", few(ENTRANTS, 2))
def test_solvers_hear_an_interrupt_at_any_moment(name: str, times: int) -> None:
    """It ends as interrupted, with the best point so far; or it raises KeyboardInterrupt, where it
    had not begun or was already over.
    """
    problem, start = body_fit()
    solver = ENTRANTS[name]
    solver.solve(problem, start)  # functions are built
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
