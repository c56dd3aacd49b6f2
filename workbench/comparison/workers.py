"""Worker processes that can be killed, and the pool that lends them out."""

import atexit
import os
import pickle
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

from workbench.comparison.jobs import Answer, Failed, Job, Lost, Solve
from workbench.comparison.log import Log
from workbench.comparison.machine import machine
from workbench.comparison.record import Ending, Record
from workbench.processes import Channel, Started, absolute_paths, signal_name
from workbench.threads import thread_count

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
MAIN = "from workbench.comparison.worker import main; main()"
STARTING = 120.0  # s, for Python to start and import the workbench


class Worker:
    """One process that answers jobs; it lives until it is killed or its channel is closed."""

    def __init__(self, process: Started) -> None:
        self._process, self._channel = process, Channel(process.connection)

    def ask(self, job: Job) -> Answer | Failed | Lost:
        """Ask for an answer; a worker that was lost cannot be asked again."""
        phase, limit = "starting", STARTING
        try:
            self._channel.send(pickle.dumps(job), limit)
            while (message := self._channel.receive(limit)) is not None:
                said = pickle.loads(message)
                if isinstance(said, Failed) or isinstance(said[0], dict):
                    return said  # type: ignore[no-any-return]  # what the worker sends
                phase, limit = said
        except TimeoutError:
            self.kill()
            return Lost(phase, True, f"in the phase of {phase}, it took too long")
        except Exception:  # whatever happens to the channel is the end of it
            pass
        code = self.kill()
        by = signal_name(code) if code < 0 else f"exit code {code}"
        return Lost(phase, False, f"in the phase of {phase}, its process died ({by})")

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
        self.unrehearsed: set[str] = set()  # solvers that do not survive a rehearsal
        self._busy: set[Worker] = set()
        self._starting = ThreadPoolExecutor(1)  # a process ends with the thread that started it

    def ask(self, job: Job) -> Answer | Failed | Lost:
        """Ask an idle worker, or a new one."""
        with self._lock:
            idle = self._idle.setdefault(job.own, [])
            worker = idle.pop() if idle else self._started()
            self._busy.add(worker)
        answer: Answer | Failed | Lost | None = None
        try:
            answer = worker.ask(job)
            return answer
        finally:
            well = answer is not None and not isinstance(answer, Lost)
            if not well:
                worker.kill()
            with self._lock:
                self._busy.discard(worker)
                if well:
                    self._idle.setdefault(job.own, []).append(worker)

    def _started(self) -> Worker:
        return Worker(self._starting.submit(Started, ["-c", MAIN], _environment()).result())

    def close(self) -> None:
        """End every worker, busy or not."""
        with self._lock:
            every = [*self._busy, *(w for idle in self._idle.values() for w in idle)]
            self._idle.clear()
        for worker in every:
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


def answered(job: Job) -> Answer | Failed:
    """The answer to a job; it is Failed if the worker was lost or could not do it."""
    if isinstance(job, Solve):
        return _run(job)
    answer = pool().ask(job)
    return Failed(answer.message) if isinstance(answer, Lost) else answer


def _run(job: Solve) -> Answer:
    """Run a solver. A run that gives no answer is recorded by what its log holds at that time."""
    with tempfile.TemporaryDirectory(prefix="workbench-", ignore_cleanup_errors=True) as folder:
        unrehearsed = pool().unrehearsed
        rehearse = job.solver.name not in unrehearsed
        job = replace(job, log=str(Path(folder) / "log"), rehearse=rehearse)
        answer = pool().ask(job)
        if isinstance(answer, Lost) and answer.phase == "rehearsing":
            unrehearsed.add(job.solver.name)
            answer = pool().ask(replace(job, rehearse=False))
        if isinstance(answer, Lost):
            ending = Ending.KILLED if answer.killed else Ending.CRASHED
        elif isinstance(answer, Failed):
            ending = Ending.RAISED
        else:
            return answer
        Path(job.log).touch()
        observed = Log.read(job.log)
    record = Record(job.solver.name, job.instance, ending, answer.message, observed, machine())
    return record.stored()
