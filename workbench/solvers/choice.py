"""Which solver suits a problem, by what the problem is like at its start.

The advice follows rules of the field (Nocedal and Wright, Numerical Optimization, 2006, chapters 2,
4, 10 and 18), which the comparisons in `benchmarks/SOLVERS.md` test.
"""

from dataclasses import dataclass

import numpy as np

from workbench.blocks import Values
from workbench.errors import BadArgument, TooLarge
from workbench.problem import Problem
from workbench.problem.optimality import half_squared

STEEP = 0.25  # gain ratio of a full Gauss-Newton step below which the linear model is not trusted
ILL = 1e6  # condition of the columns of length one


@dataclass(frozen=True)
class ProblemTraits:
    """What a problem is like at its start.

    Attributes:
        unknowns: the number of free numbers.
        residuals: the number of rows.
        density: the share of the Jacobian's entries that are not zero here.
        bounded: how many unknowns have a finite bound.
        equations: the number of constraints with equal limits.
        inequalities: the number of other constraints.
        rank: the numerical rank of the Jacobian; None if it is too large to compute it.
        condition: the condition number of the Jacobian with columns of length one; NaN if it is too
            large to compute it.
        gain_ratio: the gain ratio of a full Gauss-Newton step, 1 if the linear model is exact.
    """

    unknowns: int
    residuals: int
    density: float
    bounded: int
    equations: int
    inequalities: int
    rank: int | None
    condition: float
    gain_ratio: float

    def facts(self) -> list[str]:
        """What the problem is like, in sentences."""
        known = "the Jacobian is too large to compute its rank here"
        if self.rank == self.unknowns:
            known = f"condition number of the Jacobian, columns of length one: {self.condition:.2g}"
        elif self.rank is not None:
            left = f"{self.unknowns - self.rank:,} directions are undetermined"
            known = f"the Jacobian has rank {self.rank:,}: {left}"
        facts = [
            f"{self.unknowns:,} unknowns, {self.residuals:,} residuals; {self.density:.0%} of the "
            "Jacobian's entries can be nonzero",
            known,
            f"gain ratio of a Gauss-Newton step: {self.gain_ratio:.2f} (1: the model is exact)",
        ]
        if self.bounded:
            facts.append(f"{self.bounded:,} unknowns are bounded")
        if self.equations or self.inequalities:
            facts.append(f"{self.equations} equations and {self.inequalities} inequalities")
        return facts


@dataclass(frozen=True)
class Recommendation:
    """A solver for a problem.

    Attributes:
        solver: its name in `SOLVERS`.
        reasons: why, in sentences.
        traits: what the problem is like at its start.
    """

    solver: str
    reasons: tuple[str, ...]
    traits: ProblemTraits

    def __str__(self) -> str:
        facts = (f"  {fact}" for fact in self.traits.facts())
        reasons = (f"  {reason}" for reason in self.reasons)
        return "\n".join([*facts, f"recommended: {self.solver}", *reasons])


def recommend(problem: Problem, start: Values) -> Recommendation:
    """A solver for a problem from a start, with reasons.

    The advice comes from one point, which does not show whether the residual is noisy or has other
    minima. It says where to begin; `workbench compare` decides. Raises BadArgument for a problem
    without unknowns.
    """
    traits = traits_of(problem, start)
    if traits.equations or traits.inequalities:
        name, why = "ipopt", ["An interior point method takes constraints and bounds."]
        if problem.has_graph:
            name = "ipopt-exact"
            why.append("The exact Hessian saves iterations if constraints are curved.")
    else:
        name = "trust-region"
        why = ["The cost is a sum of squares: damped Gauss-Newton steps need few evaluations."]
        if traits.bounded:
            why.append("Its steps are the best ones inside the bounds.")
        if traits.gain_ratio < STEEP:
            why.append("The linear model is wrong about a full step: steps must be limited.")
        elif not traits.bounded:
            why.append("The linear model is right about a full step: gauss-newton works as well.")
        if traits.condition > ILL:
            why.append("Columns of the Jacobian nearly depend on each other: damping helps.")
    if traits.rank is not None and traits.rank < traits.unknowns:
        why.append("Solvers may end at different points: `workbench diagnose` names directions.")
    why.append("No local solver looks for other minima. Start from several places if in doubt.")
    return Recommendation(name, tuple(why), traits)


def traits_of(problem: Problem, start: Values) -> ProblemTraits:
    """What a problem is like at its start. Raises BadArgument for one without unknowns."""
    if not problem.free.size:
        raise BadArgument("no solver is needed: the problem has no unknowns; leave a block free")
    x, fixed = problem.split(start)
    here = problem.linearize_at(x, fixed)
    rows, n = here.shape
    there = problem.stacked_constraints
    equal = 0 if there is None else int(there.equal.sum())
    lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
    rank, condition = None, np.nan
    try:
        values = here.scaled(1 / lengths).singular_values
        rank, condition = here.rank, float(values[0] / values[-1]) if values[-1] > 0 else np.inf
    except TooLarge:
        pass
    step = here.step()
    predicted = here.predicted_decrease(step)
    actual = here.cost - half_squared(problem.residual(x + step, fixed))
    return ProblemTraits(
        unknowns=n,
        residuals=rows,
        density=problem.pattern.nnz / max(rows * n, 1),
        bounded=int((np.isfinite(problem.lower) | np.isfinite(problem.upper)).sum()),
        equations=equal,
        inequalities=0 if there is None else len(there.equal) - equal,
        rank=rank,
        condition=condition,
        gain_ratio=actual / predicted if predicted > 0 and np.isfinite(actual) else 0.0,
    )
