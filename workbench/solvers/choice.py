"""Which solver suits a problem, by what the problem is like at its start.

The rules are those of Nocedal and Wright, Numerical Optimization, 2006, chapters 2, 4, 10 and 18;
the comparisons in `benchmarks/SOLVERS.md` test them.
"""

import textwrap
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument, TooLarge
from workbench.problem import Linearization, Problem
from workbench.problem.optimality import half_squared

LEAST_GAIN = 0.25  # gain ratio of a full Gauss-Newton step: below, the model is not trusted
ILL_CONDITIONED = 1e6  # condition number of the Jacobian, columns of length one


@dataclass(frozen=True)
class Recommendation:
    """A solver for a problem.

    Attributes:
        solver: its name in `SOLVERS`.
        facts: what the problem is like at its start, in sentences.
        reasons: why this solver, in sentences.
    """

    solver: str
    facts: tuple[str, ...]
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        facts, reasons = (textwrap.indent("\n".join(t), "  ") for t in (self.facts, self.reasons))
        return f"{facts}\nrecommended: {self.solver}\n{reasons}"


def recommend(problem: Problem, start: Values) -> Recommendation:
    """A solver for a problem from a start, with reasons.

    The advice comes from one point, which does not show whether the residual is noisy or has other
    minima. It says where to begin; `workbench compare` decides. Raises BadArgument for a problem
    without unknowns.
    """
    if not problem.free.size:
        raise BadArgument("no solver is needed: the problem has no unknowns; leave a block free")
    x, fixed = problem.split(start)
    x = np.clip(x, problem.lower, problem.upper)
    here = problem.linearize_at(x, fixed)
    rows, n = here.shape
    bounded = int((np.isfinite(problem.lower) | np.isfinite(problem.upper)).sum())
    density = problem.pattern.nnz / max(rows * n, 1)
    gain_ratio = _gain_ratio(problem, x, fixed, here)
    rank, condition, conditioning = n, 1.0, "the Jacobian is too large to compute its rank here"
    try:
        s = here.scaled(1 / here.lengths).singular_values
        rank, condition = here.rank, float(s[0] / s[-1]) if s[-1] > 0 else np.inf
        conditioning = f"condition number of the Jacobian, columns of length one: {condition:.2g}"
    except TooLarge:
        pass
    if rank < n:
        conditioning = f"the Jacobian has rank {rank:,}: {n - rank:,} directions are undetermined"
    facts = [
        f"{n:,} unknowns, {rows:,} residuals; {density:.0%} of the Jacobian's entries can be "
        "nonzero",
        conditioning,
        f"gain ratio of a Gauss-Newton step: {gain_ratio:.2f} (1: the model is exact)",
    ]
    if bounded:
        facts.append(f"{bounded:,} unknowns are bounded")
    if problem.constraints:
        solver, why = "ipopt", ["An interior point method takes constraints and bounds."]
        if problem.has_graph:
            solver = "ipopt-exact"
            why.append("The exact Hessian saves iterations if constraints are curved.")
    else:
        solver = "trust-region"
        why = ["The cost is a sum of squares: damped Gauss-Newton steps need few evaluations."]
        if bounded:
            why.append("Its steps are the best ones inside the bounds.")
        if gain_ratio < LEAST_GAIN:
            why.append("The linear model is wrong about a full step: steps must be limited.")
        elif not bounded:
            why.append("The linear model is right about a full step: gauss-newton works as well.")
        if condition > ILL_CONDITIONED:
            why.append("Columns of the Jacobian nearly depend on each other: damping helps.")
    if rank < n:
        why.append("Solvers may end at different points: `workbench diagnose` names directions.")
    why.append("No local solver looks for other minima. Start from several places if in doubt.")
    return Recommendation(solver, tuple(facts), tuple(why))


def _gain_ratio(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float:
    """The actual decrease of the cost by a Gauss-Newton step, over the predicted one."""
    step = np.clip(x + here.step(), problem.lower, problem.upper) - x
    predicted = here.predicted_decrease(step)
    actual = here.cost - half_squared(problem.residual(x + step, fixed))
    return actual / predicted if predicted > 0 and np.isfinite(actual) else 0.0
