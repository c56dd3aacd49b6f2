"""When is it worth registering scans together?

    python -m examples.studies.coregistration [--scans 12 24 48] [--workers 2] ...

Scans of simulated people are registered one by one, in as many rounds as coregistration has, and
together. The question is how accurate registrations are, and not whether they find the person:
they begin 0.03 rad per angle and 10 mm from the truth. It takes half an hour of one core.
"""

from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from examples.studies.output import Report, arguments, report, write_study
from examples.studies.simulated_scans import START, Apart, errors, ratio, scanned_set
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.plots.palette import LINES, MARKERS
from workbench.registration.coregistration import Coregistration, CoregistrationPlan, Fitted
from workbench.reports.page import Columns, Table
from workbench.training.execution import Execution, Executor, Processes

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
        workers: processes that register scans side by side.
        seed: of every draw.
    """

    scans: tuple[int, ...] = (12, 24, 48)
    holes: tuple[int, ...] = (0, 12, 24)
    people: int = 6
    rounds: int = 4
    workers: int = 1
    seed: int = 400

    def __post_init__(self) -> None:
        if self.people < 2 or self.rounds < 1 or self.workers < 1:
            raise BadArgument("the study takes two people, one round and one worker, or more")
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
            `simulated_scans.errors`, in mm.
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


def together_study(plan: TogetherPlan, executor: Executor, report: Report) -> list[Cell]:
    """Simulate the scans, register them in each way, and measure: a cell for each set.

    Registering by itself does not depend on the other scans, so that each scan is registered once
    for every number of holes.
    """
    cells: list[Cell] = []
    for holes in plan.holes:
        report(f"simulating {plan.scans[-1]} scans with {holes} holes in each")
        simulated = scanned_set(plan.seed, plan.people, plan.scans[-1], holes)
        report("registering each by itself")
        jobs = [(simulated.scans, j, start) for j, start in enumerate(simulated.starts)]
        apart = list(executor(Apart(0), jobs))
        again = [(simulated.scans, j, values) for j, values in enumerate(apart)]
        control = list(executor(Apart(plan.rounds), again))
        for count in plan.scans:
            report(f"registering {count} of them together")
            some = simulated.some(count)
            coregistration = Coregistration(
                load_skinned(START), some.scans, CoregistrationPlan(rounds=plan.rounds)
            )
            fits = [Fitted(one["pose"], one["betas"], one["trans"]) for one in apart[:count]]
            vertices = {
                APART: np.stack([one["vertices"] for one in apart[:count]]),
                CONTROL: np.stack([one["vertices"] for one in control[:count]]),
                TOGETHER: coregistration.run(fits, execution=Execution(executor)).vertices,
            }
            measured = {method: errors(some, V) for method, V in vertices.items()}
            subject = tuple(int(s) for s in some.subject)
            cells.append(Cell(count, holes, 1 - float(some.seen.mean()), subject, measured))
    return cells


def plot_hidden(plan: TogetherPlan, cells: list[Cell], *, ax: Axes) -> Axes:
    """The error of hidden vertices against the number of scans: apart dashed, together solid."""
    for k, holes in enumerate(plan.holes):
        for method, line in ((CONTROL, "--"), (TOGETHER, "-")):
            means = [cell.mean(method, "hidden") for cell in cells if cell.holes == holes]
            label = f"{holes} holes" if method == TOGETHER else None
            at = range(len(means))
            ax.plot(at, means, line, color=LINES[k], marker=MARKERS[k], label=label)
    ax.set_xticks(range(len(plan.scans)), [str(n) for n in plan.scans])
    ax.set_xlabel(f"number of scans, of {plan.people} people")
    ax.set(ylabel="mean error of hidden vertices (mm)", ylim=(0, None))
    ax.legend(loc="lower left")
    return ax


def table(cells: list[Cell]) -> Table:
    """The sets in numbers."""
    columns: Columns[Cell] = {
        "holes": lambda c: str(c.holes),
        "scans": lambda c: str(c.scans),
        "vertices hidden": lambda c: f"{c.unseen:.0%}",
        "hidden, apart": lambda c: f"{c.mean(CONTROL, 'hidden'):.2f}",
        "together": lambda c: f"{c.mean(TOGETHER, 'hidden'):.2f}",
        "together / apart": lambda c: "{:.2f} ({:.2f} to {:.2f})".format(*c.share("hidden")),
        "seen, apart": lambda c: f"{c.mean(CONTROL, 'seen'):.2f}",
        "seen, together": lambda c: f"{c.mean(TOGETHER, 'seen'):.2f}",
    }
    return Table.of(cells, columns, tuple(range(len(columns))))


def main() -> None:
    """Carry out the study and write its folder."""
    plan, chosen = arguments(TogetherPlan, __doc__)
    cells = together_study(plan, Processes(plan.workers), report)
    data = {
        "kind": "together",
        "name": "together",
        "plan": asdict(plan),
        "sets": [asdict(cell) for cell in cells],
    }
    figures = {"hidden": (6.4, 4.6, partial(plot_hidden, plan, cells))}
    write_study(chosen.out / "together", [table(cells)], data, figures)


if __name__ == "__main__":
    main()
