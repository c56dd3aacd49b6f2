"""Whole comparisons, in worker processes: good solvers, bad ones, stored ones."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.comparison import problems
from tests.comparison.problems import ANGLE, LINE, NOWHERE, SLIDE, STARTS
from workbench.comparison import Budget, Comparison, TargetOutcome, compare, workers
from workbench.comparison.tidy import deterministic, rows, write_csv
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


@pytest.mark.parametrize(
    ("solver", "verdict", "said"),
    [
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
    ],
)
def test_bad_solvers_are_told_for_what_they_are(
    bad: Comparison, solver: str, verdict: TargetOutcome, said: str
) -> None:
    name = bad.instances[0].name
    assert bad.outcomes[name, solver] is verdict
    assert said in bad.records[name, solver].message


def test_a_lie_about_the_cost_is_no_success(bad: Comparison) -> None:
    record = bad.records[bad.instances[0].name, "liar"]
    assert record.claimed_cost == 0
    assert record.cost == pytest.approx(0.5 * (900 + 0.09 + 0.0004))  # of its start (3, 2)
    assert bad.success("liar", 1e-1).value == 0


def test_what_was_seen_before_a_run_was_lost_is_kept(bad: Comparison) -> None:
    for solver in ("forever", "in C", "raiser"):
        record = bad.records[bad.instances[0].name, solver]
        assert record.evaluations.jacobian == 1
        assert len(record.observed.trace) == 1


def test_nobody_spends_more_than_the_budget_and_three_evaluations_to_close_the_books(
    bad: Comparison,
) -> None:
    assert bad.records[bad.instances[0].name, "spendthrift"].evaluations.residual == 303


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> tuple[Comparison, Comparison, Path]:
    """The same comparison with one worker and, stored, with two."""
    folder = tmp_path_factory.mktemp("comparison") / "two"
    wanted = (SLIDE, ANGLE, LINE)
    alone = compare(wanted, GOOD, seeds=3, budget=SHORT)
    return alone, compare(wanted, GOOD, seeds=3, budget=SHORT, workers=2, folder=folder), folder


def fixed(comparison: Comparison) -> list[dict[str, object]]:
    names = deterministic(comparison)
    return [{k: row.get(k) for k in names} for row in rows(comparison)]


def test_workers_change_nothing(twice: tuple[Comparison, Comparison, Path]) -> None:
    alone, two, _ = twice
    assert fixed(alone) == fixed(two)
    assert len(fixed(two)) == 2 * len(two.instances)


def test_every_solver_starts_from_the_same_points(
    twice: tuple[Comparison, Comparison, Path],
) -> None:
    found = twice[0]
    for instance in found.instances:
        first = {found.records[instance.name, s].observed.trace[0, -1] for s in found.solvers}
        assert first == {found.described[instance.name].start_cost}
    starts = [found.described[i.name].start for i in found.of("slide")]
    np.testing.assert_array_equal(starts, STARTS)


def test_numbers_run_out_where_the_experiment_says_so(
    twice: tuple[Comparison, Comparison, Path],
) -> None:
    """`angle` has two starts only: a third is an IndexError of its own, which is told."""
    found = twice[0]
    assert [i.number for i in found.of("angle")] == [0, 1]
    assert "angle, start 2" in found.unbuilt
    nist = compare("nist-misra1a", GOOD, seeds=4, budget=SHORT)
    assert [i.number for i in nist.instances] == [1, 2]  # NIST's own numbers; no more, no error
    assert nist.unbuilt == {}
    assert (nist.digits("levenberg-marquardt") > 6).all()


def test_starts_share_a_yardstick_and_seeds_with_other_data_do_not(
    twice: tuple[Comparison, Comparison, Path],
) -> None:
    found = twice[0]
    sizes = {group[0].partition(",")[0]: len(group) for group in found.groups}
    assert sizes == {"slide": 3, "angle": 2, "line": 1}
    assert len({found.yardsticks[i.name].best for i in found.of("line")}) == 3


def test_the_lost_start_of_the_slide_is_lost_by_both_and_explained(
    twice: tuple[Comparison, Comparison, Path],
) -> None:
    found = twice[0]
    for solver in GOOD:
        outcomes = [found.outcomes[i.name, solver] for i in found.of("slide")]
        assert outcomes == [TargetOutcome.REACHED, TargetOutcome.OTHER_BASIN, TargetOutcome.REACHED]
    told = found.end_analysis("slide, start 0").explanations
    assert list(told) == [1]
    assert "x[b]" in str(told[1])


def test_an_effort_is_the_price_of_what_was_asked_until_then(
    twice: tuple[Comparison, Comparison, Path],
) -> None:
    found = twice[0]
    row = found.met("line, seed 0", "gauss-newton", 1e-5)
    assert row is not None
    # a linear problem: one Jacobian, and a look at the radius and at the whole step
    assert (row[0], row[2]) == (2, 1)
    prices = found.prices["line"]
    expected = row[0] + row[1] * prices["gradient"] + row[2] * prices["jacobian"]
    assert (prices["gradient"], prices["jacobian"]) == (4.0, 1 + 1.5 * 3)  # published, n = 3
    assert expected == 2 + 5.5
    at = [i.name for i in found.instances].index("line, seed 0")
    assert found.needed(1e-5)[at, 1] == pytest.approx(expected)


def test_what_is_stored_is_not_run_again(twice: tuple[Comparison, Comparison, Path]) -> None:
    _, two, folder = twice
    seen: list[tuple[str, int, int]] = []
    began = time.perf_counter()
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
    assert time.perf_counter() - began < 20
    (folder / "runs" / "torn.npz").write_bytes(b"PK")
    for stored in folder.glob("runs/run-*.npz"):
        stored.write_bytes(stored.read_bytes()[:100])  # torn files count as none
    assert fixed(compare(SLIDE, GOOD, seeds=3, budget=SHORT, folder=folder)) == [
        row for row in fixed(two) if row["problem"] == "slide"
    ]


def test_a_table_is_tidy(twice: tuple[Comparison, Comparison, Path], tmp_path: Path) -> None:
    write_csv(twice[1], tmp_path / "results.csv")
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    assert len(found) == 16
    row = next(r for r in found if r["problem"] == "slide" and r["number"] == "1")
    assert row["verdict"] == "OTHER_BASIN"
    assert row["basin"] == "2"
    assert row["jacobian to 1e-7"] == ""  # never met
    assert int(row["jacobian to 0.1"]) > 0
    assert float(row["seconds"]) > 0


def test_a_problem_without_a_finite_start_fails_everybody() -> None:
    found = compare(NOWHERE, GOOD, budget=SHORT)
    for solver in GOOD:
        assert found.outcomes["nowhere", solver] is TargetOutcome.NO_SOLUTION
        assert found.success(solver, 1e-1).value == 0


RESUMED = """
import sys
from pathlib import Path
from tests.comparison.test_compare import many
from workbench.comparison.tidy import deterministic, write_csv
found = many(Path(sys.argv[1]))
write_csv(found, Path(sys.argv[2]), deterministic(found))
"""


def many(folder: Path | None) -> Comparison:
    """A comparison of 40 short runs."""
    return compare(LINE, GOOD, seeds=20, budget=SHORT, folder=folder)


def test_a_comparison_that_was_killed_goes_on_to_the_same_table(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    folder, table = tmp_path / "killed", tmp_path / "killed.csv"
    command = [sys.executable, "-c", RESUMED, str(folder), str(table)]
    first = subprocess.Popen(command, env=environment)
    while len(list(folder.glob("runs/run-*.npz"))) < 3:
        assert first.poll() is None
        time.sleep(0.02)
    first.send_signal(signal.SIGKILL)
    first.wait()
    assert not table.exists()
    done = {path: path.stat().st_mtime_ns for path in folder.glob("runs/run-*.npz")}
    assert 3 <= len(done) < 40
    subprocess.run(command, env=environment, check=True, timeout=120)
    whole = many(None)
    write_csv(whole, tmp_path / "whole.csv", deterministic(whole))
    assert table.read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert all(path.stat().st_mtime_ns == when for path, when in done.items())
    assert json.loads((folder / "comparison.json").read_text())["kind"] == "comparison"


def test_mistakes_are_said_before_anything_runs(tmp_path: Path) -> None:
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
    held = (
        wb.experiments.Experiment("held", lambda: made, "")
        if hasattr(wb, "experiments")
        else (replace(SLIDE, name="held", build=lambda: made))
    )
    with pytest.raises(BadArgument, match="experiment held cannot go to another process"):
        compare(held, GOOD)


def test_solvers_that_draw_draw_the_same_again_and_other_numbers_from_other_starts() -> None:
    ends = [
        [
            r.end.tolist()
            for r in compare(LINE, problems.Drawer(), seeds=2, budget=SHORT).records.values()
        ]
        for _ in range(2)
    ]
    assert ends[0] == ends[1]
    assert ends[0][0] != ends[0][1]


def test_if_nothing_can_be_built_that_is_an_error() -> None:
    with pytest.raises(WorkbenchError, match=r"no experiment can be built; slide: .*start=7"):
        compare(replace(SLIDE, arguments={"start": 7}), GOOD, budget=SHORT)


def test_where_nothing_can_be_forked_processes_start_plainly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "FORKING", False)
    found = compare(
        replace(SLIDE, arguments={"start": 0}), {"dies": problems.Dies()} | GOOD, budget=SHORT
    )
    said = [v for (_, solver), v in found.outcomes.items()]
    assert said == [TargetOutcome.CRASHED, TargetOutcome.REACHED, TargetOutcome.REACHED]
    assert "SIGABRT" in found.records["slide", "dies"].message


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="asks Linux for children")
def test_no_process_is_left_of_a_comparison_that_was_killed() -> None:
    """A solver that never stops, and whoever waits for it is killed."""
    command = (
        "from tests.comparison.problems import *; from workbench.comparison import *;"
        "compare(LINE, {'forever': Forever()}, budget=Budget(max_seconds=1, grace=0.5))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, "-c", command], env=environment)
    below: set[int] = set()
    while len(below) < 2:  # the one that forks, and its child
        assert parent.poll() is None
        time.sleep(0.02)
        below = descendants(parent.pid)
    time.sleep(0.5)  # by now the solver is at it, as a rule
    parent.kill()
    parent.wait()
    until = time.monotonic() + 60
    while any(Path(f"/proc/{pid}").exists() for pid in below):
        assert time.monotonic() < until
        time.sleep(0.1)


def descendants(pid: int) -> set[int]:
    """Of a process of this machine, on Linux."""
    found = set()
    for children in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in children.read_text().split():
            found |= {int(child)} | descendants(int(child))
    return found
