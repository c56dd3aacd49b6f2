"""The folder of a run: whole, true to the numbers, and nobody else's."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.outcomes_made_up import NAMES, outcome_made_up
from tests.solutions_made_up import solution_of
from workbench.geometry import meshes
from workbench.plots import plot_overlay, sheet
from workbench.reports import write_report
from workbench.reports.page import number
from workbench.reports.run import hypotheses_table, priors_sentence, residuals_table
from workbench.solvers import Status

pytestmark = pytest.mark.xdist_group("reports of a run")  # which is made once

FILES = {
    "index.html",
    "values.npz",
    "solution.npz",
    "body.glb",
    "diagnosis.txt",
    "summary.json",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = write_report(outcome_made_up(), tmp_path_factory.mktemp("runs") / "made-up")
    assert page.name == "index.html"
    return page.parent


def test_report_writes_its_files_and_nothing_else(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]
    assert (folder / "diagnosis.txt").read_text().startswith("Jacobian 55 x 79")


def test_report_values_are_what_is_drawn(folder: Path) -> None:
    outcome = outcome_made_up()
    with np.load(folder / "values.npz", allow_pickle=False) as numbers:
        for name, value in outcome.values.items():
            np.testing.assert_array_equal(numbers[name], value)
        assert "scan 3/observed" in numbers.files
        np.testing.assert_array_equal(numbers["surface"], outcome.surface)
        for i, name in enumerate(NAMES):
            _, (ax,) = sheet(4, 5)
            plot_overlay(outcome, i, ax=ax)
            crosses, circles = ax.collections[-2:]
            np.testing.assert_array_equal(crosses.get_offsets(), numbers[f"projected:{name}"])
            seen = numbers[f"confidence:{name}"] > 0
            np.testing.assert_array_equal(circles.get_offsets(), numbers[f"observed:{name}"][seen])


def test_report_summary_is_json_without_nan(folder: Path) -> None:
    def refuse(constant: str) -> float:
        raise AssertionError(constant)

    text = (folder / "summary.json").read_text(encoding="utf-8")
    summary = json.loads(text, parse_constant=refuse)
    assert summary["name"] == "made <i>up</i>"
    assert summary["status"] == "CONVERGED"
    assert summary["measures"][1] == {"name": "unknown", "value": None, "unit": "mm", "over": ""}
    assert summary["versions"]["casadi"]
    assert set(summary["files"]) == FILES
    assert set(summary["compared"]) == {"trust-region", "gauss-newton", "nlopt-lbfgs"}
    assert summary["better"] is None
    assert summary["best_cost"] == outcome_made_up().best_cost
    assert sum(summary["costs"].values()) == pytest.approx(summary["cost"])


def test_report_page_needs_nothing_from_elsewhere(folder: Path) -> None:
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)="(?!data:|#)(?![\w.]+")', text)
    assert "<link" not in text
    assert "@import" not in text
    assert not re.findall(r"<script[^>]* src", text)
    linked = set(re.findall(r'href="([\w.]+)"', text))
    assert linked == FILES
    anchors = set(re.findall(r'href="#(\w+)"', text))
    assert anchors <= set(re.findall(r'id="(\w+)"', text))


def test_report_page_escapes_names(folder: Path) -> None:
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert "<i>up" not in text
    assert "made &lt;i&gt;up&lt;/i&gt;" in text
    assert "&lt;script&gt;alert(1)" in text
    assert "shape &lt;prior&gt;" in text
    assert "&lt;b&gt;right&lt;/b&gt; &amp; $x$ 左" in text


@pytest.mark.thorough
def test_a_problem_without_a_body_has_a_page_too(tmp_path: Path) -> None:
    outcome = outcome_made_up()
    setup = replace(outcome.setup, body=None, views=(), truth=None)
    late = replace(outcome.solution, status=Status.MAX_SECONDS, message="it took long")
    bare = replace(
        outcome,
        setup=setup,
        overlays=(),
        surface=None,
        measures=(),
        solution=late,
        compared={outcome.solver: late},
    )
    page = write_report(bare, tmp_path / "bare")
    text = page.read_text(encoding="utf-8")
    assert "Views" not in text
    assert "it took long" in text
    assert not (page.parent / "body.glb").exists()


@pytest.mark.thorough
def test_another_solver_that_found_less_is_named_with_how_much(tmp_path: Path) -> None:
    outcome = outcome_made_up()
    cost = outcome.solution.cost
    less = replace(outcome.solution, cost=cost / 2)
    poor = replace(outcome, compared=outcome.compared | {"ipopt": less})
    page = write_report(poor, tmp_path / "poor")
    said = f"ipopt found a lower cost from the same start: {number(cost / 2, 6)}, which is"
    text = page.read_text(encoding="utf-8")
    assert said in text
    assert "(50.0%) less than trust-region found" in text
    assert 'class="ending"' in text  # not the green of a good end
    summary = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))
    assert summary["better"] == "ipopt"
    assert summary["compared"]["trust-region"]["excess"] == pytest.approx(1.0)
    assert summary["best_cost"] == cost / 2


def test_residuals_say_what_they_add_and_which_are_priors(folder: Path) -> None:
    outcome = outcome_made_up()
    setup = replace(outcome.setup, priors=("shape <prior>", "place"))
    table = residuals_table(replace(outcome, setup=setup))
    assert [row[:3] for row in table.rows] == [
        (r.name, kind, str(r.size))
        for r, kind in zip(setup.problem.residuals, ("data", "prior", "prior"), strict=True)
    ]
    assert table.rows[0][3:5] == ("1", "px")
    shares = [float(row[6].removesuffix("%")) for row in table.rows]
    assert sum(shares) == pytest.approx(100, abs=0.2)
    said = priors_sentence(replace(outcome, setup=setup))
    assert said.startswith("The priors, shape <prior> and place, make up ")
    assert f"{shares[1] + shares[2]:.0f}" in said
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert ">Residuals</h2>" in text
    assert priors_sentence(outcome) in text


def test_report_mesh_is_the_posed_surface(folder: Path) -> None:
    found = meshes.read_mesh(folder / "body.glb")
    np.testing.assert_allclose(found.vertices, outcome_made_up().surface, atol=1e-5)


MINIMA = {0.25: (4, 0, 7), 2.123456789: tuple(range(19, 7, -1)) + (3, 5), np.inf: (1,)}
ENDED = Status.CONVERGED, Status.MAX_ITERATIONS, Status.NOT_FINITE


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
