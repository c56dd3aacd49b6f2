"""Scans registered one by one and together, by the number of scans and of holes in each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.registration.coregistration import Coregistration, CoregistrationPlan, Fitted
from workbench.studies.coregistration.scans import (
    START,
    Apart,
    ScannedSet,
    errors,
    ratio,
    scanned_set,
)
from workbench.studies.pages import Report
from workbench.training.execution import Execution, Executor

APART, CONTROL, TOGETHER = "apart", "apart, as many rounds more", "together"


@dataclass(frozen=True)
class TogetherPlan:
    """What the study asks. Raises BadArgument for a plan that nothing can be learned from.

    Attributes:
        scans: numbers of scans, each of which is a set of its own; a set begins with the scans of
            the smaller ones.
        holes: numbers of holes in each scan.
        people: how many people the scans are of, in turn.
        rounds: of coregistration.
        seed: of every draw.
    """

    scans: tuple[int, ...] = (12, 24, 48)
    holes: tuple[int, ...] = (0, 12, 24)
    people: int = 6
    rounds: int = 4
    seed: int = 400

    def __post_init__(self) -> None:
        if self.people < 2 or self.rounds < 1:
            raise BadArgument(
                f"the study takes two people or more and one round or more, not {self.people} and "
                f"{self.rounds}"
            )
        for name, each, least in (("scans", self.scans, self.people), ("holes", self.holes, 0)):
            if not each or list(each) != sorted(set(each)) or each[0] < least:
                raise BadArgument(
                    f"the numbers of {name} rise from {least} on, not {', '.join(map(str, each))}"
                )


@dataclass(frozen=True)
class Cell:
    """One set of scans.

    Attributes:
        scans: their number.
        holes: the number of holes in each.
        unseen: the share of vertices that no scanner saw.
        subject: of whom each scan is.
        errors: by method, mean errors of `seen` and `hidden` vertices by scan, and the others of
            `scans.errors`, in mm.
    """

    scans: int
    holes: int
    unseen: float
    subject: tuple[int, ...]
    errors: dict[str, dict[str, list[float]]]

    def mean(self, method: str, what: str) -> float:
        """The mean error of a method over all scans, in mm."""
        return float(np.mean(self.errors[method][what]))

    def share(self, what: str) -> tuple[float, ...]:
        """The error of `together` over that of the control, with its 90 % interval over people."""
        ours, theirs = (self.errors[m][what] for m in (TOGETHER, CONTROL))
        return ratio(ours, theirs, np.array(self.subject))


@dataclass(frozen=True, eq=False)
class Example:
    """One scan of the largest set, on which registering together changed hidden vertices most.

    Attributes:
        row: its number.
        faces: (F, 3).
        truth: (N, 3) m.
        found: by method, the registration (N, 3) m.
    """

    row: int
    faces: Index
    truth: Array
    found: dict[str, Array]


@dataclass(frozen=True, eq=False)
class TogetherStudy:
    """All that was measured.

    Attributes:
        plan: what was asked for.
        cells: for every number of holes, the sets from the smallest to the largest.
        example: a scan in pictures.
    """

    plan: TogetherPlan
    cells: tuple[Cell, ...]
    example: Example

    def row(self, holes: int) -> list[Cell]:
        """The sets with so many holes."""
        return [cell for cell in self.cells if cell.holes == holes]


def together_study(plan: TogetherPlan, executor: Executor, report: Report) -> TogetherStudy:
    """Simulate the scans, register them in each way, and measure.

    Registering by itself does not depend on the other scans, so that each scan is registered once
    for every number of holes.
    """
    cells: list[Cell] = []
    example = None
    for holes in plan.holes:
        report(f"simulating {plan.scans[-1]} scans with {holes} holes in each")
        given = scanned_set(plan.seed, plan.people, plan.scans[-1], holes)
        report("registering each by itself")
        jobs = [(given.scans, j, start) for j, start in enumerate(given.starts)]
        apart = list(executor(Apart(0), jobs))
        again = [(given.scans, j, found) for j, found in enumerate(apart)]
        control = list(executor(Apart(plan.rounds), again))
        for count in plan.scans:
            report(f"registering {count} of them together")
            some = given.some(count)
            found = {
                APART: _vertices(apart[:count]),
                CONTROL: _vertices(control[:count]),
                TOGETHER: _together(some, apart[:count], plan.rounds, executor),
            }
            measured = {method: errors(some, V) for method, V in found.items()}
            unseen = 1 - float(some.seen.mean())
            subject = tuple(int(s) for s in some.subject)
            cells.append(Cell(count, holes, unseen, subject, measured))
        example = _example(some, found, measured)
    assert example is not None  # a plan has holes
    return TogetherStudy(plan, tuple(cells), example)


def _vertices(found: Sequence[dict[str, Array]]) -> Array:
    return np.stack([one["vertices"] for one in found])


def _together(
    given: ScannedSet, apart: Sequence[dict[str, Array]], rounds: int, executor: Executor
) -> Array:
    """The registrations (J, N, 3) m of coregistration, from the fits of each scan by itself."""
    fits = [Fitted(one["pose"], one["betas"], one["trans"]) for one in apart]
    by = Coregistration(load_skinned(START), given.scans, CoregistrationPlan(rounds=rounds))
    return by.run(fits, execution=Execution(executor)).vertices


def _example(
    given: ScannedSet, found: dict[str, Array], measured: dict[str, dict[str, list[float]]]
) -> Example:
    gained = np.subtract(measured[CONTROL]["hidden"], measured[TOGETHER]["hidden"])
    row = int(np.argmax(gained))
    shown = {method: V[row] for method, V in found.items() if method != APART}
    return Example(row, given.faces, given.meshes[row], shown)
