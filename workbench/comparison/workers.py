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
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
MAIN = "from workbench.comparison.worker import main; main()"
STARTING = 120.0  # s, for Python to start and import the workbench
ATTEMPTS = 3  # at starting a worker


@dataclass(frozen=True, eq=False, kw_only=True)
class SolverJob:
    """What is asked of a worker process: to build an instance, and to describe it.

    Attributes:
        key: the key under which the answer is stored.
        open_experiment: gives the experiment with its arguments.
        instance: the name of the instance.
        budget: the limits.
    """

    key: str
    open_experiment: Callable[[], Experiment]
    instance: str
    budget: Budget


@dataclass(frozen=True, eq=False, kw_only=True)
class Solve(SolverJob):
    """Run a solver once on an instance.

    Attributes:
        solver: the name of the solver.
        open_solver: gives the solver.
        source: the file that defines it; empty if none does.
        own: the solver whose process it needs; empty if the process is shared.
        repetition: the number of the repetition, which seeds random numbers.
        log: the path of the file in which the metered problem records the run.
    """

    solver: str
    open_solver: Callable[[], Solver]
    source: str = ""
    own: str = ""
    repetition: int = 0
    log: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class AnalyseEnds(SolverJob):
    """Analyse all ends of one problem, (n,) each: where each leads to, and what keeps it there."""

    ends: tuple[Array, ...]


@dataclass(frozen=True)
class JobFailed:
    """The answer of a worker process that could not do its job.

    Attributes:
        message: why it could not.
        argument: whether the experiment has no such start or seed.
    """

    message: str
    argument: bool = False


@dataclass(frozen=True)
class WorkerLost:
    """What is known of a worker process that gave no answer.

    Attributes:
        phase: what it was doing; empty if it had not begun.
        killed: whether it was killed for taking too long; otherwise it died by itself.
        message: the reason, as a sentence.
    """

    phase: str
    killed: bool
    message: str


class Worker:
    """One process that answers jobs; it lives until it is killed or its channel is closed."""

    def __init__(self, process: Started) -> None:
        self._process, self._channel = process, Channel(process.connection)

    def ask(self, job: SolverJob) -> Stored | JobFailed | WorkerLost:
        """Ask for an answer; a worker that was lost is killed, and cannot be asked again."""
        phase, limit = "", STARTING
        try:
            self._channel.send(pickle.dumps(job), limit)
            while (message := self._channel.receive(limit)) is not None:
                answer = pickle.loads(message)
                if isinstance(answer, JobFailed) or isinstance(answer[0], dict):
                    return answer  # type: ignore[no-any-return]  # what the worker sends
                phase, limit = answer
        except TimeoutError:
            self.kill()
            return WorkerLost(
                phase, True, f"in the phase of {phase or 'starting'}, it took too long"
            )
        except Exception:  # whatever happens to the channel is the end of it
            pass
        code = self.kill()
        by = signal_name(code) if code < 0 else f"exit code {code}"
        return WorkerLost(
            phase, False, f"in the phase of {phase or 'starting'}, its process died ({by})"
        )

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
        self._closed: set[str] = set()  # comparisons that have ended
        self._starting = ThreadPoolExecutor(1)  # a process ends with the thread that started it

    def ask(self, job: SolverJob, comparison: str) -> Stored | JobFailed | WorkerLost:
        """Ask an idle worker, or a new one, for a comparison with this name.

        A worker that dies before it begins says nothing of the job, and another one is asked.
        Raises WorkbenchError if several do.
        """
        own = job.own if isinstance(job, Solve) else ""
        answer: Stored | JobFailed | WorkerLost
        for _ in range(ATTEMPTS):
            answer = self._asked_once(job, own, comparison)
            if comparison in self._closed or not isinstance(answer, WorkerLost) or answer.phase:
                return answer
        assert isinstance(answer, WorkerLost)
        raise WorkbenchError(
            f"{ATTEMPTS} worker processes ended before they had begun ({answer.message}); is there "
            "enough memory, and does `python -c 'import workbench.comparison.worker'` work?"
        )

    def _asked_once(
        self, job: SolverJob, own: str, comparison: str
    ) -> Stored | JobFailed | WorkerLost:
        try:
            with self._lock:
                idle = self._idle.setdefault(own, [])
                worker = idle.pop() if idle else self._started()
                self._busy[worker] = comparison
        except OSError as error:
            return WorkerLost("", False, f"it could not be started: {error}")
        answer: Stored | JobFailed | WorkerLost | None = None
        try:
            answer = worker.ask(job)
            return answer
        finally:
            with self._lock:
                del self._busy[worker]
                if answer is None:
                    worker.kill()
                elif not isinstance(answer, WorkerLost):
                    self._idle.setdefault(own, []).append(worker)

    def _started(self) -> Worker:
        return Worker(self._starting.submit(Started, ["-c", MAIN], _environment()).result())

    def close(self, comparison: str = "") -> None:
        """End all idle workers, and those that are busy for this comparison; for any if empty."""
        with self._lock:
            self._closed.add(comparison)
            idle = [worker for each in self._idle.values() for worker in each]
            busy = [worker for worker, whose in self._busy.items() if comparison in ("", whose)]
            self._idle.clear()
        for worker in (*idle, *busy):
            worker.kill()


def _environment() -> dict[str, str]:
    threads = dict.fromkeys(THREADS, str(thread_count()))
    return {**threads, "PYTHONPATH": os.pathsep.join(absolute_paths())}


@cache
def pool() -> Pool:
    """The pool of this process. Threads share it, and a Dask worker keeps it between tasks."""
    made = Pool()
    atexit.register(made.close)
    return made


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
