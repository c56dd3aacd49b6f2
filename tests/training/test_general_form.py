"""Training as a fit with other names free: what it finds, what it cannot, and its gradient.

Phi = argmin over Phi of sum_j min over theta_j, beta_j (lecture 5.1), as a `Problem` in which the
arrays of a tiny body are free as well; `training.blocks` does the same for thousands of vertices.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import LevenbergMarquardt, Values, diagnose, solve
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.problem import Problem
from workbench.residuals import gaussian, vertices
from workbench.solvers import Solver


@dataclass(frozen=True, eq=False)
class GeneralForm:
    """The problem over Phi and everybody's theta and beta.

    Attributes:
        problem: in which all are free.
        start: a value of each name.
        shared: the names of Phi.
        own: the names of everybody's theta, beta and trans.
    """

    problem: Problem
    start: Values
    shared: tuple[str, ...]
    own: tuple[str, ...]

    def inner(self, values: Values, solver: Solver | None = None) -> Values:
        """The minimum over theta and beta at fixed Phi, beginning at the given values."""
        chosen = LevenbergMarquardt(gradient_tolerance=1e-12) if solver is None else solver
        return values | chosen.solve(self.problem.freeing(*self.own), values).values

    def projected(self, values: Values) -> tuple[float, Values]:
        """min over theta, beta of the cost at this Phi, and its gradient by Phi.

        The minimum moves with Phi, but to first order that costs nothing: the gradient is the
        partial one, at the inner minimum (envelope theorem; Golub and Pereyra 2003).
        """
        at = self.inner(values)
        outer = self.problem.freeing(*self.shared)
        cost, slope = outer.cost_and_gradient(*outer.split(at))
        return cost, outer.free.unpack(slope)


def general_form(
    body: SkinnedBody,
    meshes: Sequence[Array],
    *,
    freed: Sequence[str] = ("template",),
    sigma: float = 0.002,
    shape_sigma: float = 1.0,
) -> GeneralForm:
    """The general form of meshes (N, 3) m of different people, and a body whose arrays are freed.

    Blocks are called `scan 0/pose`, `scan 0/betas`, `scan 0/trans` and so on; betas are ordinary
    at `shape_sigma` standard deviations, infinite for no prior. Raises UnknownName for an array
    that cannot be freed.
    """
    learning = body.freed(*freed)
    residuals, start = [], learning.start()
    shared = tuple(block.name for block in learning.free.values())
    start = {name: start[name] for name in shared}
    own: list[str] = []
    for j, mesh in enumerate(meshes):
        prefix = f"scan {j}/"
        blocks = learning.blocks(prefix)
        symbols = [block.symbol for block in blocks]
        points = learning.points(*symbols)
        residuals.append(vertices(points, mesh, sigma=sigma, name=f"scan {j}"))
        if isfinite(shape_sigma) and body.n_betas:
            prior = gaussian(symbols[1], covariance=shape_sigma**2, name=f"shape {j}")
            residuals.append(prior)
        of_scan = learning.start(prefix)
        start |= {block.name: of_scan[block.name] for block in blocks}
        start[f"{prefix}trans"] = mesh.mean(axis=0) - body.template.mean(axis=0)
        own += [block.name for block in blocks]
    return GeneralForm(Problem(residuals, (*shared, *own)), start, shared, tuple(own))


BODY = random_body(2, n_vertices=12, n_joints=3, n_betas=2)
RNG = np.random.default_rng(0)
N_SCANS = 6
MESHES = BODY.vertices(
    0.4 * RNG.normal(size=(N_SCANS, 3, 3)),
    RNG.normal(size=(N_SCANS, 2)),
    0.1 * RNG.normal(size=(N_SCANS, 3)),
)
WRONG = replace(BODY, template=BODY.template + 0.02 * RNG.normal(size=(12, 3)))
PRECISE = LevenbergMarquardt(gradient_tolerance=1e-12)


@pytest.mark.thorough
def test_shape_prior_fixes_the_mean() -> None:
    form = general_form(WRONG, list(MESHES))
    solution = solve(form.problem, form.start, PRECISE)
    found = diagnose(form.problem, form.start | solution.values)
    assert len(found.null_directions) == 3  # it still does not matter where the template stands
    for direction in found.null_directions:
        assert "template" in direction.name


def test_gradient_of_the_minimum_is_the_partial_one() -> None:
    """Envelope theorem: the derivative of min over theta, beta by differences."""
    form = general_form(WRONG, list(MESHES[:3]), sigma=0.05)
    at = form.inner(form.start)
    cost, slope = form.projected(at)
    assert cost > 1e-3
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(12, 3))
    h = 1e-5
    ahead, behind = (
        form.projected(at | {"template": at["template"] + s * direction})[0] for s in (h, -h)
    )
    expected = (ahead - behind) / (2 * h)
    assert np.vdot(slope["template"], direction) == pytest.approx(expected, rel=1e-5)
    inner = form.problem.freeing(*form.own)
    _, rest = inner.cost_and_gradient(*inner.split(at))
    assert np.abs(rest).max() < 1e-6 * np.abs(slope["template"]).max()
