"""Small problems that every solver is asked to solve."""

import casadi as cs
import numpy as np

from tests.bodies_made_up import random_body
from workbench import Block, Problem, Residual, Values, residuals
from workbench.problem.problem import Bounds

TEN = (  # what is promised of every solver is asked of these by default
    "trust-region",
    "levenberg-marquardt",
    "dogleg",
    "gauss-newton",
    "newton",
    "ipopt",
    "sqp",
    "scipy-trf",
    "nlopt-lbfgs",
    "nlopt-bobyqa",
)
T = np.linspace(0, 3, 15)
TRUTH = np.array([2.0, 1.3, 0.5])


def decay(noise: float = 0.05, bounds: Bounds | None = None) -> tuple[Problem, Values]:
    """a exp(-b t) + c through noisy points: a nonlinear regression."""
    x, y = Block("x", (3,)).symbol, Block("y", (15,)).symbol
    residual = Residual("decay", x[0] * cs.exp(-x[1] * T) + x[2] - y, sigma=0.05)
    observed = TRUTH[0] * np.exp(-TRUTH[1] * T) + TRUTH[2]
    observed += noise * np.random.default_rng(0).normal(size=15)
    return Problem((residual,), ("x",), bounds), {"x": np.array([1.0, 0.5, 0.0]), "y": observed}


def body_fit() -> tuple[Problem, Values]:
    """Noisy vertices of a small body, with a prior on pose and shape."""
    body = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (15, 3), "m").symbol
    rng = np.random.default_rng(1)
    truth = 0.3 * rng.normal(size=(3, 3)), rng.normal(size=2), np.array([0.1, 0.2, -0.1])
    problem = Problem(
        (
            residuals.vertices(body.points(*symbols), observed, sigma=0.02),
            residuals.gaussian(symbols[0], covariance=0.25),
            residuals.gaussian(symbols[1]),
        ),
        ("pose", "betas", "trans"),
    )
    noisy = body.vertices(*truth) + 0.02 * rng.normal(size=(15, 3))
    return problem, body.start() | {"observed": noisy}


def rosenbrock(scale: float = 1.0) -> tuple[Problem, Values]:
    """A curved valley; `scale` is the unit of the second unknown."""
    x = Block("x", (2,)).symbol
    y = x[1] / scale
    valley = Residual("valley", cs.vertcat(10 * (y - x[0] ** 2), 1 - x[0]), 1.0)
    return Problem((valley,), ("x",)), {"x": np.array([-1.2, scale])}


def line() -> tuple[Problem, Values]:
    """A linear problem, and a start far away."""
    A = np.random.default_rng(2).normal(size=(8, 3))
    residual = Residual("line", A @ Block("x", (3,)).symbol - np.arange(8.0), 1.0)
    return Problem((residual,), ("x",)), {"x": np.array([100.0, -50.0, 3.0])}


def root_of_minus_one() -> tuple[Problem, Values]:
    """Not a number, from the start."""
    residual = Residual("root", cs.sqrt(Block("x").symbol), 1.0)
    return Problem((residual,), ("x",)), {"x": np.array(-1.0)}
