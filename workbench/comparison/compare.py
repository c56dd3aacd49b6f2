"""Carrying out a comparison: in processes that can be killed, stored as it goes."""

import uuid
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from workbench.comparison.comparison import Comparison
from workbench.comparison.design import (
    Budget,
    Design,
    Experiments,
    Instance,
    NamedSolver,
    Solvers,
    design,
)
from workbench.comparison.ends import EndAnalysis
from workbench.comparison.record import Description, Record, Stored, ended
from workbench.comparison.store import FolderStore
from workbench.comparison.workers import AnalyseEnds, JobFailed, Solve, SolverJob, answered, pool
from workbench.errors import BadArgument, WorkbenchError
from workbench.writing import Keeping

T = TypeVar("T")
Callback = Callable[[str, int, int], object]  # what is going on, how many are done, of how many


def compare(
    experiments: Experiments,
    solvers: Solvers,
    *,
    seeds: int = 1,
    budget: Budget | None = None,
    workers: int = 1,
    folder: str | Path | None = None,
    progress: Callback = lambda what, done, of: None,
) -> Comparison:
    """Every experiment, from `seeds` starts, by every solver, under one budget.

    Experiments are names, paths of FILE.py, or Experiments; solvers names of SOLVERS, paths of
    FILE.py, solvers, or a dict of solvers by names of one's own. With `folder` each finished run is
    stored there, and what is stored already is not run again: an interrupted comparison goes on
    where it stopped. What cannot be stored is told in the log once, and the comparison goes on.
    `workers` runs go side by side; inside of `joblib.parallel_config("dask")` they go to that
    cluster.

    Effort is counted at the prices of `workbench.comparison.targets`, in evaluations of the
    residual: gradient 4, Jacobian n + 1, Hessian 4 (n + 1), constraints 1. Times are stored,
    but no solver is ranked by them.

    Raises UnknownName, BadFile or BadArgument before anything runs; WorkbenchError if no
    experiment can be built, or if no worker process can be started. What a solver does wrong is
    in its records.
    """
    chosen = design(experiments, solvers, seeds, budget or Budget())
    if workers < 1:
        raise BadArgument(f"workers is how many runs go side by side, 1 or more; not {workers}")
    with TemporaryDirectory(prefix="workbench-", ignore_cleanup_errors=True) as temporary:
        dispatcher = _Dispatcher(FolderStore(folder or temporary), workers, progress)
        try:
            return _carried_out(chosen, dispatcher)
        finally:
            pool().close(dispatcher.name)


class _Dispatcher:
    """Sends jobs to workers, and stores the answers as they come."""

    def __init__(self, store: FolderStore, workers: int, progress: Callback) -> None:
        self.name = uuid.uuid4().hex  # by which workers know whose jobs they do
        self._store, self._workers, self._progress = store, workers, progress
        self._keep = Keeping()

    def do(
        self, what: str, jobs: Iterable[SolverJob], of: Callable[[Stored], T]
    ) -> tuple[dict[str, T], dict[str, JobFailed]]:
        """The results by key, and what failed. A job whose result is stored is not sent."""
        from joblib import Parallel, delayed  # which workers, that import this, do not need

        all_jobs = list(jobs)
        results: dict[str, T] = {}
        for job in all_jobs:
            stored = self._store.get(job.key, of)
            if stored is not None:
                results[job.key] = stored
        failed: dict[str, JobFailed] = {}
        missing = [job for job in all_jobs if job.key not in results]
        self._progress(what, len(results), len(all_jobs))
        parallel = Parallel(
            n_jobs=self._workers, prefer="threads", return_as="generator_unordered", batch_size=1
        )
        for key, answer in parallel(delayed(_keyed)(job, self.name) for job in missing):
            if isinstance(answer, JobFailed):
                failed[key] = answer
            else:
                self._keep(partial(self._store.put, key, answer))
                results[key] = of(answer)
            self._progress(what, len(results) + len(failed), len(all_jobs))
        return results, failed


def _keyed(job: SolverJob, comparison: str) -> tuple[str, Stored | JobFailed]:
    return job.key, answered(job, comparison)


def _carried_out(chosen: Design, dispatcher: _Dispatcher) -> Comparison:
    described, unbuilt = _described(chosen, dispatcher)
    instances = tuple(i for i in chosen.instances if i.name in described)
    if not instances:
        name, message = next(iter(unbuilt.items()))
        raise WorkbenchError(f"no experiment can be built; {name}: {message}")
    jobs = {
        (instance.name, named.name): _solve(chosen, instance, named)
        for instance in instances
        for named in chosen.named_solvers
    }
    results, failed = dispatcher.do("solving", jobs.values(), Record.of)
    assert not failed  # what fails is a record as well
    records = {names: results[job.key] for names, job in jobs.items()}
    groups = _groups(instances, described)
    end_analyses = tuple(_analysed(chosen, dispatcher, instances, groups, records))
    return Comparison(chosen, instances, unbuilt, described, records, groups, end_analyses)


def _described(
    chosen: Design, dispatcher: _Dispatcher
) -> tuple[dict[str, Description], dict[str, str]]:
    """What each instance is; where numbers run out (`start=3` of two) there is no instance."""
    jobs = {
        i.name: SolverJob(
            key=chosen.key("problem", i.identity()),
            open_experiment=i.sent(),
            instance=i.name,
            budget=chosen.budget,
        )
        for i in chosen.instances
    }
    results, failed = dispatcher.do("looking at the starts", jobs.values(), Description.of)
    unbuilt = {}
    for instance in chosen.instances:
        wrong = failed.get(jobs[instance.name].key)
        if wrong is not None and not (wrong.argument and instance.repetition):
            unbuilt[instance.name] = wrong.message
    return {name: results[job.key] for name, job in jobs.items() if job.key in results}, unbuilt


def _solve(chosen: Design, instance: Instance, named: NamedSolver) -> Solve:
    return Solve(
        key=chosen.run_key(instance, named),
        open_experiment=instance.sent(),
        instance=instance.name,
        budget=chosen.budget,
        solver=named.name,
        open_solver=named.sent(),
        source=named.source,
        own="" if named.is_own_code else named.name,
        repetition=instance.repetition,
    )


def _groups(
    instances: tuple[Instance, ...], described: dict[str, Description]
) -> tuple[tuple[str, ...], ...]:
    """Instances of one experiment whose problems are the same and only the starts differ.

    That is what the argument `start` says. Numbers called otherwise change the data.
    """
    groups: dict[object, list[str]] = {}
    for instance in instances:
        about = described[instance.name]
        same = instance.problem if instance.argument == "start" else instance.name
        key = same, about.rows, about.unknowns, about.bounded
        groups.setdefault(key, []).append(instance.name)
    return tuple(tuple(names) for names in groups.values())


def _analysed(
    chosen: Design,
    dispatcher: _Dispatcher,
    instances: tuple[Instance, ...],
    groups: tuple[tuple[str, ...], ...],
    records: dict[tuple[str, str], Record],
) -> Iterable[EndAnalysis]:
    """The analysis of the ends of each group."""
    by_name = {instance.name: instance for instance in instances}
    names = tuple(named.name for named in chosen.named_solvers)
    jobs: dict[tuple[str, ...], AnalyseEnds] = {}
    for group in groups:
        ends = [records[key].end for key in ended(group, names, records)]
        runs = [records[name, solver] for name in group for solver in names]
        deepest = min(runs, key=lambda r: r.lowest)
        if deepest.observed.best.size and deepest.lowest < min(
            (r.cost for r in runs if r.at_end), default=np.inf
        ):
            ends.append(deepest.observed.best)  # of a run that did not return it
        if ends:
            instance = by_name[group[0]]
            jobs[group] = AnalyseEnds(
                key=chosen.key("judgement", instance.identity(), ends),
                open_experiment=instance.sent(),
                instance=instance.name,
                budget=chosen.budget,
                ends=tuple(ends),
            )
    results, failed = dispatcher.do("looking at the ends", jobs.values(), EndAnalysis.of)
    for group in groups:
        key = jobs[group].key if group in jobs else ""
        message = failed[key].message if key in failed else ""
        yield results.get(key) or EndAnalysis(message=message)
