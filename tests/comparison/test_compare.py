"""Whole comparisons, in worker processes: good solvers, bad ones, stored and repeated ones."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

import workbench as wb
from tests.comparison import problems
from tests.comparison.made_up import deterministic, in_this_process
from tests.comparison.problems import ANGLE, LINE, NOWHERE, SLIDE
from workbench.comparison import Budget, Comparison, TargetOutcome, compare
from workbench.comparison.tables import rows, write_csv
from workbench.errors import BadArgument, BadFile, UnknownName, WorkbenchError

SHORT = Budget(max_seconds=2.0, max_evaluations=300, grace=0.5)
BAD = {
    "liar": problems.Liar(),
    "raiser": problems.Raiser(),
    "not a number": problems.NotANumber(),
    "forever": problems.Forever(),
    "in C": problems.InC(),
    "dies": problems.Dies(),
    "leaves": problems.Leaves(),
    "spendthrift": problems.Spendthrift(),
}
GOOD = {"levenberg-marquardt": wb.LevenbergMarquardt(), "gauss-newton": wb.GaussNewton()}


@pytest.fixture(scope="module")
def bad() -> Comparison:
    budget = replace(SHORT, max_seconds=0.5)
    return compare(replace(SLIDE, arguments={"start": 0}), BAD | GOOD, budget=budget, workers=2)


OUTCOMES: list[tuple[str, TargetOutcome, str]] = [
    ("liar", TargetOutcome.FALSE_CLAIM, "trust me"),
    ("raiser", TargetOutcome.RAISED, "ValueError: out of ideas"),
    ("not a number", TargetOutcome.NO_SOLUTION, "block 'x' holds nan"),
    ("forever", TargetOutcome.NOT_STOPPING, "it took too long"),
    ("in C", TargetOutcome.NOT_STOPPING, "it took too long"),
    ("dies", TargetOutcome.CRASHED, "SIGABRT"),
    ("leaves", TargetOutcome.RAISED, "SystemExit: 3"),
    ("spendthrift", TargetOutcome.OUT_OF_BUDGET, "out of evaluations"),
    ("levenberg-marquardt", TargetOutcome.REACHED, ""),
    ("gauss-newton", TargetOutcome.REACHED, ""),
]


@pytest.mark.thorough
def test_bad_solvers_have_their_outcomes(bad: Comparison) -> None:
    for solver, verdict, said in OUTCOMES:
        name = bad.instances[0].name
        assert bad.outcomes[name, solver] is verdict, solver
        assert said in bad.records[name, solver].message
    for solver in ("forever", "in C", "raiser"):  # a lost run keeps what was seen
        assert bad.records[name, solver].evaluations.jacobian == 1


def test_reported_cost_is_ignored() -> None:
    with in_this_process():
        bad = compare(SLIDE, BAD["liar"], budget=SHORT)
    record = bad.records["slide, start 0", "Liar"]
    assert record.claimed_cost == 0
    assert record.cost == pytest.approx(0.5 * (900 + 0.09 + 0.0004))  # of its start (3, 2)
    assert bad.outcomes["slide, start 0", "Liar"] is not TargetOutcome.REACHED


WANTED = (SLIDE, ANGLE, LINE)


@pytest.fixture(scope="module")
def alone() -> Comparison:
    with in_this_process():
        return compare(WANTED, GOOD, seeds=3, budget=SHORT)


@pytest.fixture(scope="module")
def twice(
    alone: Comparison, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Comparison, Comparison, Path]:
    """The same comparison here and, stored, by two worker processes."""
    folder = tmp_path_factory.mktemp("comparison") / "two"
    return alone, compare(WANTED, GOOD, seeds=3, budget=SHORT, workers=2, folder=folder), folder


def fixed(comparison: Comparison) -> list[dict[str, object]]:
    names = deterministic(comparison)
    return [{k: row.get(k) for k in names} for row in rows(comparison)]


@pytest.mark.thorough
def test_workers_change_nothing(twice: tuple[Comparison, Comparison, Path]) -> None:
    alone, two, _ = twice
    assert fixed(alone) == fixed(two)
    assert len(fixed(two)) == 2 * len(two.instances)


def test_starts_share_reference_costs_and_seeds_do_not(alone: Comparison) -> None:
    compared = alone
    sizes = {group[0].partition(",")[0]: len(group) for group in compared.groups}
    assert sizes == {"slide": 3, "angle": 2, "line": 1}
    assert len({compared.references[i.name].best for i in compared.instances_of("line")}) == 3


def test_lost_start_of_the_slide_is_another_basin(alone: Comparison) -> None:
    compared = alone
    for solver in GOOD:
        outcomes = [compared.outcomes[i.name, solver] for i in compared.instances_of("slide")]
        assert outcomes == [TargetOutcome.REACHED, TargetOutcome.OTHER_BASIN, TargetOutcome.REACHED]


def test_effort_is_the_price_of_evaluations(alone: Comparison) -> None:
    compared = alone
    row = compared.reached_at("line, seed 0", "gauss-newton", 1e-5)
    assert row is not None
    assert (row[0], row[2]) == (1, 1)  # a linear problem: one Jacobian, and the whole step
    prices = compared.prices["line"]
    expected = row[0] + row[1] * prices["gradient"] + row[2] * prices["jacobian"]
    assert (prices["gradient"], prices["jacobian"]) == (4, 3 + 1)  # n = 3
    assert expected == 1 + 4
    at = [i.name for i in compared.instances].index("line, seed 0")
    assert compared.needed(1e-5)[at, 1] == pytest.approx(expected)


@pytest.mark.thorough
def test_stored_runs_are_not_repeated(twice: tuple[Comparison, Comparison, Path]) -> None:
    _, two, folder = twice
    seen: list[tuple[str, int, int]] = []
    again = compare(
        (SLIDE, ANGLE, LINE),
        GOOD,
        seeds=3,
        budget=SHORT,
        folder=folder,
        progress=lambda what, done, of: seen.append((what, done, of)),
    )
    assert [(done, of) for what, done, of in seen if what == "solving"] == [(16, 16)]
    assert list(rows(again)) == list(rows(two))  # times, too
    (folder / "runs" / "torn.npz").write_bytes(b"PK")
    for stored in folder.glob("runs/run-*.npz"):
        stored.write_bytes(stored.read_bytes()[:100])  # torn files count as none
    assert fixed(compare(SLIDE, GOOD, seeds=3, budget=SHORT, folder=folder)) == [
        row for row in fixed(two) if row["problem"] == "slide"
    ]


def test_a_table_is_tidy(alone: Comparison, tmp_path: Path) -> None:
    write_csv(alone, tmp_path / "results.csv")
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == 16
    row = next(r for r in table if r["problem"] == "slide" and r["number"] == "1")
    assert row["verdict"] == "OTHER_BASIN"
    assert row["basin"] == "2"
    assert row["jacobian to 1e-7"] == ""  # never met
    assert int(row["jacobian to 0.1"]) > 0
    assert float(row["seconds"]) > 0


def test_problem_without_a_finite_start_fails_all() -> None:
    compared = compare(NOWHERE, GOOD, budget=SHORT)
    for solver in GOOD:
        assert compared.outcomes["nowhere", solver] is TargetOutcome.NO_SOLUTION
        assert compared.success(solver, 1e-1).value == 0


def test_mistakes_are_refused_before_solving(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="no solver is called 'newtons'"):
        compare(SLIDE, "newtons")
    with pytest.raises(UnknownName, match="no experiment is called 'slides'"):
        compare("slides", "gauss-newton")
    with pytest.raises(BadArgument, match="seeds is how many"):
        compare(SLIDE, GOOD, seeds=0)
    with pytest.raises(BadArgument, match="workers is how many"):
        compare(SLIDE, GOOD, workers=0)
    with pytest.raises(BadArgument, match="max_seconds of a budget must be above 0"):
        Budget(max_seconds=0)
    with pytest.raises(BadArgument, match="no solver to compare"):
        compare(SLIDE, ())
    with pytest.raises(BadArgument, match="no experiment to compare"):
        compare((), GOOD)
    with pytest.raises(BadArgument, match="two solvers are called 'LevenbergMarquardt'"):
        compare(SLIDE, [wb.LevenbergMarquardt(max_iterations=k) for k in (3, 4)])
    with pytest.raises(BadArgument, match="must be a value, not a class"):
        compare(SLIDE, {"lm": wb.LevenbergMarquardt})  # type: ignore[dict-item]
    with pytest.raises(BadArgument, match="slide, start 0 is there twice"):
        compare((SLIDE, SLIDE), GOOD)
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadFile, match="holds no comparison"):
        compare(SLIDE, GOOD, folder=tmp_path)
    made = problems.slide()
    held = replace(SLIDE, name="held", build=lambda: made)
    with pytest.raises(BadArgument, match="experiment held cannot go to another process"):
        compare(held, GOOD)


def test_solvers_that_draw_are_reproducible() -> None:
    with in_this_process():
        twice = [compare(LINE, problems.Drawer(), seeds=2, budget=SHORT) for _ in range(2)]
    ends = [[record.end.tolist() for record in compared.records.values()] for compared in twice]
    assert ends[0] == ends[1]
    assert ends[0][0] != ends[0][1]


def test_comparison_of_nothing_built_is_refused() -> None:
    with pytest.raises(WorkbenchError, match=r"no experiment can be built; slide: .*start=7"):
        compare(replace(SLIDE, arguments={"start": 7}), GOOD, budget=SHORT)
