"""Joints, landmarks and constraints by arithmetic: what the whole graph says, and differences."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies_made_up import random_body, smpl_like_body
from tests.problem.test_chain import assert_same, pose_at
from tests.tiers import few
from workbench import residuals
from workbench.blocks import NumericPoints
from workbench.blocks.points import LoopedPoints
from workbench.bodies import Landmarks, SkinnedBody
from workbench.bodies.forward.posed_points import PosedFrames
from workbench.problem import Constraint

FREE = [("trans", "pose", "betas"), ("betas", "trans")]


def with_landmarks(body: SkinnedBody) -> SkinnedBody:
    """Means of many vertices, of one, and with weights that are negative or nearly cancel."""
    N = body.n_vertices
    rows = np.zeros((5, N))
    rows[0] = 1 / N
    rows[1, 3] = 1.0
    rows[2, :3] = 2.0, -3.0, 2.0
    rows[3, [5, 9]] = 0.25, 0.75
    rows[4, :4] = 1.0, -1.0, 1.0, 0.0
    names = ("all", "one", "beyond", "between", "opposed")
    return replace(body, landmarks={"some": Landmarks(names, csr_array(rows))})


BODIES = {
    "24 joints": with_landmarks(smpl_like_body(60, 10)),
    "5 joints": with_landmarks(random_body(1, n_vertices=40, n_joints=5, n_betas=1)),
    "one joint": with_landmarks(random_body(2, n_vertices=20, n_joints=1, n_betas=3)),
    "drawn bent": with_landmarks(
        replace(
            random_body(3, n_vertices=30, n_joints=6, n_betas=2),
            bound_in=np.random.default_rng(0).normal(scale=0.4, size=(6, 3)),
        )
    ),
}
EACH_BODY = pytest.mark.parametrize(
    "body",
    few([pytest.param(body, id=name) for name, body in BODIES.items()], ("5 joints", "drawn bent")),
)
EACH_KIND = pytest.mark.parametrize("kind", ["joints", "some"])


def symbols(body: SkinnedBody) -> list[cs.MX]:
    return [block.symbol for block in body.blocks()]


def values_at(body: SkinnedBody, where: str = "anywhere", seed: int = 0) -> wb.Values:
    rng = np.random.default_rng(seed)
    return {
        "pose": pose_at(where, body.n_joints, rng),
        "betas": rng.standard_normal(body.n_betas),
        "trans": rng.standard_normal(3),
    }


@EACH_BODY
@EACH_KIND
@pytest.mark.parametrize("where", few(("near zero", "anywhere", "pi", "zero"), 1))
@pytest.mark.parametrize("free", few(FREE, 1), ids=str)
def test_joints_and_landmarks_match_the_graph(
    body: SkinnedBody, kind: str, where: str, free: tuple[str, ...]
) -> None:
    points = body.landmark_points(kind, *symbols(body))
    assert points.source.numeric is not None
    rng = np.random.default_rng(1)
    terms = [
        residuals.landmarks(points, rng.normal(size=(points.count, 3)), sigma=0.01),
        wb.Residual("first", points.symbol[:, 0] ** 2, sigma=2.0, unit="m", points=(points,)),
    ]
    assert_same(wb.Problem(terms, free), values_at(body, where))


@EACH_BODY
@EACH_KIND
def test_derivatives_of_landmarks_match_differences(body: SkinnedBody, kind: str) -> None:
    at, h = values_at(body), 1e-6
    numeric = body.landmark_points(kind, *symbols(body)).source.numeric
    assert numeric is not None
    here = numeric.evaluate(at)
    slopes = {name: np.zeros((at[name].size, here.points.size)) for name in numeric.reads}
    here.write_jacobian(slopes, None)
    cotangent = np.random.default_rng(2).standard_normal(here.points.size)
    felt = here.vjp(cotangent)
    for name, value in at.items():
        for i in range(value.size):
            step = np.zeros(value.size)
            step[i] = h
            beyond, before = (
                numeric.evaluate(at | {name: value + sign * step.reshape(value.shape)}).points
                for sign in (1, -1)
            )
            difference = ((beyond - before) / (2 * h)).ravel()
            # a central difference loses 1e-16 / h of metres to rounding, and h^2 to curvature
            np.testing.assert_allclose(slopes[name][i], difference, atol=1e-8)
            np.testing.assert_allclose(felt[name][i], cotangent @ slopes[name][i], atol=1e-11)


def landmarks_of_several(
    body: SkinnedBody, kind: str
) -> tuple[NumericPoints, list[wb.Values], wb.Values]:
    """Landmarks in numbers, the values of five people, and the same values stacked."""
    numeric = body.landmark_points(kind, *symbols(body)).source.numeric
    assert numeric is not None
    each = [values_at(body, "anywhere", seed) for seed in range(5)]
    return numeric, each, {name: np.array([one[name] for one in each]) for name in each[0]}


@EACH_BODY
@EACH_KIND
def test_landmarks_of_many_match_each(body: SkinnedBody, kind: str) -> None:
    numeric, each, together = landmarks_of_several(body, kind)
    expected = [body.landmark(kind, **one) for one in each]
    np.testing.assert_allclose(numeric.evaluate_batch(together), expected, atol=1e-12)
    np.testing.assert_allclose([numeric.evaluate(one).points for one in each], expected, atol=1e-12)


@EACH_BODY
@EACH_KIND
def test_derivatives_of_many_match_each(body: SkinnedBody, kind: str) -> None:
    numeric, each, values = landmarks_of_several(body, kind)
    one_by_one = LoopedPoints([numeric.evaluate(one) for one in each])
    many = numeric.evaluate_each(values, len(each))
    assert isinstance(many, PosedFrames)
    np.testing.assert_allclose(many.points, one_by_one.points, atol=1e-13)
    for some in (slice(0, 5), slice(2, 4)):
        shape = some.stop - some.start, many.points[0].size
        found, expected = (
            {name: np.full((*shape, values[name][0].size), np.nan) for name in numeric.reads}
            for _ in range(2)
        )
        many.write_jacobians(some, found)
        one_by_one.write_jacobians(some, expected)
        for name in numeric.reads:
            np.testing.assert_allclose(found[name], expected[name], atol=1e-12)
    cotangents = np.random.default_rng(2).standard_normal((5, many.points[0].size))
    felt, expected = many.vjps(cotangents), one_by_one.vjps(cotangents)
    for name in numeric.reads:
        np.testing.assert_allclose(felt[name], expected[name], atol=1e-12)


# Constraints.


@pytest.mark.parametrize("made", ["points", "some"])
def test_constraints_of_points_match_the_graph(made: str) -> None:
    body = BODIES["5 joints"]
    at = symbols(body)
    points = body.landmark_points("some", *at) if made == "some" else getattr(body, made)(*at)
    joints = body.joint_points(*at)
    bent = cs.sum1(at[0][0, 1:].T ** 2)
    rules = (
        Constraint("floor", points.symbol[1, :].T, -1.0, points=(points,)),
        Constraint("a sphere", cs.sum1(joints.symbol**2).T, upper=9.0, points=(joints,)),
        Constraint("bent", bent, upper=1.0),
    )
    term = residuals.landmarks(joints, np.zeros((5, 3)), sigma=0.1)
    problem = wb.Problem([term], ("pose", "trans"), constraints=rules)
    x, fixed = problem.split(values_at(body))
    there = problem.stacked_constraints
    assert there is not None
    z, h = cs.MX.sym("z", len(x)), cs.MX.sym("h", len(fixed))
    c = there.function(z, h)
    J = cs.Function("J", [z, h], [c, cs.jacobian(c, z, {"helper_options": {"ad_weight": 0}})])
    expected, slopes = (np.asarray(part) for part in J(x, fixed))
    here = there.linearize(x, fixed)
    np.testing.assert_allclose(here.values, expected.ravel(), atol=1e-12)
    np.testing.assert_allclose(here.jacobian, slopes, atol=1e-11)
    np.testing.assert_allclose(there.values(x, fixed), expected.ravel(), atol=1e-12)
