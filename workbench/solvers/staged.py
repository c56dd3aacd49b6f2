"""A few unknowns first, then more: each stage starts where the last one ended."""

from dataclasses import dataclass, field, replace

import numpy as np

from workbench.blocks import Values
from workbench.blocks.entries import entries
from workbench.errors import BadArgument
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities
from workbench.solvers.levenberg_marquardt import LevenbergMarquardt
from workbench.solvers.run import INTERRUPTED
from workbench.solvers.solution import (
    Callback,
    Evaluations,
    Iterate,
    Solution,
    Solver,
    Status,
)

GOES_ON = (Status.CONVERGED, Status.STALLED, Status.MAX_ITERATIONS, Status.INFEASIBLE)


@dataclass(frozen=True)
class Staged:
    """Frees the unknowns of each stage in turn, and at last all that the problem leaves free.

    `stages` hold names of blocks and of entries: `(("trans", "pose[pelvis]"), ("trans", "pose"))`.
    The rest stays at its value meanwhile, so that, say, a body stands where it should before its
    arms are looked for. A block means those of its entries that the problem leaves free. The trace
    is that of all stages, in all blocks; limits are the solver's, in each stage.
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
        """Those of the solver, if it says."""
        return getattr(self.solver, "abilities", None)

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Raises UnknownName for what the problem does not leave free."""
        everything = problem.free.names
        parts = [problem.free.chosen(entries(problem.free, stage)) for stage in self.stages]
        values = {**start}
        found: list[Solution] = []
        trace: list[Iterate] = []
        interrupts = Interrupts()  # also between the stages
        interrupts.open()
        try:
            for free in (*parts, problem.free):
                if found and (found[-1].status not in GOES_ON or interrupts.pressed):
                    break
                seen = _Along(trace, found, {name: values[name] for name in everything}, callback)
                whole = free.size == problem.free.size
                part = problem if whole else problem.freeing(*free.spelled())
                found.append(self.solver.solve(part, values, callback=seen))
                values |= found[-1].values
            together = _together(problem, values, found, trace)
        finally:
            interrupts.close()
        if interrupts.pressed:
            return replace(together, status=Status.STOPPED, message=INTERRUPTED)
        return together


class _Along:
    """Completes the iterates of a stage with what it leaves fixed and what came before."""

    def __init__(
        self, trace: list[Iterate], found: list[Solution], values: Values, callback: Callback | None
    ) -> None:
        self.trace, self.values, self.callback = trace, values, callback
        self.before = _summed([s.evaluations for s in found])
        self.seconds = sum(s.seconds for s in found)

    def __call__(self, iterate: Iterate) -> object:
        whole = replace(
            iterate,
            values={k: np.array(v) for k, v in (self.values | iterate.values).items()},
            evaluations=_summed([self.before, iterate.evaluations]),
            seconds=self.seconds + iterate.seconds,
        )
        self.trace.append(whole)
        return None if self.callback is None else self.callback(whole)


def _summed(counts: list[Evaluations]) -> Evaluations:
    return Evaluations(
        residual=sum(c.residual for c in counts),
        gradient=sum(c.gradient for c in counts),
        jacobian=sum(c.jacobian for c in counts),
        hessian=sum(c.hessian for c in counts),
        constraint=sum(c.constraint for c in counts),
    )


def _together(
    problem: Problem, values: Values, found: list[Solution], trace: list[Iterate]
) -> Solution:
    """The last stage's answer, over all blocks and all stages."""
    last = found[-1]
    return replace(
        last,
        values={name: np.array(values[name], dtype=float) for name in problem.free.names},
        solver=f"staged {last.solver}",
        evaluations=_summed([s.evaluations for s in found]),
        seconds=sum(s.seconds for s in found),
        trace=tuple(trace),
    )
