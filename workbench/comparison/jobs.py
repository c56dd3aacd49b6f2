"""What is asked of a worker process, and what an answer is made of: all of it pickles."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from workbench.arrays import Array
from workbench.comparison.budget import Budget
from workbench.comparison.named_solvers import SentSolver
from workbench.comparison.plan import SentExperiment

Announce = Callable[[str, float], None]  # what begins, and how many seconds it may take


@dataclass(frozen=True)
class Describe:
    """Build an instance and look at it: size, cost at the start, prices of evaluations."""

    key: str
    experiment: SentExperiment
    instance: str  # its name
    budget: Budget
    own: str = ""


@dataclass(frozen=True)
class Solve:
    """A job: one run of a solver on an instance."""

    key: str
    experiment: SentExperiment
    solver: SentSolver
    instance: str  # its name
    repetition: int
    budget: Budget
    grace: float  # s
    own: str = ""  # whose process it needs, where it may not share one with the others
    log: str = ""  # the file that the watch writes to
    rehearse: bool = True


@dataclass(frozen=True, eq=False)
class AnalyseEnds:
    """Look at all ends of one problem: where each leads to, and what keeps it from the best."""

    key: str
    experiment: SentExperiment
    ends: tuple[Array, ...]
    budget: Budget
    own: str = ""


Job = Describe | Solve | AnalyseEnds


@dataclass(frozen=True)
class Lost:
    """A worker that gave no answer."""

    phase: str
    killed: bool  # for taking too long; else it died by itself
    message: str


@dataclass(frozen=True)
class Failed:
    """An answer that says why there is none."""

    message: str
    argument: bool = False  # the experiment has no such start or seed


Answer = tuple[dict[str, Any], dict[str, Array]]
