"""Solving in stages: a few unknowns first, then more, each stage from where the last one ended."""

from dataclasses import dataclass, field, replace

import numpy as np

from workbench.blocks import Values
from workbench.blocks.entries import entries
from workbench.errors import BadArgument
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities
from workbench.solvers.iterate import Evaluations, Iterate
from workbench.solvers.levenberg_marquardt import LevenbergMarquardt
from workbench.solvers.run import INTERRUPTED
from workbench.solvers.solution import (
    Callback,
    Solution,
    Solver,
    Status,
)

GOES_ON = (
    Status.CONVERGED,
    Status.SADDLE,
    Status.VALLEY,
    Status.STALLED,
    Status.MAX_ITERATIONS,
    Status.INFEASIBLE,
)


@dataclass(frozen=True)
class Staged:
    """Solve for the unknowns of each stage in turn, and at last for all free unknowns.

    The rest is fixed meanwhile, so that, say, a body stands in the right place before the pose of
    its arms is looked for. The trace of the solution is that of all stages and holds all blocks.
    The limits of the solver apply to each stage by itself. Raises BadArgument for a stage that is
    no tuple of names.

    Attributes:
        stages: the names of blocks and of entries that are free in each stage, such as
            `(("trans", "pose[pelvis]"), ("trans", "pose"))`. The name of a block stands for those
            of its entries that the problem leaves free.
        solver: what solves each stage.
    """

    stages: tuple[tuple[str, ...], ...]
    solver: Solver = field(default_factory=LevenbergMarquardt)

    def __post_init__(self) -> None:
        for stage in self.stages:
            if not isinstance(stage, tuple) or not stage:
                raise BadArgument(
                    "a stage is a tuple of names of blocks or entries, such as "
                    f"('trans', 'pose[pelvis]'), not {stage!r}"
                )

    @property
    def abilities(self) -> Abilities | None:
        """The abilities of the solver, if it has any to tell."""
        return getattr(self.solver, "abilities", None)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve stage by stage from `start`; see `Solver`.

        Raises UnknownName for what the problem does not leave free.
        """
        parts = [problem.free.chosen(entries(problem.free, stage)) for stage in self.stages]
        values = {**start}
        trace: list[Iterate] = []
        last: Solution | None = None
        before, seconds = Evaluations(), 0.0

        def completed(values: Values) -> Values:
            return {name: np.array(values[name], dtype=float) for name in problem.free.names}

        def record(iterate: Iterate) -> object:
            """Complete an iterate with what the stage leaves fixed and what came before."""
            whole = replace(
                iterate,
                values=completed(values | iterate.values),
                evaluations=before + iterate.evaluations,
                seconds=seconds + iterate.seconds,
            )
            trace.append(whole)
            return None if callback is None else callback(whole)

        with Interrupts() as interrupts:  # also between the stages
            for free in (*parts, problem.free):
                if last is not None and (last.status not in GOES_ON or interrupts.pressed):
                    break
                whole = free.size == problem.free.size
                part = problem if whole else problem.freeing(*free.spelled())
                last = self.solver.solve(part, values, callback=record)
                values |= last.values
                before, seconds = before + last.evaluations, seconds + last.seconds
        assert last is not None  # the last stage is always there
        solution = replace(
            last,
            values=completed(values),
            solver=f"staged {last.solver}",
            evaluations=before,
            seconds=seconds,
            trace=tuple(trace),
        )
        if interrupts.pressed:
            return replace(solution, status=Status.STOPPED, message=INTERRUPTED)
        return solution
