"""Comparisons past one machine: the same results, even if workers die on the way."""

import os
import signal

import pytest
from joblib import parallel_config

from tests.comparison.problems import LINE, SLIDE, Forever
from workbench import GaussNewton, LevenbergMarquardt
from workbench.comparison import Budget, Verdict, compare
from workbench.comparison.tidy import deterministic, rows

distributed = pytest.importorskip("distributed")

SOLVERS = {"lm": LevenbergMarquardt(), "gauss-newton": GaussNewton(), "forever": Forever()}


def test_a_cluster_gives_the_same_table_although_a_worker_is_killed() -> None:
    wanted = (SLIDE, LINE)
    budget = Budget(max_seconds=0.5, grace=0.5, max_evaluations=300)
    alone = compare(wanted, SOLVERS, seeds=3, budget=budget, workers=2)
    killed: list[int] = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = client.run(os.getpid)
        assert len(set(workers.values()) | {os.getpid()}) == 3  # processes of their own

        def kill_one(what: str, done: int, of: int) -> None:
            if what == "solving" and done == 4 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        with parallel_config(backend="dask"):
            found = compare(wanted, SOLVERS, seeds=3, budget=budget, progress=kill_one)
    assert killed
    names = deterministic(found)
    assert [{k: row.get(k) for k in names} for row in rows(found)] == [
        {k: row.get(k) for k in names} for row in rows(alone)
    ]
    for instance in found.instances:
        assert found.verdicts[instance.name, "forever"] is Verdict.NOT_STOPPING
        assert found.verdicts[instance.name, "lm"] is not Verdict.NOT_STOPPING
