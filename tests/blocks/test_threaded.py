"""Rows on several cores are the rows on one, and the clock decides which it is to be."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

from workbench.blocks import threaded
from workbench.blocks.batched import Batched, Buffered, Mapped, OneByOne
from workbench.blocks.threaded import TRIED, Threaded


def pendulum() -> cs.Function:
    """Where it is after ten seconds, for a stiffness and a damping: no scalar instructions."""
    x, p = cs.SX.sym("x", 2), cs.SX.sym("p", 2)
    ode = cs.vertcat(x[1], -p[0] * cs.sin(x[0]) - p[1] * x[1])
    steps = {"number_of_finite_elements": 150}
    run = cs.integrator("run", "rk", {"x": x, "p": p, "ode": ode}, 0, 10, steps)
    given, from_here = cs.MX.sym("p", 2), cs.MX.sym("x", 2)
    return cs.Function("end", [given, from_here], [run(x0=from_here, p=given)["xf"]])


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threaded, "available_cores", lambda: 2)


def one_by_one() -> OneByOne:
    return OneByOne(Buffered(pendulum()), (False, True))


def mapped() -> Mapped:
    return Mapped(pendulum(), (False, True))


@pytest.mark.usefixtures("two")
@pytest.mark.parametrize("make", [one_by_one, mapped])
def test_threads_give_the_same_bits(make: Callable[[], Batched]) -> None:
    rng = np.random.default_rng(0)
    run, plain = Threaded(make, (False, True)), make()
    for rows in (7, 32, 33, 32, 32, 32, 32, 3, 1):
        given = rng.uniform(0.5, 1.0, (rows, 2)), np.array([1.0, 0.0])
        np.testing.assert_array_equal(run(*given)[0], plain(*given)[0])
    assert len(run._seconds[True]) == TRIED  # they were asked


@pytest.mark.usefixtures("two")
@pytest.mark.parametrize(
    ("alone", "apart", "taken"),
    [
        ([1e-3] * 3, [6e-4] * 3, True),
        ([1e-3] * 3, [2e-3, 2e-3, 1.1e-3], False),
        ([1e-3], [], True),  # to be tried
        ([1e-3], [6e-4], False),  # in turn
        ([1e-6] * 3, [], False),  # too short to be worth a trial
        ([], [], False),
    ],
)
def test_the_clock_decides(alone: list[float], apart: list[float], taken: bool) -> None:
    run = Threaded(one_by_one, (False, True))
    run._seconds = {False: alone, True: apart}
    assert run._faster_apart() is taken


def test_one_core_is_not_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threaded, "available_cores", lambda: 1)
    run = Threaded(one_by_one, (False, True))
    for _ in range(8):
        run(np.ones((32, 2)), np.array([1.0, 0.0]))
    assert run._seconds == {False: [], True: []}


@pytest.mark.usefixtures("two")
def test_an_error_on_another_core_is_heard() -> None:
    class Wrong(cs.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            cs.Callback.__init__(self)
            self.construct("wrong", {})

        def eval(self, arguments: list[cs.DM]) -> list[cs.DM]:
            if float(arguments[0]) > 20:
                raise ValueError("more than twenty")
            return [arguments[0]]

    wrong, x = Wrong(), cs.MX.sym("x")
    function = cs.Function("f", [x], [wrong(x)])
    run = Threaded(lambda: OneByOne(Buffered(function), (False,)), (False,))
    run._seconds = {False: [1e-3] * 3, True: [1e-4] * 3}
    assert run(np.arange(10.0)[:, None])[0][9, 0] == 9
    with pytest.raises(RuntimeError, match="twenty"):
        run(np.arange(30.0)[:, None])
