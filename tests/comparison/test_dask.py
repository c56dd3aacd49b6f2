"""Comparisons past one machine: the same results, even if workers die on the way."""

import os
import signal
from dataclasses import replace

import pytest
from joblib import parallel_config

from tests.comparison.problems import LINE, SLIDE, Forever
from workbench import GaussNewton, LevenbergMarquardt
from workbench.comparison import Budget, TargetOutcome, compare
from workbench.comparison.tidy import deterministic, rows

distributed = pytest.importorskip("distributed")

SOLVERS = {"lm": LevenbergMarquardt(), "gauss-newton": GaussNewton()}


def test_a_cluster_gives_the_same_table_although_a_worker_is_killed() -> None:
    budget = Budget(max_seconds=0.5, grace=0.5, max_evaluations=300)
    alone = compare((SLIDE, LINE), SOLVERS, seeds=3, budget=budget)
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

        found = compare((SLIDE, LINE), SOLVERS, seeds=3, budget=budget, progress=kill_one)
        lost = compare(replace(SLIDE, arguments={"start": 0}), {"f": Forever()}, budget=budget)
    assert killed
    names = deterministic(found)
    assert [{k: row.get(k) for k in names} for row in rows(found)] == [
        {k: row.get(k) for k in names} for row in rows(alone)
    ]
    assert list(lost.outcomes.values()) == [TargetOutcome.NOT_STOPPING]  # contained there, too
