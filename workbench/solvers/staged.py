"""Solving in stages, each from where the last one ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.blocks import Values
from workbench.blocks.layout import entries
from workbench.errors import BadArgument
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.problem.problem import in_stage
from workbench.solvers.abilities import Abilities
from workbench.solvers.run import INTERRUPTED
from workbench.solvers.solution import (
    Callback,
    Evaluations,
    Iterate,
    Solution,
    Solver,
    Status,
    checked,
)
from workbench.solvers.starts import beyond_saddle
from workbench.solvers.trust_region import TrustRegion

GOES_ON = (  # ends from which the next stage begins; from INSENSITIVE no way leads back
    Status.CONVERGED,
    Status.SADDLE,
    Status.NO_FINITE_MINIMUM,
    Status.STALLED,
    Status.MAX_ITERATIONS,
    Status.INFEASIBLE,
)


@dataclass(frozen=True)
class SolveStage:
    """What is different in a stage: which names are free, and how much residuals count.

    SMPLify's schedule, for example, is stages in which priors count more at first (Bogo et al.
    2016). Raises BadArgument for a name that is no text, or a weight that is no number from 0 on.

    Attributes:
        free: the names of blocks and of entries that are free, such as `("trans",
            "pose[pelvis]")`; None for all that the problem leaves free. The name of a block stands
            for those of its entries that the problem leaves free.
        weights: how many times as often the rows of a residual count as they do in the problem, by
            the residual's name: `{"pose prior": 10}`; others count once.
        solver: what solves this stage, if it is not what solves the others; often the same with a
            larger `gradient_tolerance`, because the end of a stage is only a start.
    """

    free: tuple[str, ...] | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    solver: Solver | None = None

    def __post_init__(self) -> None:
        if self.solver is not None:
            checked(self.solver)
        names = ("",) if self.free is None else self.free
        if not (isinstance(names, tuple) and names and all(isinstance(n, str) for n in names)):
            raise BadArgument(
                "a stage is a tuple of names of blocks or entries, such as "
                f"('trans', 'pose[pelvis]'), or None for all, not {self.free!r}"
            )
        for name, weight in self.weights.items():
            number = isinstance(weight, (int, float, np.number)) and not isinstance(weight, bool)
            if not number or not 0 <= weight < np.inf:
                raise BadArgument(
                    f"the weight of residual {name!r} in a stage is a finite number from 0 on, not "
                    f"{weight!r}"
                )


@dataclass(frozen=True)
class Staged:
    """Solve stage after stage, and at last the problem as it is, with all that it leaves free.

    The rest is fixed meanwhile, so that, say, a body stands in the right place before the pose of
    its arms is looked for. The trace of the solution is that of all stages and holds all blocks;
    where a stage weights residuals otherwise, its costs are not those of the problem. A stage that
    ends at a saddle goes on once from the `lower` point beside it; one that is INSENSITIVE, or ends
    at a limit of evaluations or time, is the last. The limits of the solver apply to each stage by
    itself. Raises BadArgument for a stage that is no tuple of names and no `SolveStage`.

    Attributes:
        stages: what is different in each stage but the last: a `SolveStage`, or only the names that
            are free in it, such as `(("trans", "pose[pelvis]"), ("trans", "pose"))`.
        solver: what solves each stage; by default the solver of `solve`.
    """

    stages: tuple[tuple[str, ...] | SolveStage, ...]
    solver: Solver = field(default_factory=TrustRegion)

    def __post_init__(self) -> None:
        _ = self.each, checked(self.solver)

    @property
    def each(self) -> tuple[SolveStage, ...]:
        """The stages, the last one included."""
        return (
            *(s if isinstance(s, SolveStage) else SolveStage(s) for s in self.stages),
            SolveStage(),
        )

    @property
    def abilities(self) -> Abilities | None:
        """The abilities of the solver, if it has any to tell."""
        return getattr(self.solver, "abilities", None)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve stage by stage from `start`; see `Solver`.

        Raises UnknownName for what the problem does not leave free, and for a residual that it does
        not have.
        """
        parts = [_part(problem, stage) for stage in self.each]
        values = {**start}
        trace: list[Iterate] = []
        last: Solution | None = None
        ends: list[int] = []
        before, seconds = Evaluations(), 0.0

        def completed(values: Values) -> Values:
            return {name: np.array(values[name], dtype=float) for name in problem.free.names}

        def in_sequence(iterate: Iterate) -> Iterate:
            """Complete an iterate with what the stage leaves fixed and what came before."""
            return replace(
                iterate,
                values=completed(values | iterate.values),
                evaluations=before + iterate.evaluations,
                seconds=seconds + iterate.seconds,
            )

        def report(iterate: Iterate) -> object:
            return None if callback is None else callback(in_sequence(iterate))

        with Interrupts() as interrupts:  # also between the stages
            for stage, part in zip(self.each, parts, strict=True):
                if last is not None and (last.status not in GOES_ON or interrupts.pressed):
                    break
                solver = stage.solver or self.solver
                first = solver.solve(part, values, callback=report)
                last = beyond_saddle(first, solver, part, values, report)
                trace += map(in_sequence, last.trace)
                values |= last.values
                ends.append(len(trace) - 1)
                before, seconds = before + last.evaluations, seconds + last.seconds
        assert last is not None  # the last stage is always there
        solution = replace(
            last,
            values=completed(values),
            solver=f"staged {last.solver}",
            evaluations=before,
            seconds=seconds,
            trace=tuple(trace),
            stages=tuple(end for end in ends if end >= 0),
        )
        if interrupts.pressed:
            return replace(solution, status=Status.STOPPED, message=INTERRUPTED)
        return solution


def _part(problem: Problem, stage: SolveStage) -> Problem:
    """The problem of a stage, which is the problem itself if nothing is different."""
    names = stage.free
    if names is not None:
        free = problem.free.chosen(entries(problem.free, names))
        names = None if free.size == problem.free.size else tuple(free.spelled())
    return in_stage(problem, names, stage.weights)
