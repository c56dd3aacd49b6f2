"""Jobs, the worker processes that do them and can be killed, and the pool that lends them out."""

import atexit
import os
import pickle
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from workbench.arrays import Array
from workbench.comparison.design import Budget
from workbench.comparison.record import Record, RunEnding, RunLog, Stored, machine
from workbench.errors import WorkbenchError
from workbench.experiments import Experiment
from workbench.processes import Channel, Started, absolute_paths, signal_name
from workbench.solvers import Solver
from workbench.threads import thread_count

Announce = Callable[[str, float], None]  # what begins, and how many seconds it may take
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
WORKER_COMMAND = "from workbench.comparison.worker import main; main()"
START_SECONDS = 120.0  # s, for Python to start and import the workbench


@dataclass(frozen=True, eq=False, kw_only=True)
class SolverJob:
    """What is asked of a worker process: to build an instance, and to describe it."""

    key: str  # the key under which the answer is stored
    open_experiment: Callable[[], Experiment]  # gives the experiment with its arguments
    instance: str  # the name of the instance
    budget: Budget  # the limits


@dataclass(frozen=True, eq=False, kw_only=True)
class Solve(SolverJob):
    """Run a solver once on an instance."""

    solver: str  # the name of the solver
    open_solver: Callable[[], Solver]  # gives the solver
    source: str = ""  # the file that defines it; empty if none does
    own: str = ""  # the solver whose process it needs; empty if the process is shared
    repetition: int = 0  # the number of the repetition, which seeds random numbers
    log: str = ""  # the path of the file in which the metered problem records the run


@dataclass(frozen=True, eq=False, kw_only=True)
class AnalyseEnds(SolverJob):
    """Analyse all ends of one problem, (n,) each: where each leads to."""

    ends: tuple[Array, ...]


@dataclass(frozen=True)
class JobFailed:
    """The answer of a worker process that could not do its job."""

    message: str  # why it could not
    argument: bool = False  # whether the experiment has no such start or seed


@dataclass(frozen=True)
class WorkerLost:
    """What is known of a worker process that gave no answer."""

    killed: bool  # whether it was killed for taking too long; otherwise it died by itself
    message: str  # the reason, as a sentence


class NotBegun(WorkbenchError):
    """A worker process that ended before it began its job, which says nothing of the job."""


Answer = Stored | JobFailed | WorkerLost


class Worker:
    """One process that answers jobs; it lives until it is killed or its channel is closed."""

    def __init__(self, process: Started) -> None:
        self._process, self._channel = process, Channel(process.connection)

    def ask(self, job: SolverJob) -> Answer:
        """Ask for an answer; a worker that was lost is killed, and cannot be asked again.

        Raises NotBegun.
        """
        phase, limit, killed = "", START_SECONDS, False
        try:
            self._channel.send(pickle.dumps(job), limit)
            while (message := self._channel.receive(limit)) is not None:
                answer = pickle.loads(message)
                if isinstance(answer, JobFailed) or isinstance(answer[0], dict):
                    return answer  # type: ignore[no-any-return]  # what the worker sends
                phase, limit = answer
        except TimeoutError:
            killed = True
        except Exception:  # whatever happens to the channel is the end of it
            pass
        code = self.kill()
        by = signal_name(code) if code < 0 else f"exit code {code}"
        if not phase:
            raise NotBegun(
                f"a worker process ended before it had begun ({by}); is there enough memory, and "
                "does `python -c 'import workbench.comparison.worker'` work?"
            )
        why = "it took too long" if killed else f"its process died ({by})"
        return WorkerLost(killed, f"in the phase of {phase}, {why}")

    def kill(self) -> int:
        """Kill the process, and all that it has started; return its exit code."""
        code = self._process.end()
        self._channel.close()
        return code


class Pool:
    """Worker processes; a solver that is not in the catalogue shares no process with others."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: dict[str, list[Worker]] = {}
        self._busy: dict[Worker, str] = {}  # and for which comparison
        self._starting = ThreadPoolExecutor(1)  # a process ends with the thread that started it

    def ask(self, job: SolverJob, comparison: str) -> Answer:
        """Ask an idle worker, or a new one, for a comparison with this name.

        Raises NotBegun, or OSError if no process can be started.
        """
        with self._lock:
            idle = self._idle.setdefault(job.own if isinstance(job, Solve) else "", [])
            known = bool(idle)
            worker = idle.pop() if known else self._started()
            self._busy[worker] = comparison
        answer: Answer | None = None
        try:
            answer = worker.ask(job)
        except NotBegun:
            if not known:  # one that died while it was idle is replaced
                raise
        finally:
            with self._lock:
                del self._busy[worker]
                if answer is None:
                    worker.kill()
                elif not isinstance(answer, WorkerLost):
                    idle.append(worker)
        return self.ask(job, comparison) if answer is None else answer

    def _started(self) -> Worker:
        threads = dict.fromkeys(THREAD_VARIABLES, str(thread_count()))
        environment = {**threads, "PYTHONPATH": os.pathsep.join(absolute_paths())}
        return Worker(self._starting.submit(Started, ["-c", WORKER_COMMAND], environment).result())

    def close(self, comparison: str = "") -> None:
        """End all idle workers, and those that are busy for this comparison; for any if empty."""
        with self._lock:
            ended = [worker for worker, whose in self._busy.items() if comparison in ("", whose)]
            for idle in self._idle.values():
                ended += idle
                idle.clear()
        for worker in ended:
            worker.kill()


@cache
def pool() -> Pool:
    """The pool of this process. Threads share it, and a Dask worker keeps it between tasks."""
    workers = Pool()
    atexit.register(workers.close)
    return workers


def answered(job: SolverJob, comparison: str) -> Stored | JobFailed:
    """The answer to a job of a comparison with this name; JobFailed if it could not be done.

    A run that gives no answer is recorded by what its log holds when its process has ended.
    """
    if not isinstance(job, Solve):
        answer = pool().ask(job, comparison)
        return JobFailed(answer.message) if isinstance(answer, WorkerLost) else answer
    with tempfile.TemporaryDirectory(prefix="workbench-", ignore_cleanup_errors=True) as folder:
        log = Path(folder) / "log"
        answer = pool().ask(replace(job, log=str(log)), comparison)
        if isinstance(answer, WorkerLost):
            ending = RunEnding.KILLED if answer.killed else RunEnding.CRASHED
        elif isinstance(answer, JobFailed):
            ending = RunEnding.RAISED
        else:
            return answer
        log.touch()
        observed = RunLog.read(log)
    return Record(job.solver, job.instance, ending, answer.message, observed, machine()).stored()
