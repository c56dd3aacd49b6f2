"""The page that helps to choose a solver says what its numbers say."""

from pathlib import Path
from typing import Any

from benchmarks.choosing import page
from benchmarks.choosing.temperaments import JACOBIAN, TEMPERAMENTS
from workbench.solvers import SOLVERS

PLACE = Path(__file__).parents[2] / "benchmarks"
KEPT = page.read(PLACE / "results" / "choosing.json")
TR, LM = "trust-region", "levenberg-marquardt"


def rows(name: str) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = KEPT["found"][name]["solvers"]
    return found


def solved(name: str) -> dict[str, int]:
    return {solver: row["solved"] for solver, row in rows(name).items()}


def effort(name: str) -> dict[str, float]:
    return {solver: row["effort"] or float("inf") for solver, row in rows(name).items()}


def test_the_page_is_written_from_the_numbers_that_are_kept() -> None:
    assert (PLACE / "SOLVERS.md").read_text() == "\n".join(page.lines(KEPT)) + "\n"


def test_every_temperament_is_there_with_advice() -> None:
    assert set(KEPT["found"]) == set(TEMPERAMENTS) == set(page.ADVICE)
    for name, one in TEMPERAMENTS.items():
        assert set(rows(name)) == set(one.solvers) <= set(SOLVERS)
        assert all(row["starts"] == len(one.problems) * one.seeds for row in rows(name).values())


def test_well_behaved() -> None:
    needed = effort("well-behaved")
    assert needed[TR] == min(needed.values())
    assert needed["gauss-newton"] < 1.25 * needed[TR]
    assert 3.5 * needed[TR] < min(needed[s] for s in ("nlopt-lbfgs", "ipopt-lbfgs"))
    assert needed["nlopt-lbfgs"] < 4 * needed[TR]
    assert max(needed[s] for s in JACOBIAN) < 2 * needed[TR]


def test_far_start() -> None:
    most = max(solved("far start").values())
    assert solved("far start")[LM] == solved("far start")[TR] == most
    assert effort("far start")[LM] == min(effort("far start").values())


def test_noisy() -> None:
    assert solved("noisy")["ipopt"] == max(solved("noisy").values())
    assert effort("noisy")["ipopt"] < 0.5 * effort("noisy")["nlopt-bobyqa"]


def test_bounds() -> None:
    all_of = {name for name, row in rows("bounds").items() if row["solved"] == row["starts"]}
    assert all_of == {TR, LM, "nlopt-slsqp", "sqp", "nlopt-lbfgs", "scipy-trf", "ipopt"}
    assert min(effort("bounds"), key=effort("bounds").__getitem__) == "nlopt-slsqp"


def test_constraints() -> None:
    found = rows("constraints")
    assert found["ipopt-exact"]["solved"] == found["ipopt-exact"]["starts"]
    assert found["ipopt-lbfgs"]["solved"] == 0


def test_many_unknowns() -> None:
    assert min(effort("many unknowns"), key=effort("many unknowns").__getitem__) == "nlopt-lbfgs"
    assert solved("many unknowns")["nlopt-slsqp"] == 0


def test_no_derivatives() -> None:
    assert solved("no derivatives")[TR] > solved("no derivatives")["nlopt-bobyqa"]
    assert effort("no derivatives")["nlopt-bobyqa"] > 4 * effort("no derivatives")[TR]


def test_several_minima() -> None:
    most = max(row["solved"] / row["starts"] for row in rows("several minima").values())
    assert most <= 1 / 4
