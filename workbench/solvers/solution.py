"""What every solver is asked, and what it answers with."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from workbench.blocks import Values
from workbench.errors import BadFile
from workbench.problem import Problem
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import doubles, nothing_else, read_expected, texts
from workbench.reading.facts import Facts, amount, duration, facts_in, number, several, text
from workbench.reading.facts import facts as facts_of
from workbench.writing import replacing

FACTS, VALUE, TRACE = "solution", "value:", "trace:"  # how the arrays of a file are called
Row = tuple[Any, ...]  # all of an Iterate but its values


class Status(Enum):
    """How a solve ended; the value says what to do next."""

    CONVERGED = (
        "the gradient, or what bounds and constraints leave of it, vanishes here, as at a minimum; "
        "it would also vanish at a saddle point or a maximum"
    )
    STALLED = "no step lowers the cost although the gradient does not vanish; diagnose the problem"
    LOST = (
        "the residual no longer notices some unknowns, although it did on the way, so that nothing "
        "is learned about them here; start nearer, bound them, or give them a prior"
    )
    MAX_ITERATIONS = "out of iterations; raise max_iterations or start nearer"
    MAX_EVALUATIONS = "out of evaluations; raise max_evaluations or start nearer"
    MAX_SECONDS = "out of time; raise max_seconds or start nearer"
    NOT_FINITE = "the residual is NaN or infinite; look at its formula there, or bound the blocks"
    INFEASIBLE = "the constraints are not met; start nearer to where they are, or relax them"
    RAISED = "the residual raised an exception; see the message"
    TOO_LARGE = "memory does not suffice for what the solver asks for; see the message"
    STOPPED = "stopped by the callback or from the keyboard; the best point so far was kept"


@dataclass(frozen=True)
class Evaluations:
    """How often a solver asked for what."""

    residual: int = 0
    gradient: int = 0
    jacobian: int = 0
    hessian: int = 0
    constraint: int = 0  # values or Jacobian of the constraints

    @property
    def total(self) -> int:
        """Of the residual, its gradient, its Jacobian and its Hessian, together."""
        return self.residual + self.gradient + self.jacobian + self.hessian


@dataclass(frozen=True, eq=False)
class Iterate:
    """One point that a solver visited."""

    values: Values
    cost: float
    optimality: float  # Problem.optimality: 0 at a stationary point; NaN where it was not asked
    step_norm: float
    damping: float
    evaluations: Evaluations
    seconds: float
    linear_algebra: str = ""  # the factorization behind the step that led here, where we know it


@dataclass(frozen=True, eq=False)
class Solution:
    """The best point that a solver found, how it ended, and the way there."""

    values: Values  # of the free blocks
    cost: float
    optimality: float
    status: Status
    message: str
    solver: str
    evaluations: Evaluations
    seconds: float
    trace: tuple[Iterate, ...] = field(repr=False)
    violation: float = 0.0  # by how many tolerances the worst constraint is missed; up to 1 is met
    lost: tuple[str, ...] = ()  # unknowns that the residual noticed on the way, and here no longer
    unnoticed: tuple[str, ...] = ()  # unknowns whose columns were zero wherever they were seen

    @property
    def converged(self) -> bool:
        """Whether the gradient vanished, or what bounds and constraints leave of it."""
        return self.status is Status.CONVERGED

    @property
    def linear_algebra(self) -> dict[str, int]:
        """How many steps each factorization gave."""
        by = [i.linear_algebra for i in self.trace if i.linear_algebra]
        return {name: by.count(name) for name in dict.fromkeys(by)}

    @property
    def iterations(self) -> int:
        """Steps taken: the start is not one."""
        return max(0, len(self.trace) - 1)

    def save(self, path: str | Path) -> None:
        """Write everything to one `.npz`, whole or not at all; raises BadFile if it cannot be."""
        facts = {
            "cost": self.cost,
            "optimality": self.optimality,
            "status": self.status.name,
            "message": self.message,
            "solver": self.solver,
            "evaluations": asdict(self.evaluations),
            "seconds": self.seconds,
            "missed": self.violation,
            "lost": self.lost,
            "unnoticed": self.unnoticed,
            "trace": [
                [
                    i.cost,
                    i.optimality,
                    i.step_norm,
                    i.damping,
                    asdict(i.evaluations),
                    i.seconds,
                    i.linear_algebra,
                ]
                for i in self.trace
            ],
        }
        arrays = {FACTS: np.array(json.dumps(facts))}
        arrays |= {VALUE + name: value for name, value in self.values.items()}
        for name in self.values:
            arrays[TRACE + name] = np.array([i.values[name] for i in self.trace])
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # its bool has another name

    @staticmethod
    def load(path: str | Path) -> "Solution":
        """Read what `save` wrote; raises BadFile if that is not what the file holds."""
        with (
            taken_for(path, "solution that Solution.save wrote", "give the .npz of a run"),
            open_arrays(Path(path)) as archive,
        ):
            facts = facts_in(read_expected(archive, {FACTS: texts()})[FACTS])
            rows = facts.several("trace", _row)
            expected = {}
            shapes = {
                key.removeprefix(VALUE): header.shape
                for key, header in archive.headers.items()
                if key.startswith(VALUE)
            }
            for name, shape in shapes.items():
                expected[VALUE + name] = doubles(*shape)
                # numpy cannot say what shape none of something has
                expected[TRACE + name] = doubles(len(rows), *shape) if rows else doubles(0)
            nothing_else(archive, (*expected, FACTS))
            return _solution(facts, rows, read_expected(archive, expected), tuple(shapes))


def _solution(facts: Facts, rows: Sequence[Row], arrays: Values, names: Sequence[str]) -> Solution:
    """Of arrays that are what they must be; raises BadFile for facts that are not."""
    return Solution(
        values={name: arrays[VALUE + name] for name in names},
        cost=facts.amount("cost"),
        optimality=facts.amount("optimality"),
        status=Status[facts.among("status", Status.__members__)],
        message=facts.text("message"),
        solver=facts.text("solver"),
        evaluations=_evaluations(facts.facts("evaluations")),
        seconds=facts.duration("seconds"),
        trace=tuple(
            Iterate({name: arrays[TRACE + name][i] for name in names}, *row)
            for i, row in enumerate(rows)
        ),
        violation=facts.amount("missed") if "missed" in facts.told else 0.0,
        lost=facts.several("lost", text) if "lost" in facts.told else (),
        unnoticed=facts.several("unnoticed", text) if "unnoticed" in facts.told else (),
    )


def _row(given: object, name: str) -> Row:
    """What the facts say of one iterate; files from before linear algebra was told say less."""
    told = several(given, name, lambda entry, _: entry)
    if len(told) not in (6, 7):
        raise BadFile(f"{name} has {len(told)} entries, but must have 7")
    cost, optimality, step, damping, counts, seconds, *by = told
    return (
        *(amount(one, name) for one in (cost, optimality, step)),
        number(damping, name),
        _evaluations(facts_of(counts, name)),
        duration(seconds, name),
        *(text(one, name) for one in by),
    )


def _evaluations(told: Facts) -> Evaluations:
    """Counts by kind; files from before there were constraints count none of theirs."""
    known = [field.name for field in fields(Evaluations)]
    told.nothing_else(*known)
    needed = [name for name in known if name != "constraint" or name in told.told]
    return Evaluations(**{name: told.whole(name) for name in needed})


Callback = Callable[[Iterate], object]  # called at every iterate; stops the solver if it says True


class Solver(Protocol):
    """Anything that leads a problem from starting values to a solution."""

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """From `start`, values for every block that the problem reads, to the best point found."""
