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
from workbench.solvers.attempts import LOWER, MANY, NEAR, is_doubtful, joined
from workbench.solvers.iterate import Iterate

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
    assert both.message.endswith(f"; a first attempt ended higher, at {first.cost:.6g}")
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
    """Freudenstein and Roth's second minimum, 24.49, is where both attempts lead."""
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
    assert 0.5 * first.evaluations.total < spent < 0.6 * first.evaluations.total
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
    assert is_doubtful(end, problem, 1e-6)
    assert not is_doubtful(end, problem, 1e-3)  # an end that is only a start
    assert not is_doubtful(end, decays(unread=14)[0], 1e-6)
    assert not is_doubtful(replace(end, status=Status.MAX_EVALUATIONS), problem, 1e-6)
    assert not is_doubtful(replace(end, cost=1e-13 * end.trace[0].cost), problem, 1e-6)
    slow = [k for k, one in enumerate(end.trace) if one.cost <= NEAR * end.cost]
    late = replace(end, trace=end.trace[slow[-MANY] + 1 :])
    assert not is_doubtful(late, problem, 1e-6)
    for status in (Status.LOST, Status.VALLEY):
        assert is_doubtful(replace(late, status=status), problem, 1e-6)


def test_the_lower_end_counts_and_a_tie_is_the_first() -> None:
    first = TrustRegion(attempts=1).solve(*decays())
    same = replace(first, cost=first.cost * (1 - LOWER / 2), message="the second")
    assert joined(first, same).message == first.message
    lower = joined(first, replace(same, cost=first.cost / 2))
    assert lower.message.startswith("the second; a first attempt ended higher")
    assert lower.evaluations.total == 2 * first.evaluations.total
    assert lower.trace[0].evaluations.total == first.evaluations.total + 1


@pytest.mark.parametrize("attempts", [0, -1])
def test_no_attempt_is_refused(attempts: int) -> None:
    with pytest.raises(BadArgument, match=f"`attempts` must be 1 or more, not {attempts}"):
        TrustRegion(attempts=attempts)


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
