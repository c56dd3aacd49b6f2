"""Which solver suits a problem, by what the problem is like at its start.

The rules are those of Nocedal and Wright, Numerical Optimization, 2006, chapters 2, 4, 10 and 18;
the comparisons in `benchmarks/SOLVERS.md` test them.
"""

from dataclasses import dataclass

import numpy as np

from workbench.blocks import Values
from workbench.errors import BadArgument, TooLarge
from workbench.problem import Problem
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
        facts, reasons = ([f"  {one}" for one in some] for some in (self.facts, self.reasons))
        return "\n".join([*facts, f"recommended: {self.solver}", *reasons])


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
    step = np.clip(x + here.step(), problem.lower, problem.upper) - x
    predicted = here.predicted_decrease(step)
    actual = here.cost - half_squared(problem.residual(x + step, fixed))
    gain_ratio = actual / predicted if predicted > 0 and np.isfinite(actual) else 0.0
    rank, condition, known = n, 1.0, "the Jacobian is too large to compute its rank here"
    try:
        lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
        s = here.scaled(1 / lengths).singular_values
        rank, condition = here.rank, float(s[0] / s[-1]) if s[-1] > 0 else np.inf
        known = f"condition number of the Jacobian, columns of length one: {condition:.2g}"
    except TooLarge:
        pass
    if rank < n:
        known = f"the Jacobian has rank {rank:,}: {n - rank:,} directions are undetermined"
    facts = [
        f"{n:,} unknowns, {rows:,} residuals; {density:.0%} of the Jacobian's entries can be "
        "nonzero",
        known,
        f"gain ratio of a Gauss-Newton step: {gain_ratio:.2f} (1: the model is exact)",
    ]
    if bounded:
        facts.append(f"{bounded:,} unknowns are bounded")
    if problem.constraints:
        name, why = "ipopt", ["An interior point method takes constraints and bounds."]
        if problem.has_graph:
            name = "ipopt-exact"
            why.append("The exact Hessian saves iterations if constraints are curved.")
    else:
        name = "trust-region"
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
    return Recommendation(name, tuple(facts), tuple(why))
