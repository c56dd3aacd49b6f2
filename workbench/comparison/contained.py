"""Worker processes that can be killed, and the pool that lends them out."""

import atexit
import pickle
import queue
import signal
import tempfile
import threading
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from workbench.comparison.jobs import Answer, Failed, Job, Lost, Solve
from workbench.comparison.log import Log
from workbench.comparison.machine import machine
from workbench.comparison.processes import FORKING, Nursery, Plain, Process
from workbench.comparison.record import Ending, ended_early

STARTING = 120.0  # s, for Python to start and import the workbench


class Worker:
    """One process; it lives until it is killed, or its input is closed."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._said: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def ask(self, job: Job) -> Answer | Failed | Lost:
        """The answer, or why there is none; a worker that was lost cannot be asked again."""
        phase, limit = "starting", STARTING
        try:
            pickle.dump(job, self._process.writing)
            self._process.writing.flush()
        except OSError:
            return self._lost(phase, killed=False)
        while True:
            try:
                said = self._said.get(timeout=limit)
            except queue.Empty:
                return self._lost(phase, killed=True)
            if said is None:
                return self._lost(phase, killed=False)
            if isinstance(said, Failed) or isinstance(said[0], dict):
                return said  # type: ignore[no-any-return]  # what the worker sends
            phase, limit = said

    def kill(self) -> int:
        """At once, with whatever it has started itself; the code that it ended with."""
        code = self._process.end()
        self._listener.join(timeout=10)
        for end in (self._process.reading, self._process.writing):
            with suppress(OSError):
                end.close()
        return code

    def _lost(self, phase: str, killed: bool) -> Lost:
        code = self.kill()
        said = f"in the phase of {phase}, "
        if killed:
            return Lost(phase, True, said + "it took too long")
        by = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return Lost(phase, False, said + f"its process died ({by})")

    def _listen(self) -> None:
        with suppress(Exception):  # whatever happens to the channel is its end
            while True:
                self._said.put(pickle.load(self._process.reading))
        self._said.put(None)


class Pool:
    """Idle workers by whose they are: a solver from outside shares no process with others."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: dict[str, list[Worker]] = {}
        self.unrehearsed: set[str] = set()  # solvers that do not survive a rehearsal
        self._busy: set[Worker] = set()
        self._nursery: Nursery | None = None

    def ask(self, job: Job) -> Answer | Failed | Lost:
        """Ask an idle worker, or a new one."""
        with self._lock:
            idle = self._idle.setdefault(job.own, [])
            worker = idle.pop() if idle else Worker(self._process())
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

    def _process(self) -> Process:
        if not FORKING:
            return Plain()
        try:
            if self._nursery is not None:
                return self._nursery.new()
        except OSError:  # it is gone: another one
            pass
        self._nursery = Nursery()
        return self._nursery.new()

    def close(self) -> None:
        """End every worker, busy or not; what they are forked from stays for the next ones."""
        with self._lock:
            every = [*self._busy, *(w for idle in self._idle.values() for w in idle)]
            self._idle.clear()
        for worker in every:
            worker.kill()

    def end(self) -> None:
        """End everything."""
        self.close()
        if self._nursery is not None:
            self._nursery.close()


@cache
def pool() -> Pool:
    """The one of this process: threads share it, and a Dask worker keeps it between tasks."""
    made = Pool()
    atexit.register(made.end)
    return made


def answered(job: Job) -> Answer | Failed:
    """What a job comes to, whatever happens in it."""
    if isinstance(job, Solve):
        return _run(job)
    answer = pool().ask(job)
    return Failed(answer.message) if isinstance(answer, Lost) else answer


def _run(job: Solve) -> Answer:
    """A run that gives no answer is told by what its watch wrote before it was lost."""
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
        seen = Log.read(job.log)
    return ended_early(
        job.solver.name, job.instance, ending, answer.message, seen, machine()
    ).stored()
