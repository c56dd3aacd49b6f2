"""Where many starts end: a step for each minimum."""

import numpy as np
import pytest

from tests.solutions_made_up import solution_of
from workbench.errors import BadArgument
from workbench.plots import (
    caption_minima,
    plot_minima,
    png,
    sheet,
)
from workbench.plots.scans import plot_joint_cost
from workbench.solvers import Solution
from workbench.training.execution import LogEntry

THREE = {0.5: (4, 0, 7), 2.0: (1, 2, 3, 5, 6), 30.0: (8,)}


def drawn(solution: Solution) -> list[tuple[list[float], list[float]]]:
    """The abscissas and ordinates of each line."""
    figure, (ax,) = sheet(4, 3)
    assert plot_minima(solution, ax=ax) is ax
    assert png(figure).startswith(b"\x89PNG")
    return [(line.get_xdata().tolist(), line.get_ydata().tolist()) for line in ax.get_lines()]


def test_minimum_is_a_step_as_wide_as_its_starts() -> None:
    assert drawn(solution_of(THREE)) == [
        ([1, 2, 3], [0.5] * 3),
        ([4, 5, 6, 7, 8], [2.0] * 5),
        ([9], [30.0]),
    ]


def test_cost_of_zero_is_drawn_below_the_others() -> None:
    (_, lowest), (_, other) = drawn(solution_of({0.0: (0,), 4.0: (1,)}))
    assert lowest == [4e-12]
    assert other == [4.0]
    assert drawn(solution_of({0.0: (0, 1)})) == [([1, 2], [1e-12] * 2)]


@pytest.mark.parametrize("failed", [np.inf, np.nan])
def test_ends_without_a_cost_leave_their_places_empty(failed: float) -> None:
    solution = solution_of({1.0: (0, 3), failed: (1,), 5.0: (2,)})
    assert drawn(solution) == [([1, 2], [1.0, 1.0]), ([4], [5.0])]
    assert "there are 3," in caption_minima(solution)
    assert " 1 of the runs ended without a finite cost and is not drawn. " in caption_minima(
        solution
    )
    assert not drawn(solution_of({failed: (0, 1)}))


def test_caption_of_minima_says_how_sure_it_is() -> None:
    said = caption_minima(solution_of(THREE))
    assert "The cost at the end of 9 runs" in said
    assert "there are 3, and 3 of the 9 starts led to the lowest" in said
    sure = 7 / 9 * 6 / 10 * 5 / 11  # (n - 1 - i) / (n - 1 + i), n = 9
    assert said.endswith(f"The probability that there are no further minima is {sure:.2g}.")
    assert "not drawn" not in said
    two = caption_minima(solution_of({1.0: (0,), 2.0: (1,)}))
    assert "too few starts to say whether there are further minima" in two


def test_minima_of_one_start_are_refused() -> None:
    _, (ax,) = sheet(4, 3)
    for refused in (lambda one: plot_minima(one, ax=ax), caption_minima):
        with pytest.raises(BadArgument, match=r"solution of made-up holds no minima .* `Starts`"):
            refused(solution_of({}))


def test_joint_cost_draws_more_terms_than_there_are_marks() -> None:
    costs = {f"E_{k}": 1.0 + k for k in range(12)}
    _, (ax,) = sheet(4, 3)
    plot_joint_cost([LogEntry("model", costs, {name: 0.5 for name in costs}, {}, 0.0)], ax=ax)
    assert len(ax.get_lines()) == 13
    assert ax.get_lines()[0].get_ydata().tolist() == [78.0, 6.0]
