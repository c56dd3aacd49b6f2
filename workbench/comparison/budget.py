"""What every run may spend, the same for all solvers."""

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from workbench.errors import BadArgument
from workbench.solvers import Solver


@dataclass(frozen=True)
class Budget:
    """Limits of one run; `given` hands them to a solver, and the metered problem enforces them.

    `gradient_tolerance` is far below what the judgement asks for, so that nobody's stopping rule
    decides; whether a point is stationary is judged at `stationary` (both are values of
    `Problem.optimality`). Raises BadArgument for a limit that is not above zero.

    Attributes:
        max_evaluations: evaluations of residual, gradient, Jacobian and Hessian together.
        max_seconds: the time of a run.
        gradient_tolerance: the tolerance that is given to solvers.
        stationary: the largest `Problem.optimality` of a stationary point.
        grace: seconds after `max_seconds` until the process is killed; at least three Jacobians.
        build_seconds: the time for building a problem, which is not counted as the run's.
        judge_seconds: the time for analysing all ends of one problem.
    """

    max_evaluations: int = 5_000
    max_seconds: float = 60.0
    gradient_tolerance: float = 1e-12
    stationary: float = 1e-6
    grace: float = 2.0
    build_seconds: float = 300.0
    judge_seconds: float = 900.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise BadArgument(f"{field.name} of a budget must be above 0, not {value!r}")

    def given(self, solver: Solver, repetition: int = 0) -> Solver:
        """The solver with these limits, as far as it has options of the workbench's names for them.

        If it has a seed, this is the number of the repetition.
        """
        wanted = {
            "max_evaluations": self.max_evaluations,
            "max_iterations": self.max_evaluations,  # a step takes an evaluation at least
            "max_seconds": self.max_seconds,
            "gradient_tolerance": self.gradient_tolerance,
            "seed": repetition,
        }
        options: Any = solver
        fits = fields(options) if is_dataclass(options) else ()
        has = {field.name for field in fits if field.init} & wanted.keys()
        given: Solver = replace(options, **{name: wanted[name] for name in has}) if has else solver
        return given
