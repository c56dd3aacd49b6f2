"""The point where a run ended, and what is evaluated there to judge it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field

from workbench.arrays import Array
from workbench.problem import Linearization, Problem
from workbench.problem.rounding import Rounding
from workbench.solvers.solution import Evaluations

WORTH = 10.0  # times the tolerance's share of the cost: a fall by less is none


@dataclass(frozen=True, eq=False)
class EndPoint:
    """The point where a run ended. What is evaluated to judge it is counted apart from the run.

    Attributes:
        problem: the problem that was solved, by `Problem.for_judging`: a metered one counts what
            it is asked, and takes none of these points for the best of the run.
        fixed: its fixed numbers.
        x: (n,) the point.
        here: the linearization there.
        rounding: the rounding errors of the residual there.
        size: (n,) the size of each unknown: its own, or how far it was from x on the way.
        tolerance: the `Problem.optimality` up to which points count as stationary.
        check: called before every evaluation; it raises Stop if nobody wants to wait any longer.
        counts: how often the methods evaluated the problem, by kind.
    """

    problem: Problem
    fixed: Array
    x: Array
    here: Linearization
    rounding: Rounding
    size: Array
    tolerance: float
    check: Callable[[], object]
    counts: dict[str, int] = field(default_factory=lambda: asdict(Evaluations()))

    @property
    def noise(self) -> float:
        """By how much rounding may have changed the cost."""
        return self.rounding.of_cost(self.here.residual)

    @property
    def worth(self) -> float:
        """By how much the cost must fall so that neither rounding nor the tolerance explains it."""
        return self.noise + WORTH * self.tolerance**2 * self.here.cost

    def residual(self, x: Array) -> Array:
        """The residual at another point, (m,)."""
        self._count("residual")
        return self.problem.residual(x, self.fixed)

    def gradient(self, x: Array) -> Array:
        """The gradient of the cost at another point, (n,)."""
        self._count("gradient")
        return self.problem.cost_and_gradient(x, self.fixed)[1]

    def linearize(self, x: Array) -> Linearization:
        """The linearization at another point."""
        self._count("jacobian")
        return self.problem.linearize_at(x, self.fixed)

    def _count(self, kind: str) -> None:
        self.check()
        self.counts[kind] += 1
