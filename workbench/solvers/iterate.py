"""One point that a solver visited, and how often the problem was evaluated up to there."""

from dataclasses import astuple, dataclass

from workbench.blocks import Values


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
        return self.residual + self.gradient + self.jacobian + self.hessian

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
        step_norm: the length of the step from the iterate before, in the units of the unknowns.
        damping: the damping after the step, or by how much the Hessian was changed; 0 for solvers
            that have neither.
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
