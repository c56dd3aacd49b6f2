"""Processes of comparisons: they end when they are told to, and what was killed goes on."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

import workbench as wb
from tests.comparison import problems
from tests.comparison.made_up import deterministic
from tests.comparison.problems import LINE, SLIDE, Forever
from workbench import GaussNewton, LevenbergMarquardt
from workbench.comparison import Budget, Comparison, RunEnding, TargetOutcome, compare, workers
from workbench.comparison.tables import rows, write_csv
from workbench.errors import WorkbenchError

pytestmark = pytest.mark.thorough


SHORT = Budget(max_seconds=2.0, max_evaluations=300, grace=0.5)
GOOD = {"levenberg-marquardt": wb.LevenbergMarquardt(), "gauss-newton": wb.GaussNewton()}


RESUMED = """
import sys
from pathlib import Path
from tests.comparison.test_processes import many
from tests.comparison.made_up import deterministic
from workbench.comparison.tables import write_csv
found = many(Path(sys.argv[1]))
write_csv(found, Path(sys.argv[2]), deterministic(found))
"""


def many(folder: Path | None) -> Comparison:
    """A comparison of 40 short runs."""
    return compare(LINE, GOOD, seeds=20, budget=SHORT, folder=folder)


def test_killed_comparison_goes_on_to_the_same_table(tmp_path: Path) -> None:
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


def test_other_comparisons_keep_their_workers() -> None:
    """One of two that run side by side ends first, and the run of the other has not crashed."""
    budget = Budget(max_seconds=5.0, max_evaluations=10**9)
    with ThreadPoolExecutor(1) as thread:
        longer = thread.submit(compare, LINE, {"spends": problems.Spendthrift()}, budget=budget)
        time.sleep(0.5)
        compare(SLIDE, GOOD, budget=SHORT)
        assert not longer.done()
        compared = longer.result()
    assert compared.records["line, seed 0", "spends"].ending is RunEnding.CUT


def test_worker_that_does_not_begin_ends_the_comparison(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its death says nothing of the solver."""
    workers.pool().close()
    monkeypatch.setattr(workers, "WORKER_COMMAND", "raise SystemExit(3)")
    with pytest.raises(WorkbenchError, match=r"a worker process ended before .*exit code 3"):
        compare(SLIDE, GOOD, budget=SHORT)


TWO = {"lm": LevenbergMarquardt(), "gauss-newton": GaussNewton()}


def test_cluster_gives_the_same_table_when_a_worker_dies() -> None:
    budget = Budget(max_seconds=0.5, grace=0.5, max_evaluations=300)
    alone = compare((SLIDE, LINE), TWO, seeds=3, budget=budget)
    distributed = pytest.importorskip("distributed")
    parallel_config = pytest.importorskip("joblib").parallel_config
    killed: list[int] = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
        parallel_config(backend="dask"),
    ):
        workers = client.run(os.getpid)
        assert len(set(workers.values()) | {os.getpid()}) == 3  # processes of their own

        def kill_one(what: str, done: int, of: int) -> None:
            if what == "solving" and done == 3 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        compared = compare((SLIDE, LINE), TWO, seeds=3, budget=budget, progress=kill_one)
        lost = compare(replace(SLIDE, arguments={"start": 0}), {"f": Forever()}, budget=budget)
    assert killed
    names = deterministic(compared)
    assert [{k: row.get(k) for k in names} for row in rows(compared)] == [
        {k: row.get(k) for k in names} for row in rows(alone)
    ]
    assert list(lost.outcomes.values()) == [TargetOutcome.NOT_STOPPING]  # contained there, too
