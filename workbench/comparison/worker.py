"""A worker process: it reads jobs from a channel and answers there.

Whatever a solver or a problem prints goes nowhere, so that it cannot mix with the answers. An
alarm of the system ends the process should it hang after whoever started it has gone.
"""

import os
import pickle
import signal
import socket
import sys
from collections import OrderedDict
from typing import Any, BinaryIO, NoReturn

from workbench.comparison.description import describe
from workbench.comparison.identity import identity
from workbench.comparison.jobs import Answer, Describe, Failed, Job, Judge, Solve
from workbench.comparison.judgement import judge
from workbench.comparison.plan import SentExperiment
from workbench.comparison.processes import FORK, NUMBER, WAIT, kill
from workbench.comparison.running import carry_out
from workbench.errors import UnknownName, WorkbenchError
from workbench.experiments.experiment import Setup
from workbench.orphans import end_with_parent
from workbench.threads import limited_threads

KEPT = 4  # problems that stay built
ORPHAN = 5.0  # s after a limit, at which the system ends a process that nobody ended


class Builder:
    """Builds setups, and keeps the last few."""

    def __init__(self) -> None:
        self._built: OrderedDict[str, Setup] = OrderedDict()

    def setup(self, sent: SentExperiment) -> Setup:
        """Raises whatever building it raises."""
        key = str(identity(sent)) if sent.source else str(hash(sent.blob))
        if key not in self._built:
            self._built[key] = sent.opened().setup()
            while len(self._built) > KEPT:
                self._built.popitem(last=False)
        self._built.move_to_end(key)
        return self._built[key]


def plain() -> None:
    """In a process of its own: jobs come on the standard input."""
    end_with_parent()
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    _silence()
    serve(incoming, outgoing)


def nursery(control: int) -> None:
    """In a process that forks whenever it is asked to on a socket, until that is closed.

    It is closed when whoever asks has died, too: then every child that is left is killed, busy
    or not, for nobody waits for its answer.
    """
    children: set[int] = set()
    with socket.socket(fileno=control) as asked:
        try:
            while True:
                what, handles, _, _ = socket.recv_fds(asked, 1, 1)
                if what == FORK:
                    pid = os.fork()
                    if pid == 0:
                        asked.close()
                        _child(handles[0])
                    children.add(pid)
                    os.close(handles[0])
                    asked.sendall(NUMBER.pack(pid))
                elif what == WAIT:
                    pid, status = os.waitpid(NUMBER.unpack(asked.recv(NUMBER.size))[0], 0)
                    children.discard(pid)
                    asked.sendall(NUMBER.pack(os.waitstatus_to_exitcode(status)))
                else:
                    return
        finally:
            for pid in children:
                kill(pid)


def _child(handle: int) -> NoReturn:
    """What was forked; it leaves without the clean-up that is its parent's."""
    try:
        os.setsid()
        _silence()
        with socket.socket(fileno=handle) as channel:
            incoming, outgoing = channel.makefile("rb"), channel.makefile("wb")
            sys.path[:], folder = pickle.load(incoming)
            os.chdir(folder)
            serve(incoming, outgoing)
    finally:
        os._exit(0)


def serve(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Answer until the input ends."""
    builder = Builder()

    def send(message: Any) -> None:
        pickle.dump(message, outgoing)
        outgoing.flush()

    def say(phase: str, seconds: float) -> None:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, seconds + ORPHAN)
        send((phase, seconds))

    while True:
        try:
            job: Job = pickle.load(incoming)
        except EOFError:
            return
        say("building", job.budget.build_seconds)
        answer: Answer | Failed
        try:
            setup = builder.setup(job.experiment)
            with limited_threads():
                answer = _answered(job, setup, say)
        except BaseException as error:  # also a user's SystemExit
            answer = Failed(_reason(error), isinstance(error, UnknownName))
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        send(answer)


def _answered(job: Job, setup: Setup, say: Any) -> Answer:
    if isinstance(job, Solve):
        return carry_out(job, setup, say).stored()
    if isinstance(job, Describe):
        return describe(job.instance, setup).stored()
    say("judging", job.budget.judge_seconds)
    assert isinstance(job, Judge)
    return judge(setup, job.ends).stored()


def _reason(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    return f"{type(error).__name__}: {error}"


def _silence() -> None:
    """What others read and write is nothing, so that it cannot mix with jobs and answers."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nothing, standard)
