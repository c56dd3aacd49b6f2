"""What every solver takes and returns: a problem and a start, and a solution with its trace."""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, astuple, dataclass, field, fields, replace
from enum import Enum
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from workbench.blocks import Values
from workbench.errors import BadArgument, BadFile
from workbench.problem import Problem
from workbench.reading.arrays import doubles, nothing_else, opened, read_expected, texts
from workbench.reading.facts import (
    Facts,
    amount,
    duration,
    facts_in,
    number,
    several,
    text,
    whole,
)
from workbench.reading.facts import facts as facts_of
from workbench.writing import write_arrays

FACTS, VALUE, TRACE = "solution", "value:", "trace:"  # in a file
HYPOTHESES, LOWER = "hypotheses:", "lower:"
T = TypeVar("T")
Row = tuple[Any, ...]  # all of an Iterate but its values


class Status(Enum):
    """How a solve ended; the value says what to do next."""

    CONVERGED = (
        "the gradient, or what bounds and constraints leave of it, vanishes here, as at a minimum, "
        "and no direction was found along which the cost falls by more than rounding and the "
        "tolerance explain"
    )
    SADDLE = (
        "the gradient vanishes, but this is no minimum: the cost falls along a direction; start "
        "from the `lower` point of the solution, which lies along it"
    )
    STALLED = "no step lowers the cost although the gradient does not vanish; diagnose the problem"
    INSENSITIVE = (
        "the residual hardly changes with some unknowns here, and says nothing about them; start "
        "nearer, bound them, or give them a prior"
    )
    NO_FINITE_MINIMUM = (
        "the cost falls for ever as some unknowns grow without limit, and has no minimum there; "
        "bound them, give them a prior, or choose other unknowns, such as their inverses"
    )
    MAX_ITERATIONS = "out of iterations; raise max_iterations or start nearer"
    MAX_EVALUATIONS = "out of evaluations; raise max_evaluations or start nearer"
    MAX_SECONDS = "out of time; raise max_seconds or start nearer"
    NOT_FINITE = "the residual is NaN or infinite; look at its formula there, or bound the blocks"
    INFEASIBLE = "the constraints are not met; start nearer to where they are, or relax them"
    RAISED = "the residual raised an exception; see the message"
    TOO_LARGE = "memory does not suffice for what the solver asks for; see the message"
    STOPPED = "stopped by the callback or from the keyboard; the best point so far was kept"
    LOST = INSENSITIVE  # its name in older files
    VALLEY = NO_FINITE_MINIMUM  # its name in older files


def limited(counts: Mapping[str, int]) -> int:
    """The number of evaluations of all kinds but those of constraints, which have no limit."""
    return sum(count for kind, count in counts.items() if not kind.startswith("constraint"))


@dataclass(frozen=True)
class Evaluations:
    """The number of evaluations of each kind.

    Attributes:
        residual: of the residual, and so of the cost.
        gradient: of the cost and its gradient.
        jacobian: of the residual and its Jacobian.
        hessian: of the exact Hessian of the cost.
        constraint: of the values, the Jacobian or the Hessian of the constraints.
    """

    residual: int = 0
    gradient: int = 0
    jacobian: int = 0
    hessian: int = 0
    constraint: int = 0

    @property
    def total(self) -> int:
        """All evaluations but those of the constraints."""
        return limited(vars(self))

    def __add__(self, other: "Evaluations") -> "Evaluations":
        """The evaluations of both."""
        return Evaluations(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


@dataclass(frozen=True, eq=False)
class Iterate:
    """One point that a solver visited.

    Attributes:
        values: the values of the free blocks.
        cost: the cost at the point.
        optimality: `Problem.optimality`, 0 at a stationary point; NaN where it was not computed.
        step_norm: the length of the step from the iterate before, in the units of the unknowns; to
            shorten a rotation vector afterwards is no step.
        damping: the damping of the step to this point, or by how much the Hessian was changed for
            it; LevenbergMarquardt's is that of the next step; 0 for solvers that have neither.
        evaluations: the evaluations up to here.
        seconds: the time up to here, in s.
        linear_algebra: the factorization that gave the step to this point; empty where it is not
            known.
    """

    values: Values
    cost: float
    optimality: float
    step_norm: float
    damping: float
    evaluations: Evaluations
    seconds: float
    linear_algebra: str = ""


# called at every iterate; stops the solver if it says True
Callback = Callable[[Iterate], object] | None


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A minimum that a solver with several starts found; see `Starts`.

    Attributes:
        values: the values of the free blocks.
        cost: the cost there.
        status: how the best run to it ended.
        starts: the numbers of the starts that led to it, that of the best run first.
        violation: by how many tolerances the worst constraint is exceeded.
    """

    values: Values
    cost: float
    status: Status
    starts: tuple[int, ...]
    violation: float = 0.0


@dataclass(frozen=True, eq=False)
class Solution:
    """The best point that a solver found, how the run ended, and its iterates.

    Attributes:
        values: the values of the free blocks.
        cost: the cost at the point.
        optimality: `Problem.optimality` there, 0 at a stationary point; NaN if it is not known.
        status: how the run ended.
        message: the same in a sentence.
        solver: the name of the solver.
        evaluations: the evaluations of the whole run.
        seconds: the time of the whole run, in s.
        trace: the iterates, the start first.
        violation: by how many tolerances the worst constraint is exceeded; up to 1 the point is
            feasible.
        insensitive: labels of unknowns with which the residual hardly changes where the run ended,
            or does not change anywhere that the Jacobian was computed.
        hypotheses: the minima that several starts led to, this one first; empty for one start.
        diverging: labels of the unknowns that grow without limit while the cost falls for ever.
        lower: if the status is SADDLE, values beside the saddle where the cost is lower, from which
            to start again; else None.
        judging: the evaluations by which the end was judged after the run. They are not among
            `evaluations`, and no limit of the solver applies to them.
        stages: where in the trace each stage of `Staged` ended, the last one included; empty for a
            solve without stages.
    """

    values: Values
    cost: float
    optimality: float
    status: Status
    message: str
    solver: str
    evaluations: Evaluations
    seconds: float
    trace: tuple[Iterate, ...] = field(repr=False)
    violation: float = 0.0
    insensitive: tuple[str, ...] = ()
    hypotheses: tuple[Hypothesis, ...] = ()
    diverging: tuple[str, ...] = ()
    lower: Values | None = None
    judging: Evaluations = field(default_factory=Evaluations)
    stages: tuple[int, ...] = ()

    @property
    def converged(self) -> bool:
        """Whether the status is CONVERGED: nothing lowers the cost, as far as could be told."""
        return self.status is Status.CONVERGED

    @property
    def linear_algebra(self) -> dict[str, int]:
        """How many steps were computed by each factorization."""
        names = [i.linear_algebra for i in self.trace if i.linear_algebra]
        return dict(Counter(names))

    @property
    def iterations(self) -> int:
        """The number of steps; the start is not counted."""
        return max(0, len(self.trace) - 1)

    def save(self, path: str | Path) -> None:
        """Write everything to one `.npz`, whole or not at all. Raises BadFile if that fails."""
        facts = {
            "cost": self.cost,
            "optimality": self.optimality,
            "status": self.status.name,
            "message": self.message,
            "solver": self.solver,
            "evaluations": asdict(self.evaluations),
            "seconds": self.seconds,
            "missed": self.violation,
            "insensitive": self.insensitive,
            "trace": [list(asdict(replace(i, values={})).values())[1:] for i in self.trace],
            "diverging": self.diverging,
            "judging": asdict(self.judging),
            "stages": self.stages,
            "hypotheses": [[h.cost, h.status.name, h.starts, h.violation] for h in self.hypotheses],
        }
        arrays = {FACTS: np.array(json.dumps(facts))}
        arrays |= {VALUE + name: value for name, value in self.values.items()}
        for name in self.values:
            arrays[TRACE + name] = np.array([i.values[name] for i in self.trace])
            if self.hypotheses:
                arrays[HYPOTHESES + name] = np.array([h.values[name] for h in self.hypotheses])
        arrays |= {LOWER + name: value for name, value in (self.lower or {}).items()}
        write_arrays(path, arrays)

    @staticmethod
    def load(path: str | Path) -> "Solution":
        """Read what `save` wrote; raises BadFile if that is not what the file holds."""
        what = "solution that Solution.save wrote"
        with opened(path, what, "give the .npz of a run") as archive:
            facts = facts_in(read_expected(archive, {FACTS: texts()})[FACTS])
            rows, minima = facts.several("trace", _row), _several(facts, _minimum, "hypotheses")
            shapes = {
                key.removeprefix(VALUE): header.shape
                for key, header in archive.headers.items()
                if key.startswith(VALUE)
            }
            has_lower = any(key.startswith(LOWER) for key in archive.headers)
            expected = {}
            for name, shape in shapes.items():
                expected[VALUE + name] = doubles(*shape)
                # the array of an empty trace has the shape (0,)
                expected[TRACE + name] = doubles(len(rows), *shape) if rows else doubles(0)
                if minima:
                    expected[HYPOTHESES + name] = doubles(len(minima), *shape)
                if has_lower:
                    expected[LOWER + name] = doubles(*shape)
            nothing_else(archive, (*expected, FACTS))
            arrays = read_expected(archive, expected)

            def values(of: str, i: int | None = None) -> Values:
                named = {name: arrays[of + name] for name in shapes}
                return named if i is None else {name: array[i] for name, array in named.items()}

            old = facts.entries  # older files lack some of the facts
            return Solution(
                values=values(VALUE),
                cost=facts.amount("cost"),
                optimality=facts.amount("optimality"),
                status=Status[facts.among("status", Status.__members__)],
                message=facts.text("message"),
                solver=facts.text("solver"),
                evaluations=_evaluations(facts.facts("evaluations")),
                seconds=facts.duration("seconds"),
                trace=tuple(Iterate(values(TRACE, i), *row) for i, row in enumerate(rows)),
                violation=facts.amount("missed") if "missed" in old else 0.0,
                insensitive=_several(facts, text, "insensitive", "lost", "unnoticed"),
                hypotheses=tuple(
                    Hypothesis(values(HYPOTHESES, i), *row) for i, row in enumerate(minima)
                ),
                diverging=_several(facts, text, "diverging", "running"),
                lower=values(LOWER) if has_lower else None,
                judging=_evaluations(facts.facts("judging")) if "judging" in old else Evaluations(),
                stages=_several(facts, whole, "stages"),
            )


def _several(facts: Facts, of: Callable[[object, str], T], *names: str) -> tuple[T, ...]:
    """The items under a name and under those that it had in older files; none without any."""
    present = (name for name in names if name in facts.entries)
    return tuple(item for name in present for item in facts.several(name, of))


def _row(value: object, name: str) -> Row:
    """All of one iterate but its values; older files do not have the linear algebra."""
    entries = several(value, name, lambda entry, _: entry)
    if len(entries) not in (6, 7):
        raise BadFile(f"{name} has {len(entries)} entries, but must have 6 or 7")
    cost, optimality, step_norm, damping, counts, seconds, *linear_algebra = entries
    return (
        amount(cost, name),
        amount(optimality, name),
        amount(step_norm, name),
        number(damping, name),
        _evaluations(facts_of(counts, name)),
        duration(seconds, name),
        *(text(factorization, name) for factorization in linear_algebra),
    )


def _minimum(value: object, name: str) -> Row:
    """All of one hypothesis but its values."""
    entries = several(value, name, lambda entry, _: entry)
    if len(entries) != 4:
        raise BadFile(f"{name} has {len(entries)} entries, but must have 4")
    cost, status, starts, violation = entries
    if not isinstance(status, str) or status not in Status.__members__:
        raise BadFile(f"{name} has the status {status!r:.40}, which does not exist")
    numbers = tuple(map(int, several(starts, name, number)))
    return amount(cost, name), Status[status], numbers, amount(violation, name)


def _evaluations(facts: Facts) -> Evaluations:
    """Counts by kind; older files do not have those of constraints."""
    kinds = [field.name for field in fields(Evaluations)]
    facts.nothing_else(*kinds)
    counted = [kind for kind in kinds if kind != "constraint" or kind in facts.entries]
    return Evaluations(**{kind: facts.whole(kind) for kind in counted})


class Solver(Protocol):
    """Anything that solves a problem from starting values."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """The best point found from `start`, which has a value for every block of the problem.

        `callback` is called at every iterate, and stops the solver if it returns True.
        """


def checked(solver: Solver) -> Solver:
    """The solver itself. Raises BadArgument for what is none, such as a class of solvers."""
    if isinstance(solver, type) or not callable(getattr(solver, "solve", None)):
        raise BadArgument(f"a solver is an object, such as TrustRegion(), not {solver!r:.80}")
    return solver
