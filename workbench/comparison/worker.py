"""A worker process: it reads jobs from its standard input and answers on its standard output.

Whatever a solver or a problem prints goes nowhere, so that it cannot mix with the answers. An
alarm of the system ends the process should it hang after whoever started it has gone.
"""

import os
import pickle
import signal
from collections import OrderedDict
from typing import Any, BinaryIO

from workbench.comparison.description import describe
from workbench.comparison.identity import identity
from workbench.comparison.jobs import Answer, Describe, Failed, Job, Judge, Solve
from workbench.comparison.judgement import judge
from workbench.comparison.plan import SentExperiment
from workbench.comparison.running import carry_out
from workbench.errors import UnknownName, WorkbenchError
from workbench.experiments.experiment import Setup
from workbench.threads import limited_threads

KEPT = 4  # problems that stay built
ORPHAN = 30.0  # s after a limit, at which the system ends a process that nobody ended


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


def main() -> None:
    """Serve until the input ends."""
    incoming, outgoing = _own_pipes()
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


def _own_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Input and output for jobs alone; what others read and write is nothing."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nothing, standard)
    return incoming, outgoing
