"""What the judgement of a run's end takes, and what it gives."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.best import Best
from workbench.solvers.iterate import Evaluations, Iterate
from workbench.solvers.limits import Options
from workbench.solvers.linearization_cache import LinearizationCache
from workbench.solvers.meter import Meter
from workbench.solvers.one_pass import OnePass
from workbench.solvers.rounding_noise import RoundingNoise
from workbench.solvers.sensitivity import Sensitivity
from workbench.solvers.solution import Status

NAMED = 6  # unknowns in a message; there may be thousands


class Ended(Protocol):
    """A run that is over, as far as its end is judged by it; see `Run`.

    Attributes:
        problem: the problem that was solved.
        limits: the limits and tolerances of the solver.
        x: (n,) the start.
        fixed: the fixed numbers.
        best: the best point.
        trace: the iterates.
        meter: the evaluations and the time of the run.
        one_pass: the trials linearized at once, and the evaluations that this saved.
        linearizations: the last linearization.
        sensitivity: the longest column of each unknown on the way.
        rounding_noise: the rounding errors along the run.
    """

    problem: Problem
    limits: Options
    x: Array
    fixed: Array
    best: Best
    trace: list[Iterate]
    meter: Meter
    one_pass: OnePass
    linearizations: LinearizationCache
    sensitivity: Sensitivity
    rounding_noise: RoundingNoise

    @property
    def interrupted(self) -> bool:
        """Whether somebody has pressed Ctrl-C, so that nothing more is looked for."""


@dataclass(frozen=True)
class Ending:
    """How a run ended; see the fields of the same names of `Solution`."""

    status: Status
    message: str
    optimality: float = np.nan
    insensitive: tuple[str, ...] = ()
    diverging: tuple[str, ...] = ()
    lower: Values | None = None
    judging: Evaluations = field(default_factory=Evaluations)
