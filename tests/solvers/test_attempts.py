"""A further attempt where an end is no minimum, or probably not the lowest one."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import decay, rosenbrock
from workbench import (
    Block,
    LevenbergMarquardt,
    Problem,
    Residual,
    Staged,
    Starts,
    Status,
    TrustRegion,
    Values,
)
from workbench.errors import BadArgument
from workbench.solvers import trust_region as module
from workbench.solvers.attempts import AT_LEAST, LOWER, PATIENCE, Attempts, Left, joined
from workbench.solvers.doubt import (
    CREEPING,
    MANY,
    NEAR,
    is_creeping,
    is_doubtful,
    may_be_repeated,
)
from workbench.solvers.iterate import Evaluations, Iterate
from workbench.solvers.solution import Callback, Solution

PLACES = np.linspace(0, 10, 60)
TRUTH = np.array([1.77, 0.22, 2.14, 1.04, 1.11, 4.94])
MERGED = np.array([0.28, 0.16, 4.10, 1.13, 2.21, 1.88])  # a start from which two rates meet


def decays(unread: int = 0) -> tuple[Problem, Values]:
    """A sum of three decays, amplitude and rate each, seen without noise; and some more numbers."""
    b, more = Block("b", (6,)), Block("more", (1 + unread,))
    s = b.symbol
    curve = sum(s[k] * cs.exp(-s[k + 1] * cs.DM(PLACES)) for k in (0, 2, 4))
    seen = sum(TRUTH[k] * np.exp(-TRUTH[k + 1] * PLACES) for k in (0, 2, 4))
    rows = cs.vertcat(curve - cs.DM(seen), more.symbol)
    problem = Problem((Residual("decays", rows, 1.0),), ("b", "more"), blocks=(b, more))
    return problem, {"b": MERGED, "more": np.zeros(1 + unread)}


def test_a_second_attempt_finds_the_decays_that_the_first_step_merged() -> None:
    problem, start = decays()
    seen: list[Iterate] = []
    first = TrustRegion(attempts=1).solve(problem, start)
    both = TrustRegion().solve(problem, start, callback=seen.append)
    assert first.converged
    assert first.cost > 0.03
    assert "hardly depends on 0.71 b[2] - 0.71 b[4]" in first.message
    assert both.converged
    assert both.cost < 1e-20
    np.testing.assert_allclose(np.sort(both.values["b"]), np.sort(TRUTH), rtol=1e-6)
    assert both.message.endswith(f"; an earlier attempt ended higher, at {first.cost:.6g}")
    second = both.trace[0]  # the trace is that of the second, after what the first took
    assert second.evaluations.total == first.evaluations.total + 1
    assert len(seen) == len(first.trace) + len(both.trace)
    told = seen[-len(both.trace) :]
    assert [one.evaluations for one in told] == [one.evaluations for one in both.trace]
    assert [one.seconds for one in told] == [one.seconds for one in both.trace]
    assert both.judging.gradient >= first.judging.gradient
    assert (np.diff([one.cost for one in both.trace]) < 0).all()


def test_limits_are_those_of_both_attempts_together() -> None:
    problem, start = decays()
    first = TrustRegion(attempts=1).solve(problem, start)
    used = first.evaluations.total
    one = TrustRegion(max_evaluations=used).solve(problem, start)
    assert one.evaluations.total == used
    short = TrustRegion(max_evaluations=used + 5).solve(problem, start)
    assert short.evaluations.total == used + 5
    assert short.cost == first.cost
    assert short.status is first.status
    steps = TrustRegion(max_iterations=first.iterations + 2).solve(problem, start)
    assert steps.evaluations.total < used + 10
    assert steps.cost == first.cost


def test_an_attempt_that_is_not_lower_is_given_up() -> None:
    """Freudenstein and Roth's second minimum, 24.49, is where all attempts lead."""
    x = Block("x", (2,)).symbol
    rows = cs.vertcat(
        x[0] - x[1] * (2 - x[1] * (5 - x[1])) - 13, x[0] - x[1] * (14 - x[1] * (1 + x[1])) - 29
    )
    problem, start = Problem((Residual("roth", rows, 1.0),), ("x",)), {"x": np.array([0.5, -2.0])}
    first = TrustRegion(attempts=1).solve(problem, start)
    both = TrustRegion().solve(problem, start)
    assert both.cost == first.cost == pytest.approx(24.4921, rel=1e-5)
    assert both.message == first.message
    spent = both.evaluations.total - first.evaluations.total
    each = max(PATIENCE * first.evaluations.total, AT_LEAST) + 1
    assert 3 * each <= spent < 3 * each + 10
    assert both.trace[-1].evaluations == first.trace[-1].evaluations


def test_who_asks_to_stop_in_the_second_attempt_is_heard() -> None:
    problem, start = decays()
    first = TrustRegion(attempts=1).solve(problem, start)
    seen: list[Iterate] = []

    def stop(iterate: Iterate) -> bool:
        seen.append(iterate)
        return len(seen) == len(first.trace) + 2

    def interrupt(iterate: Iterate) -> None:
        if stop(iterate):
            raise KeyboardInterrupt

    for callback, why in ((stop, "callback"), (interrupt, "keyboard")):
        seen.clear()
        cut = TrustRegion().solve(problem, start, callback=callback)
        assert cut.status is Status.STOPPED
        assert why in cut.message
        assert cut.cost == first.cost
        assert len(seen) == len(first.trace) + 2


def test_what_is_not_doubtful_is_solved_once() -> None:
    for problem, start in (decay(), decay(noise=0.0), rosenbrock()):
        once, twice = (TrustRegion(attempts=k).solve(problem, start) for k in (1, 2))
        assert once.evaluations == twice.evaluations
        assert once.message == twice.message


def test_only_small_problems_and_slow_ends_are_doubtful() -> None:
    problem, start = decays()
    end = TrustRegion(attempts=1).solve(problem, start)
    assert may_be_repeated(problem, 1e-6)
    assert not may_be_repeated(problem, 1e-3)  # an end that is only a start
    assert not may_be_repeated(decays(unread=14)[0], 1e-6)
    assert is_doubtful(end)
    assert not is_doubtful(replace(end, status=Status.MAX_EVALUATIONS))
    assert not is_doubtful(replace(end, cost=1e-13 * end.trace[0].cost))
    slow = [k for k, one in enumerate(end.trace) if one.cost <= NEAR * end.cost]
    late = replace(end, trace=end.trace[slow[-MANY] + 1 :])
    assert not is_doubtful(late)
    for status in (Status.LOST, Status.VALLEY):
        assert is_doubtful(replace(late, status=status))


def test_the_lower_end_counts_and_a_tie_is_the_first() -> None:
    first = TrustRegion(attempts=1).solve(*decays())
    same = replace(first, cost=first.cost * (1 - LOWER / 2), message="the second")
    assert joined(first, same).message == first.message
    lower = joined(first, replace(same, cost=first.cost / 2))
    assert lower.message.startswith("the second; an earlier attempt ended higher")
    assert lower.evaluations.total == 2 * first.evaluations.total
    assert lower.trace[0].evaluations.total == first.evaluations.total + 1


@pytest.mark.parametrize("attempts", [0, -1, 5])
def test_no_attempt_is_refused_and_so_are_more_than_there_are_ways(attempts: int) -> None:
    with pytest.raises(BadArgument, match=f"`attempts` must be from 1 to 4, not {attempts}"):
        TrustRegion(attempts=attempts)


def peaks() -> tuple[Problem, Values]:
    """Two Gaussian peaks on a floor, and a start from which one of them loses its data."""
    x = cs.DM(np.linspace(0, 10, 80))

    def curve(b) -> cs.MX:
        return b[0] + sum(b[k] * cs.exp(-(((x - b[k + 1]) / b[k + 2]) ** 2) / 2) for k in (1, 4))

    b = Block("b", (7,))
    rows = curve(cs.vertsplit(b.symbol)) - curve([0.68, 3.16, 2.71, 0.62, 3.73, 7.17, 0.92])
    problem = Problem((Residual("peaks", rows, 1.0),), ("b",), blocks=(b,))
    return problem, {"b": np.array([2.5, 4.6, 2.7, 0.4, 18.2, 5.7, 0.7])}


def test_an_attempt_that_creeps_is_put_aside_at_half_of_the_limits() -> None:
    problem, start = peaks()
    for limit in ({"max_evaluations": 400}, {"max_iterations": 100}):
        alone = TrustRegion(attempts=1, **limit).solve(problem, start)
        assert alone.status.name == next(iter(limit)).upper()
        assert alone.cost > 30
        seen: list[Iterate] = []
        found = TrustRegion(**limit).solve(problem, start, callback=seen.append)
        assert found.converged
        assert found.cost < 1e-20
        assert found.evaluations.total < 0.65 * alone.evaluations.total
        assert "; an earlier attempt ended higher, at 30.40" in found.message
        told = [one.evaluations.total for one in seen]
        assert told == sorted(set(told))
        assert seen[-1].evaluations == found.trace[-1].evaluations == found.evaluations
        assert found.judging.total > 0


def test_who_asks_to_stop_while_an_attempt_is_aside_is_heard() -> None:
    problem, start = peaks()

    def stop(iterate: Iterate) -> bool:
        return iterate.evaluations.total > 203

    def interrupt(iterate: Iterate) -> None:
        if stop(iterate):
            raise KeyboardInterrupt

    for callback, why in ((stop, "callback"), (interrupt, "keyboard")):
        cut = TrustRegion(max_evaluations=400).solve(problem, start, callback=callback)
        assert cut.status is Status.STOPPED
        assert why in cut.message
        assert 203 < cut.evaluations.total < 208


def test_an_attempt_that_was_put_aside_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The further attempts are all the same as the first, so that none is lower."""
    monkeypatch.setattr(module, "WAYS", (module.WAYS[0],) * 3)
    problem, start = peaks()
    both = TrustRegion(attempts=3, max_evaluations=400).solve(problem, start)
    assert both.status is Status.MAX_EVALUATIONS
    assert both.evaluations.total == 400
    took = 2 * (AT_LEAST + 1)
    for alone in (
        TrustRegion(attempts=1, max_evaluations=400 - took - few).solve(problem, start)
        for few in range(5)
    ):
        if alone.cost == both.cost:
            break
    else:
        pytest.fail("it does not go on as it would have gone on alone")
    steps = TrustRegion(attempts=3, max_iterations=100).solve(problem, start)
    assert steps.status is Status.MAX_ITERATIONS
    assert 60 < steps.iterations < 95  # the others took the rest


def test_attempts_are_made_in_turn_until_a_lower_end_is_not_doubtful() -> None:
    """The first end took 400 evaluations, so that each further attempt has 100 to be lower."""
    some = TrustRegion(attempts=1).solve(*decays())

    def end(cost: float, evaluations: int, status: Status) -> Solution:
        counts = Evaluations(residual=evaluations)
        last = replace(some.trace[-1], cost=cost, evaluations=counts)
        return replace(some, cost=cost, status=status, evaluations=counts, trace=(last,))

    ends = [
        end(10.0, 400, Status.VALLEY),
        end(4.0, 300, Status.VALLEY),
        end(0.1, 300, Status.CONVERGED),
        end(1.0, 20, Status.CONVERGED),
        end(0.0, 1, Status.CONVERGED),
    ]
    on_the_way = [[], [(90, 5.0), (150, 20.0)], [(99, 9.0), (101, 9.0)], [], []]
    made: list[int] = []

    def attempt(number: int, left: Left, callback: Callback, _: object) -> Solution:
        made.append(number)
        for evaluations, cost in on_the_way[number]:
            if callback is not None and callback(end(cost, evaluations, Status.LOST).trace[0]):
                return end(cost, evaluations, Status.STOPPED)
        return ends[number]

    found = Attempts(attempt, 5).solve(Left(1000, 1000, 10.0), None)
    assert made == [0, 1, 2, 3]
    assert (found.cost, found.status) == (1.0, Status.CONVERGED)
    assert found.evaluations.total == 400 + 300 + 101 + 20
    assert found.trace[0].evaluations.total == found.evaluations.total
    assert found.judging.gradient == 4 * some.judging.gradient
    made.clear()
    Attempts(attempt, 5).solve(Left(1000, 800, 10.0), None)
    assert made == [0, 1, 2]  # then no evaluations are left


def test_what_halves_its_cost_does_not_creep() -> None:
    first = TrustRegion(attempts=1).solve(*decays()).trace[0]

    def falling(*costs: float) -> list[Iterate]:
        return [replace(first, cost=cost, optimality=0.1) for cost in costs]

    slow = [1.0] * MANY
    assert is_creeping(falling(9.0, CREEPING, *slow))
    assert is_creeping(falling(*[9.0] * 11, CREEPING, *slow))
    assert not is_creeping(falling(*[9.0] * 11, CREEPING + 0.1, *slow))
    assert not is_creeping(falling(9.0, CREEPING, *slow[1:]))


def ridge() -> tuple[Problem, Values]:
    """(x^2 - 1)^2 + y^2 from the ridge between its two minima."""
    x = Block("x", (2,)).symbol
    rows = cs.vertcat(x[0] ** 2 - 1, x[1])
    return Problem((Residual("ridge", rows, 1.0),), ("x",)), {"x": np.array([0.0, 1.0])}


def test_starts_and_stages_go_on_beyond_a_saddle() -> None:
    problem, start = ridge()
    alone = LevenbergMarquardt().solve(problem, start)
    assert alone.status is Status.SADDLE
    for solver in (Starts(1), Starts([start], workers=2), Staged((("x",),))):
        seen: list[Iterate] = []
        solution = solver.solve(problem, start, callback=seen.append)
        assert solution.converged
        np.testing.assert_allclose(np.abs(solution.values["x"]), [1, 0], atol=1e-6)
        assert solution.evaluations.total > alone.evaluations.total
        assert solution.trace[-1].cost < 1e-12 < alone.cost
    stopped = Starts(1).solve(problem, start, callback=lambda iterate: iterate.cost < 0.5)
    assert stopped.status is Status.STOPPED
    assert stopped.cost < 0.5


def test_the_trace_of_a_stage_has_no_attempt_that_was_given_up() -> None:
    """Each stage is one where the second attempt of the default is the lower one."""
    problem, start = decays()
    first = TrustRegion(attempts=1).solve(problem, start)
    staged = Staged((("b",),), TrustRegion()).solve(problem, start)
    assert staged.trace[0].evaluations.total == first.evaluations.total + 1
    assert staged.trace[staged.stages[0]].cost < 1e-20
