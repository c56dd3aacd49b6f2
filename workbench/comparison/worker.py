"""A worker process: it receives jobs by a channel and answers them.

What a solver or a problem prints is discarded.
"""

import pickle
import random
import sys
import time
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from workbench.blocks import Values
from workbench.comparison.ends import analyse_ends
from workbench.comparison.metered import MeteredProblem, RunMeter, feasible, look
from workbench.comparison.record import Description, Record, RunEnding, RunLog, Stored, machine
from workbench.comparison.workers import AnalyseEnds, Announce, JobFailed, Solve, SolverJob
from workbench.errors import NotSupported, UnknownName, WorkbenchError
from workbench.experiments.experiment import user_errors
from workbench.experiments.running import warm
from workbench.fitting.setup import Setup, digits
from workbench.processes import Channel, end_with_parent
from workbench.solvers import Solution
from workbench.solvers.limits import Stop
from workbench.threads import limited_threads

GRACE_JACOBIANS = 3  # the grace of a problem whose evaluations take long


def main() -> None:
    """Answer jobs as a process of its own."""
    end_with_parent()
    serve(Channel.inherited(int(sys.argv[-1])))


def serve(channel: Channel) -> None:
    """Answer jobs until the connection is closed."""
    built: dict[bytes, Setup] = {}  # the last one

    def announce(phase: str, seconds: float) -> None:
        channel.send(pickle.dumps((phase, seconds)))

    while message := channel.receive():
        job: SolverJob = pickle.loads(message)
        announce("building", job.budget.build_seconds)
        answer: Stored | JobFailed
        try:
            key = pickle.dumps(job.open_experiment)
            if key not in built:
                built = {key: job.open_experiment().setup()}
            with limited_threads():
                answer = _answered(job, built[key], announce)
        except BaseException as error:  # also a user's SystemExit
            answer = JobFailed(_message_of(error), isinstance(error, UnknownName))
        channel.send(pickle.dumps(answer))


def _answered(job: SolverJob, setup: Setup, announce: Announce) -> Stored:
    if isinstance(job, Solve):
        return run_solver(job, setup, announce).stored()
    if isinstance(job, AnalyseEnds):
        announce("judging", job.budget.judge_seconds)
        return analyse_ends(setup, job.ends).stored()
    return describe(job.instance, setup).stored()


def describe(instance: str, setup: Setup) -> Description:
    """What an instance is: its sizes, its cost at the start, and what is known of the answer."""
    problem, known = setup.problem, setup.known
    problem.prepare()
    return Description(
        instance=instance,
        rows=problem.size,
        unknowns=problem.free.size,
        bounded=problem.bounded,
        start_cost=look(problem, *problem.split(setup.start))[0],
        known_cost=np.nan if known is None or known.cost is None else float(known.cost),
        known_source="" if known is None else str(known.source),
        question=setup.question,
    )


def run_solver(job: Solve, setup: Setup, announce: Announce) -> Record:
    """Run a solver on a problem that has been evaluated once, so that no clock counts its building.

    The problem judges the returned point; what the solver reports about itself is stored as well.
    """
    problem, budget = setup.problem, job.budget
    x, fixed = problem.split(setup.start)
    with user_errors(job.source):
        solver = budget.applied_to(job.open_solver(), job.repetition)
    warm(problem, setup.start)
    began = time.perf_counter()
    problem.linearize_at(x + 1e-7, fixed)  # a problem may keep its last point
    grace = max(budget.grace, GRACE_JACOBIANS * (time.perf_counter() - began))
    log = RunLog(job.log, problem.free.size)
    random.seed(job.repetition)
    np.random.seed(job.repetition)  # for solvers that draw from the common generator
    announce("solving", budget.max_seconds + grace)
    meter = RunMeter(
        problem, fixed, budget.max_evaluations, budget.max_seconds, log, closing=grace / 2
    )
    ending, message, answer = _ending_of(solver, meter.metered(), setup.start, job.source)
    seconds = meter.seconds
    announce("looking at its end", budget.build_seconds)
    log.ended(seconds)
    observed = RunLog.read(job.log)
    early = partial(Record, job.solver, job.instance, observed=observed, machine=machine())
    if ending is RunEnding.CUT:
        return _judged(early(ending, message, end=observed.best), setup)
    if ending is not RunEnding.RETURNED:
        return early(ending, message)
    try:  # NaN is an answer, if no good one
        values = {name: np.asarray(v, dtype=float) for name, v in answer.values.items()}
        end = problem.free.pack(values)
        claim, cost = str(answer.status.name), float(answer.cost)
        message = str(answer.message)
    except (AttributeError, TypeError, ValueError, WorkbenchError) as error:
        prefix = "" if isinstance(answer, Solution) else f"it returned {answer!r:.60}: "
        return early(RunEnding.BROKEN, f"{prefix}{error}")
    return _judged(early(ending, message, claim=claim, claimed_cost=cost, end=end), setup)


def _ending_of(
    solver: Any, problem: MeteredProblem, start: Values, source: str
) -> tuple[RunEnding, str, Any]:
    """How it ended, why, and what was returned; whatever a solver raises ends here."""
    try:
        with limited_threads(), user_errors(source):
            return RunEnding.RETURNED, "", solver.solve(problem, deepcopy(dict(start)))
    except BaseException as error:  # also SystemExit and KeyboardInterrupt: they are its own
        for cause in (error, error.__cause__ if isinstance(error, WorkbenchError) else None):
            if isinstance(cause, Stop):
                return RunEnding.CUT, cause.message, None
            if isinstance(cause, NotSupported):
                return RunEnding.REFUSED, str(cause), None
        return RunEnding.RAISED, _message_of(error), None


def _message_of(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _judged(record: Record, setup: Setup) -> Record:
    """The record with what the problem itself says of its end."""
    problem, end = setup.problem, record.end
    if not end.size or not np.isfinite(end).all():
        return record
    fixed = problem.split(setup.start)[1]
    cost, optimality = look(problem, end, fixed)
    digits_agreed = np.nan
    if setup.known is not None and setup.known.values is not None:
        digits_agreed = digits(problem.free.unpack(end, setup.start), setup.known.values)
    inside = feasible(problem, end, fixed)
    return replace(record, cost=cost, optimality=optimality, digits=digits_agreed, inside=inside)
