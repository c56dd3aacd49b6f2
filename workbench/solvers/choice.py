"""Which solver suits a problem, by what the problem is like at its start.

The advice follows rules of the field (Nocedal and Wright, Numerical Optimization, 2006, chapters 2,
4, 10 and 18), which the comparisons in `benchmarks/SOLVERS.md` test.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Linearization, Problem

MANY = 1000  # unknowns above which dense linear algebra dominates a step
STEEP = 0.25  # gain ratio of a full Gauss-Newton step below which the linear model is not trusted
ILL = 1e6  # condition of the columns of length one


@dataclass(frozen=True)
class Temperament:
    """What a problem is like at its start.

    Attributes:
        unknowns: the number of free numbers.
        residuals: the number of rows.
        density: the share of the Jacobian's entries that are not zero here.
        bounded: how many unknowns have a finite bound.
        equations: the number of constraints with equal limits.
        inequalities: the number of other constraints.
        rank: the numerical rank of the Jacobian.
        condition: the condition number of the Jacobian with columns of length one.
        gain_ratio: the gain ratio of a full Gauss-Newton step, 1 if the linear model is exact.
    """

    unknowns: int
    residuals: int
    density: float
    bounded: int
    equations: int
    inequalities: int
    rank: int
    condition: float
    gain_ratio: float

    def facts(self) -> Iterator[str]:
        """What the problem is like, in sentences."""
        yield (
            f"{self.unknowns:,} unknowns, {self.residuals:,} residuals; {self.density:.0%} of the "
            "Jacobian's entries can be nonzero"
        )
        if self.bounded:
            yield f"{self.bounded:,} unknowns are bounded"
        if self.equations or self.inequalities:
            yield f"{self.equations} equations and {self.inequalities} inequalities constrain it"
        if self.rank < self.unknowns:
            free = self.unknowns - self.rank
            yield f"the Jacobian has rank {self.rank:,}: {free:,} directions are undetermined"
        else:
            yield (
                f"condition number of the Jacobian with columns of length one: {self.condition:.2g}"
            )
        yield (
            f"gain ratio of a Gauss-Newton step: {self.gain_ratio:.2f} "
            "(1: the linear model is exact)"
        )


@dataclass(frozen=True)
class Recommendation:
    """A solver for a problem.

    Attributes:
        solver: its name in `SOLVERS`.
        reasons: why, in sentences.
        others: names of solvers worth comparing it with.
        temperament: what the problem is like at its start.
    """

    solver: str
    reasons: tuple[str, ...]
    others: tuple[str, ...]
    temperament: Temperament

    def __str__(self) -> str:
        lines = [*(f"  {fact}" for fact in self.temperament.facts()), f"recommended: {self.solver}"]
        lines += [f"  {reason}" for reason in self.reasons]
        return "\n".join([*lines, f"compare with: {', '.join(self.others)}"])


def recommend(problem: Problem, start: Values) -> Recommendation:
    """A solver for a problem from a start, with reasons.

    The advice comes from one point, which does not show whether the residual is noisy or has other
    minima. It says where to begin; `workbench compare` decides.
    """
    found = temperament(problem, start)
    if found.equations or found.inequalities:
        name, others, reasons = _constrained(problem.has_graph)
    else:
        name, others, reasons = _least_squares(found)
    if found.rank < found.unknowns:
        reasons.append(
            "The residuals leave some directions undetermined, so that solvers end at different "
            "points. `workbench diagnose` names these directions."
        )
    reasons.append("No local solver looks for other minima. Start from several places if in doubt.")
    return Recommendation(name, tuple(reasons), others, found)


def _constrained(drawn: bool) -> tuple[str, tuple[str, ...], list[str]]:
    reasons = ["An interior point method takes equations, inequalities and bounds."]
    if not drawn:
        return "ipopt", ("sqp", "nlopt-slsqp"), reasons
    reasons.append("The exact Hessian saves iterations if constraints are curved.")
    return "ipopt-exact", ("ipopt", "sqp"), reasons


def _least_squares(found: Temperament) -> tuple[str, tuple[str, ...], list[str]]:
    reasons = ["The cost is a sum of squares, and damped Gauss-Newton steps need few evaluations."]
    others: tuple[str, ...] = ("dogleg", "scipy-trf", "ipopt")
    if found.bounded:
        reasons.append(
            "It projects its steps on the bounds. Gauss-Newton and dogleg cannot keep bounds."
        )
        others = ("scipy-trf", "ipopt")
    if found.unknowns > MANY:
        reasons.append("It uses the sparsity of the Jacobian, which NLopt's algorithms do not.")
        others = ("ipopt", "scipy-trf")
    if found.gain_ratio < STEEP:
        reasons.append(
            "The linear model is wrong about a full Gauss-Newton step: steps must be limited."
        )
    elif not found.bounded:
        reasons.append(
            "The linear model is right about a full step, so that gauss-newton works as well."
        )
        others = ("gauss-newton", *others)
    if found.condition > ILL:
        reasons.append(
            "Columns of the Jacobian nearly depend on each other. Damping keeps the steps short."
        )
    return "trust-region", others, reasons


def temperament(problem: Problem, start: Values) -> Temperament:
    """What a problem is like at its start."""
    x, fixed = problem.split(start)
    here = problem.linearize_at(x, fixed)
    rows, n = here.shape
    kept = problem.stacked_constraints
    equal = 0 if kept is None else int(kept.equal.sum())
    lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
    values = here.scaled(1 / lengths).singular_values
    return Temperament(
        unknowns=n,
        residuals=rows,
        density=problem.pattern.nnz / (rows * n),
        bounded=int((np.isfinite(problem.lower) | np.isfinite(problem.upper)).sum()),
        equations=equal,
        inequalities=0 if kept is None else len(kept.equal) - equal,
        rank=here.rank,
        condition=float(values[0] / values[-1]) if values[-1] > 0 else np.inf,
        gain_ratio=_gain_ratio(problem, x, fixed, here),
    )


def _gain_ratio(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float:
    """The actual decrease of the cost over the predicted one, for a full Gauss-Newton step."""
    step = here.step()
    new = problem.residual(x + step, fixed)
    predicted = here.predicted_decrease(step)
    actual = here.cost - 0.5 * float(new @ new)
    return actual / predicted if predicted > 0 and np.isfinite(actual) else 0.0
