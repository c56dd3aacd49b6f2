"""Costs on the way down, on an axis that has no zero."""

from dataclasses import replace

import numpy as np
import pytest

from tests.outcomes_made_up import outcome_made_up
from workbench.fitting.setup import MANY
from workbench.plots import sheet
from workbench.plots.palette import solver_styles
from workbench.plots.solutions import plot_convergence
from workbench.reports.page import page
from workbench.reports.replay import Recording
from workbench.reports.run import solvers_table
from workbench.solvers import SOLVERS, Evaluations, Iterate, Solution, Status

pytestmark = pytest.mark.browser


NOTHING = Recording({}, {}, "")


def solution(costs: list[float], status: Status = Status.CONVERGED) -> Solution:
    trace = tuple(
        Iterate({}, cost, 0.0, 0.0, 0.0, Evaluations(residual=i), 0.1 * i)
        for i, cost in enumerate(costs)
    )
    best = min(c for c in costs if np.isfinite(c))
    return Solution({}, best, 0.0, status, "", "made-up", Evaluations(), 1.0, trace)


def test_convergence_draws_every_iterate() -> None:
    solutions = {"a": solution([11.0, 3.0, 1.0]), "b": solution([11.0, 6.0], Status.STALLED)}
    _, (ax,) = sheet(4, 4)
    plot_convergence(solutions, ax=ax)
    first, _, second, end = ax.get_lines()[:4]
    np.testing.assert_array_equal(first.get_xdata(), [0, 1, 2])
    np.testing.assert_allclose(first.get_ydata()[:2], [1.0, 0.2])
    assert 0 < first.get_ydata()[2] < 0.2  # the best itself: on the floor
    np.testing.assert_allclose(second.get_ydata(), [1.0, 0.5])
    assert end.get_markerfacecolor() == "white"  # it did not converge
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "a: converged",
        "b: stalled",
    ]
    assert ax.get_yscale() == "log"
    assert ax.get_xlabel()
    assert ax.get_ylabel()


def test_legend_says_what_the_table_says() -> None:
    """Of the solvers that converged, only those at the lowest cost are called converged alone."""
    compared = {
        "trust-region": solution([11.0, 1.0]),
        "gauss-newton": solution([11.0, 2.0]),
        "ipopt": solution([11.0, 3.0], Status.MAX_ITERATIONS),
    }
    outcome = replace(outcome_made_up(), compared=compared)
    _, (ax,) = sheet(4, 4)
    plot_convergence(compared, ax=ax)
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    table = [f"{row[0]}: {row[1]}" for row in solvers_table(outcome).rows]
    assert legend == table
    assert legend[1:] == ["gauss-newton: converged, not lowest", "ipopt: max iterations"]


def test_a_solver_has_one_colour_everywhere() -> None:
    every = solver_styles(SOLVERS)
    assert len({(style.line["color"], style.linestyle) for style in every.values()}) == len(SOLVERS)
    assert len({every[name].color for name in MANY}) == len(MANY)
    some = solver_styles(["ipopt", "mine", "scipy-lm", "trust-region", "other"])
    assert {name: some[name] for name in some if name in every} == {
        name: every[name] for name in ("ipopt", "scipy-lm", "trust-region")
    }
    assert len({style.color for style in some.values()}) == len(some)
    assert solver_styles(["staged ipopt"])["staged ipopt"] == every["ipopt"]
    assert len({style.color for style in solver_styles(["staged ipopt", "ipopt"]).values()}) == 2
    _, (ax,) = sheet(4, 4)
    plot_convergence({"ipopt": solution([2.0, 1.0]), "gauss-newton": solution([2.0, 1.5])}, ax=ax)
    assert ax.get_lines()[0].get_color() == every["ipopt"].color
    assert ax.get_lines()[2].get_color() == every["gauss-newton"].color
    html = page("replay_page.html", title="", said=(), recording=NOTHING, without="")
    assert f'"gauss-newton": "{every["gauss-newton"].color}"' in html
