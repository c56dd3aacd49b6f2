"""A worker process: it receives jobs by a channel and answers them.

What a solver or a problem prints is discarded. An alarm of the system ends a process that still
hangs after the process that started it has gone.
"""

import pickle
import signal
import sys
from collections import OrderedDict
from typing import Any

from workbench.comparison.description import describe
from workbench.comparison.design import Opening
from workbench.comparison.end_analysis import analyse_ends
from workbench.comparison.jobs import AnalyseEnds, Announce, Answer, Describe, Failed, Job, Solve
from workbench.comparison.running import run_solver
from workbench.errors import UnknownName, WorkbenchError
from workbench.fitting.setup import Setup
from workbench.processes import Channel, end_with_parent
from workbench.threads import limited_threads

KEPT = 4  # problems that stay built
ORPHAN = 5.0  # s after a limit, at which the system ends a process that nobody ended


class Builder:
    """Builds setups, and keeps the last few."""

    def __init__(self) -> None:
        self._built: OrderedDict[bytes, Setup] = OrderedDict()

    def setup(self, sent: Opening) -> Setup:
        """Raises whatever building it raises."""
        key = pickle.dumps(sent)
        if key not in self._built:
            self._built[key] = sent().setup()
            while len(self._built) > KEPT:
                self._built.popitem(last=False)
        self._built.move_to_end(key)
        return self._built[key]


def main() -> None:
    """Answer jobs as a process of its own."""
    end_with_parent()
    serve(Channel.inherited(int(sys.argv[-1])))


def serve(channel: Channel) -> None:
    """Answer jobs until the connection is closed."""
    builder = Builder()

    def send(message: Any) -> None:
        channel.send(pickle.dumps(message))

    def announce(phase: str, seconds: float) -> None:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, seconds + ORPHAN)
        send((phase, seconds))

    while message := channel.receive():
        job: Job = pickle.loads(message)
        announce("building", job.budget.build_seconds)
        answer: Answer | Failed
        try:
            setup = builder.setup(job.experiment)
            with limited_threads():
                answer = _answered(job, setup, announce)
        except BaseException as error:  # also a user's SystemExit
            answer = Failed(_reason(error), isinstance(error, UnknownName))
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        send(answer)


def _answered(job: Job, setup: Setup, announce: Announce) -> Answer:
    if isinstance(job, Solve):
        return run_solver(job, setup, announce).stored()
    if isinstance(job, Describe):
        return describe(job.instance, setup).stored()
    announce("judging", job.budget.judge_seconds)
    assert isinstance(job, AnalyseEnds)
    return analyse_ends(setup, job.ends).stored()


def _reason(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    return f"{type(error).__name__}: {error}"
