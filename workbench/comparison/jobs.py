"""What is asked of a worker process, and what an answer is made of: all of it pickles."""

from collections.abc import Callable
from dataclasses import dataclass

from workbench.arrays import Array
from workbench.comparison.budget import Budget
from workbench.comparison.design import Opening
from workbench.comparison.named_solvers import SentSolver
from workbench.comparison.record import Stored

Announce = Callable[[str, float], None]  # what begins, and how many seconds it may take


@dataclass(frozen=True)
class Describe:
    """Build an instance and describe it: its size, its cost at the start, the times of evaluations.

    Attributes:
        key: the key under which the answer is stored.
        experiment: opens the experiment with its arguments.
        instance: the name of the instance.
        budget: the limits.
        own: the solver whose process it needs; empty if the process is shared.
    """

    key: str
    experiment: Opening
    instance: str
    budget: Budget
    own: str = ""


@dataclass(frozen=True)
class Solve:
    """Run a solver once on an instance.

    Attributes:
        key: the key under which the answer is stored.
        experiment: opens the experiment with its arguments.
        solver: the solver.
        instance: the name of the instance.
        repetition: the number of the repetition, which seeds random numbers.
        budget: the limits of the run.
        grace: seconds after the time limit until the process is killed.
        own: the solver whose process it needs; empty if the process is shared.
        log: the path of the file in which the metered problem records the run.
        rehearse: whether the solver is first run for a few evaluations.
    """

    key: str
    experiment: Opening
    solver: SentSolver
    instance: str
    repetition: int
    budget: Budget
    grace: float
    own: str = ""
    log: str = ""
    rehearse: bool = True


@dataclass(frozen=True, eq=False)
class AnalyseEnds:
    """Analyse all ends of one problem: where each leads to, and what keeps it from the best.

    Attributes:
        key: the key under which the answer is stored.
        experiment: opens the experiment with its arguments.
        ends: the ends, (n,) each.
        budget: the limits.
        own: the solver whose process it needs; empty if the process is shared.
    """

    key: str
    experiment: Opening
    ends: tuple[Array, ...]
    budget: Budget
    own: str = ""


Answer = Stored
Job = Describe | Solve | AnalyseEnds


@dataclass(frozen=True)
class Lost:
    """What is known of a worker process that gave no answer.

    Attributes:
        phase: what it was doing.
        killed: whether it was killed for taking too long; otherwise it died by itself.
        message: the reason, as a sentence.
    """

    phase: str
    killed: bool
    message: str


@dataclass(frozen=True)
class Failed:
    """The answer of a worker process that could not do its job.

    Attributes:
        message: why it could not.
        argument: whether the experiment has no such start or seed.
    """

    message: str
    argument: bool = False
