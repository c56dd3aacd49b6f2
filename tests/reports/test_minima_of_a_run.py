"""The minima that several starts found, on the page of a run and in its table."""

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from tests.outcomes_made_up import outcome_made_up
from tests.solutions_made_up import solution_of
from workbench.experiments import Outcome
from workbench.plots import caption_minima
from workbench.reports.report import run_page
from workbench.reports.tables import hypotheses_table
from workbench.solvers import Status

MINIMA = {0.25: (4, 0, 7), 2.123456789: tuple(range(19, 7, -1)) + (3, 5), np.inf: (1,)}
ENDED = Status.CONVERGED, Status.MAX_ITERATIONS, Status.NOT_FINITE


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    """A run of several starts."""
    made_up = outcome_made_up()
    found = solution_of(MINIMA, ENDED).hypotheses
    return replace(made_up, solution=replace(made_up.solution, hypotheses=found))


def test_the_table_has_a_row_for_each_minimum() -> None:
    table = hypotheses_table(solution_of(MINIMA, ENDED))
    assert table.head == ("minimum", "cost", "starts", "their numbers", "best run")
    assert table.rows == (
        ("1", "0.25", "3", "0, 4, 7", "converged"),
        ("2", "2.1234568", "14", "3, 5, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17 and 2 more",
         "max iterations"),
        ("3", "∞", "1", "1", "not finite"),
    )  # fmt: skip
    assert table.numbers == (0, 1, 2)
    assert hypotheses_table(solution_of({})).rows == ()


def test_the_page_has_a_section_with_the_figure_and_the_table(outcome: Outcome) -> None:
    page = run_page(outcome, {})
    assert '<a href="#minima">Minima</a>' in page
    section = re.search(r'<h2 id="minima">Minima</h2>(.*?)<h2 ', page, re.DOTALL)
    assert section
    text = " ".join(unescape(re.sub(r"<[^>]*>", " ", section[1])).split())
    assert caption_minima(outcome.solution) in text
    assert section[1].count("<figure") == 1
    for row in hypotheses_table(outcome.solution).rows:
        assert " ".join(row) in text
    assert "Start 0 is the start of the problem." in text


def test_the_page_of_one_start_has_no_such_section() -> None:
    assert "inima</" not in run_page(outcome_made_up(), {})
