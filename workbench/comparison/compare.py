"""Carrying out a comparison: in processes that can be killed, stored as it goes."""

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from joblib import Parallel, delayed

from workbench.comparison.budget import Budget
from workbench.comparison.comparison import Comparison
from workbench.comparison.description import Description
from workbench.comparison.design import Design, Experiments, Instance, design
from workbench.comparison.end_analysis import EndAnalysis
from workbench.comparison.jobs import AnalyseEnds, Answer, Describe, Failed, Job, Solve
from workbench.comparison.named_solvers import Given, NamedSolver, named_solvers
from workbench.comparison.record import Record, Stored, ended
from workbench.comparison.store import Folder, Memory, Store
from workbench.comparison.workers import answered, pool
from workbench.errors import BadArgument, WorkbenchError
from workbench.writing import Keeping

T = TypeVar("T")
Callback = Callable[[str, int, int], object]  # what is going on, how many are done, of how many
SLOW = 3  # Jacobians: the grace of a problem whose evaluations take long


def compare(
    experiments: Experiments,
    solvers: Given,
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

    Effort is counted at the prices of `workbench.comparison.prices`, in evaluations of the
    residual: gradient 4, Jacobian 1 + 1.5 n, Hessian 4 + 6 n, constraints 1. Times are stored,
    but no solver is ranked by them.

    Raises UnknownName, BadFile or BadArgument before anything runs; WorkbenchError if no
    experiment can be built. What a solver does wrong is in its records.
    """
    chosen = design(experiments, named_solvers(solvers), seeds, budget or Budget())
    if workers < 1:
        raise BadArgument(f"workers is how many runs go side by side, 1 or more; not {workers}")
    store: Store = Memory() if folder is None else Folder(folder)
    dispatcher = _Dispatcher(store, workers, progress)
    try:
        return _carried_out(chosen, dispatcher)
    finally:
        pool().close()


class _Dispatcher:
    """Sends jobs to workers, and stores the answers as they come."""

    def __init__(self, store: Store, workers: int, progress: Callback) -> None:
        self.store, self.workers, self.progress = store, workers, progress
        self._keep = Keeping()

    def do(
        self, what: str, jobs: Iterable[Job], of: Callable[[Stored], T]
    ) -> tuple[dict[str, T], dict[str, Failed]]:
        """The results by key, and what failed. A job whose result is stored is not sent."""
        every = list(jobs)
        found = {
            job.key: kept for job in every if (kept := self.store.get(job.key, of)) is not None
        }
        failed: dict[str, Failed] = {}
        missing = [job for job in every if job.key not in found]
        self.progress(what, len(found), len(every))
        parallel = Parallel(
            n_jobs=self.workers, prefer="threads", return_as="generator_unordered", batch_size=1
        )
        for key, answer in parallel(delayed(_keyed)(job) for job in missing):
            if isinstance(answer, Failed):
                failed[key] = answer
            else:
                self._keep(partial(self.store.put, key, answer))
                found[key] = of(answer)
            self.progress(what, len(found) + len(failed), len(every))
        return found, failed


def _keyed(job: Job) -> tuple[str, Answer | Failed]:
    return job.key, answered(job)


def _carried_out(chosen: Design, dispatcher: _Dispatcher) -> Comparison:
    described, unbuilt = _described(chosen, dispatcher)
    instances = tuple(i for i in chosen.instances if i.name in described)
    if not instances:
        first = next(iter(unbuilt.items()))
        raise WorkbenchError(f"no experiment can be built; {first[0]}: {first[1]}")
    jobs = {
        (instance.name, named.name): _solve(chosen, instance, named, described[instance.name])
        for instance in instances
        for named in chosen.named_solvers
    }
    found, _ = dispatcher.do("solving", jobs.values(), Record.of)
    records = {names: found[job.key] for names, job in jobs.items()}
    groups = _groups(instances, described)
    end_analyses = _judged(chosen, dispatcher, instances, groups, records)
    return Comparison(chosen, instances, unbuilt, described, records, groups, end_analyses)


def _described(
    chosen: Design, dispatcher: _Dispatcher
) -> tuple[dict[str, Description], dict[str, str]]:
    """What each instance is; where numbers run out (`start=3` of two) there is no instance."""
    jobs = {
        i.name: Describe(chosen.key("problem", i.identity()), i.sent(), i.name, chosen.budget)
        for i in chosen.instances
    }
    found, failed = dispatcher.do("looking at the starts", jobs.values(), Description.of)
    unbuilt = {}
    for instance in chosen.instances:
        wrong = failed.get(jobs[instance.name].key)
        if wrong is not None and not (wrong.argument and instance.repetition):
            unbuilt[instance.name] = wrong.message
    return {name: found[job.key] for name, job in jobs.items() if job.key in found}, unbuilt


def _solve(chosen: Design, instance: Instance, named: NamedSolver, about: Description) -> Solve:
    return Solve(
        key=chosen.run_key(instance, named),
        experiment=instance.sent(),
        solver=named.sent(),
        instance=instance.name,
        repetition=instance.repetition,
        budget=chosen.budget,
        grace=max(chosen.budget.grace, SLOW * about.seconds["jacobian"]),
        own="" if named.of_the_house else named.name,
    )


def _groups(
    instances: tuple[Instance, ...], described: dict[str, Description]
) -> tuple[tuple[str, ...], ...]:
    """Instances of one experiment whose problems are the same and only the starts differ."""
    groups: list[tuple[str, list[str]]] = []
    for instance in instances:
        about = described[instance.name]
        for problem, names in groups:
            if problem == instance.problem and described[names[0]].same_problem(about):
                names.append(instance.name)
                break
        else:
            groups.append((instance.problem, [instance.name]))
    return tuple(tuple(names) for _, names in groups)


def _judged(
    chosen: Design,
    dispatcher: _Dispatcher,
    instances: tuple[Instance, ...],
    groups: tuple[tuple[str, ...], ...],
    records: dict[tuple[str, str], Record],
) -> tuple[EndAnalysis, ...]:
    by_name = {instance.name: instance for instance in instances}
    names = tuple(named.name for named in chosen.named_solvers)
    jobs: dict[int, AnalyseEnds] = {}
    for k, group in enumerate(groups):
        ends = [records[key].end for key in ended(group, names, records)]
        runs = [records[name, solver] for name in group for solver in names]
        deepest = min(runs, key=lambda r: r.lowest)
        if deepest.observed.best.size and deepest.lowest < min(
            (r.cost for r in runs if r.finite and r.inside), default=np.inf
        ):
            ends.append(deepest.observed.best)  # of a run that did not return it
        if ends:
            instance = by_name[group[0]]
            key = chosen.key("judgement", instance.identity(), ends)
            jobs[k] = AnalyseEnds(key, instance.sent(), tuple(ends), chosen.budget)
    found, failed = dispatcher.do("looking at the ends", jobs.values(), EndAnalysis.of)
    return tuple(
        found[jobs[k].key]
        if k in jobs and jobs[k].key in found
        else EndAnalysis(message=failed[jobs[k].key].message if k in jobs else "")
        for k in range(len(groups))
    )
