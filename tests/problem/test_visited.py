"""The points at the last two places are not computed again."""

from collections.abc import Mapping

import numpy as np

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.arrays import Array
from workbench.blocks import PointsAt
from workbench.problem.chain import Chain


class Counting:
    """A source of points that counts how often it is evaluated."""

    def __init__(self, source: object) -> None:
        self.source, self.times = source, 0

    def evaluate(self, values: Mapping[str, Array]) -> PointsAt:
        self.times += 1
        return self.source.evaluate(values)  # type: ignore[attr-defined, no-any-return]


def test_the_last_two_places_are_kept_and_no_more() -> None:
    body = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
    points = body.points(*(block.symbol for block in body.blocks()))
    fit = wb.residuals.vertices(points, body.vertices() + 0.01, sigma=0.01)
    problem = wb.Problem([fit], free=("pose", "betas", "trans"))
    chain = problem._chain
    assert isinstance(chain, Chain)
    visited = chain._visited
    source = Counting(visited._sources[0])
    visited._sources = (source,)  # type: ignore[assignment]
    x, fixed = problem.split(body.start())
    here, trial, further = x, x + 0.1, x + 0.2
    r = problem.residual(here, fixed)
    there = problem.linearize_at(trial, fixed)
    assert source.times == 2
    problem.rounding(here, fixed, r)
    np.testing.assert_array_equal(problem.residual(here, fixed), r)
    np.testing.assert_array_equal(problem.residual(trial, fixed), there.residual)
    assert source.times == 2
    problem.residual(further, fixed)  # in place of the one that was first evaluated
    problem.residual(trial, fixed)
    assert source.times == 3
    np.testing.assert_array_equal(problem.residual(here, fixed), r)
    assert source.times == 4
