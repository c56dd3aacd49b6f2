"""Whether a trial point is linearized at once, instead of after its step has been taken."""

from workbench.problem import Problem, gram
from workbench.problem.steps import automatic, cholesky, sparing
from workbench.solvers.limits import Limits

BY_NORMAL_EQUATIONS = (automatic, cholesky, sparing)
LARGEST = 2**26  # bytes of a Jacobian, of which two are in memory at a time
HIGHER = 1.001  # times the cost: where a trial costs more, its Jacobian is not looked at


class OnePass:
    """Whether a run computes residual, Jacobian and normal equations together, also at trials.

    A trial is expected to be taken unless the one before was refused, or the line search before
    took a later trial than its first.

    Attributes:
        on: whether they are computed together.
        at_once: how many trials were linearized at once.
        saved: how many evaluations of the residual were saved, because such a trial was taken.
    """

    def __init__(self, on: bool) -> None:
        self.on, self.at_once, self.saved = on, 0, 0
        self._refused = self._last_at_once = False
        self._since = 0  # trials since the last that was judged

    def expected(self) -> bool:
        """Whether to linearize the next trial; it counts as refused until it is `judged`."""
        self._last_at_once, self._refused = self.on and not self._refused, True
        self.at_once += self._last_at_once
        self._since += 1
        return self._last_at_once

    def judged(self, taken: bool) -> None:
        """Whether the last trial was taken; a line search says so at the end."""
        self.saved += self._last_at_once and taken
        self._refused = not taken or self._since > 1
        self._last_at_once, self._since = False, 0


def takes_one_pass(solver: Limits, problem: Problem) -> bool:
    """Whether a run computes the normal equations with each Jacobian, and Jacobians of trials.

    So it does where its steps come from normal equations, and where compiled code computes these
    with the gradient and the lengths of columns, instead of one after the other. A posed surface
    and its derivative read the same arrays: to ask for its points first costs a third to a half of
    both.
    """
    by = getattr(solver, "linear_algebra", None)
    return by in BY_NORMAL_EQUATIONS and has_one_pass(problem)


def has_one_pass(problem: Problem) -> bool:
    """Whether compiled code computes the normal equations with the gradient and column lengths."""
    if problem.sparse:
        return False
    m, n = problem.size, problem.free.size
    return gram.worthwhile(m, n) and 8 * m * n <= LARGEST and gram.compiled() is not None
