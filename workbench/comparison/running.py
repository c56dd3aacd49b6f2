"""One solver at work, inside a worker process."""

import random
from copy import deepcopy
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.blocks import Values
from workbench.comparison.feasible import feasible
from workbench.comparison.jobs import Announce, Solve
from workbench.comparison.log import Log
from workbench.comparison.machine import machine
from workbench.comparison.metered import Metered
from workbench.comparison.record import Ending, Record
from workbench.errors import NotSupported, WorkbenchError
from workbench.experiments.running import warm
from workbench.experiments.user_errors import user_errors
from workbench.fitting.setup import Setup, digits
from workbench.problem import Problem
from workbench.solvers import Solution, Solver
from workbench.solvers.limits import Stop
from workbench.threads import limited_threads

REHEARSED = 10  # evaluations: enough to load what a solver loads, and to build what it builds


def run_solver(job: Solve, setup: Setup, announce: Announce) -> Record:
    """Run a solver, after a few trial evaluations that no clock counts.

    The problem judges the returned point; what the solver reports about itself is stored as well.
    """
    problem, budget = setup.problem, job.budget
    longest = budget.max_seconds + job.grace
    fixed = problem.split(setup.start)[1]
    solver = budget.given(_opened(job), job.repetition)
    warm(problem, setup.start)
    if job.rehearse:
        announce("rehearsing", longest)
        log = Log(job.log + ".rehearsal", problem.free.size)
        metered = Metered(problem, fixed, REHEARSED, budget.max_seconds, log)
        _ask(solver, metered.metered(), setup.start, job)
        Path(job.log + ".rehearsal").unlink(missing_ok=True)
    log = Log(job.log, problem.free.size)
    random.seed(job.repetition)
    np.random.seed(job.repetition)  # for solvers that draw from the common generator
    announce("solving", longest)
    metered = Metered(
        problem, fixed, budget.max_evaluations, budget.max_seconds, log, closing=job.grace / 2
    )
    ending, message, found = _ask(solver, metered.metered(), setup.start, job)
    seconds = metered.seconds
    announce("looking at its end", budget.build_seconds)
    log.ended(seconds)
    observed = Log.read(job.log)
    early = partial(Record, job.solver.name, job.instance, observed=observed, machine=machine())
    if ending is Ending.CUT:
        return _judged(early(ending, message, end=observed.best), setup)
    if ending is not Ending.RETURNED:
        return early(ending, message)
    try:
        end = problem.free.pack(_numbers(found))
        claim, cost, said = str(found.status.name), float(found.cost), str(found.message)
    except (AttributeError, TypeError, ValueError, WorkbenchError) as error:
        told = "" if isinstance(found, Solution) else f"it returned {found!r:.60}: "
        return early(Ending.BROKEN, f"{told}{error}")
    return _judged(early(ending, said, claim=claim, claimed_cost=cost, end=end), setup)


def _opened(job: Solve) -> Solver:
    with user_errors(job.solver.source):
        return job.solver.opened()


def _ask(solver: Solver, problem: Problem, start: Values, job: Solve) -> tuple[Ending, str, Any]:
    """How it ended, why, and what was returned; whatever a solver raises ends here."""
    try:
        with limited_threads(), user_errors(job.solver.source):
            return Ending.RETURNED, "", solver.solve(problem, deepcopy(dict(start)))
    except Stop as stop:
        return Ending.CUT, stop.message, None
    except NotSupported as error:
        return Ending.REFUSED, str(error), None
    except BaseException as error:  # also SystemExit and KeyboardInterrupt: they are its own
        cause = error.__cause__ if isinstance(error, WorkbenchError) else error
        if isinstance(cause, Stop):
            return Ending.CUT, cause.message, None
        if isinstance(cause, NotSupported):
            return Ending.REFUSED, str(cause), None
        said = str(error) if isinstance(error, WorkbenchError) else _told(error)
        return Ending.RAISED, said, None


def _told(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _numbers(found: Solution) -> Values:
    """Its values as arrays, NaN being allowed: it is an answer, if no good one."""
    return {name: np.asarray(value, dtype=float) for name, value in found.values.items()}


def _judged(record: Record, setup: Setup) -> Record:
    """The record with what the problem itself says of its end."""
    problem, end = setup.problem, record.end
    if not end.size or not np.isfinite(end).all():
        return record
    fixed = problem.split(setup.start)[1]
    cost, optimality = look(problem, end, fixed)
    agree = np.nan
    if setup.known is not None and setup.known.values is not None:
        agree = digits(problem.free.unpack(end, setup.start), setup.known.values)
    inside = feasible(problem, end, fixed)
    return replace(record, cost=cost, optimality=optimality, digits=agree, inside=inside)


def look(problem: Problem, x: np.ndarray, fixed: np.ndarray) -> tuple[float, float]:
    """Cost and optimality of a point by the problem itself; NaN where it cannot be evaluated."""
    try:
        with limited_threads():
            here = problem.linearize_at(x, fixed)
            if not here.finite:
                return (here.cost if np.isfinite(here.cost) else np.nan), np.nan
            return here.cost, problem.optimality(x, here, problem.rounding(x, fixed, here.residual))
    except Exception:
        return np.nan, np.nan
