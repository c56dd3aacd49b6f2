"""What every kind of body must keep, and what its arithmetic shares with its graph."""

from collections.abc import Callable
from typing import Any

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.body import Body
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

Array = np.ndarray


def some_arguments(body: Body, seed: int = 0, scale: float = 0.7) -> tuple[Array, Array, Array]:
    """A random pose (K, 3), betas (B,) and translation (3,)."""
    rng = np.random.default_rng(seed)
    pose = rng.normal(scale=scale, size=(body.n_joints, 3))
    return pose, rng.normal(size=body.n_betas), rng.normal(size=3)


def some_values(problem: wb.Problem, seed: int = 1) -> wb.Values:
    """Random values of all blocks of a problem, free or not."""
    rng = np.random.default_rng(seed)
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    return {b.base.name: rng.normal(scale=0.4, size=b.base.shape) for b in blocks}


def assert_bind_pose_leaves_template(body: Body) -> None:
    """Without pose and shape, vertices are the template and joints its weighted means."""
    np.testing.assert_allclose(body.vertices(), body.template, atol=1e-12)
    np.testing.assert_allclose(body.vertices(*body.start().values()), body.template, atol=1e-12)
    np.testing.assert_allclose(body.joints(), body.J_regressor @ body.template, atol=1e-12)


def assert_root_turns_everything_about_pelvis(body: Body) -> None:
    pose, betas, trans = some_arguments(body)
    turn, turned = matrix_from_vector([0.5, -1.0, 2.0]), pose.copy()
    turned[0] = vector_from_matrix(turn @ matrix_from_vector(pose[0]))
    pelvis = body.joints(pose, betas)[0]
    for points in (body.vertices, body.joints):
        expected = (points(pose, betas) - pelvis) @ turn.T + pelvis + trans
        np.testing.assert_allclose(points(turned, betas, trans), expected, atol=1e-12)


def in_symbols(points: wb.Points, values: wb.Values) -> Array:
    """Points (N, 3) at these values, by the graph that CasADi has of them."""
    blocks = points.source.blocks
    numbers = [np.asarray(values[b.name]).reshape(b.symbol_shape[::-1]).T for b in blocks]
    graph = cs.Function("graph", [b.symbol for b in blocks], [points.source.expression])
    return np.asarray(graph(*numbers)).T


def assert_chain_rule_is_graph(problem: wb.Problem, values: wb.Values) -> None:
    """Residual, Jacobian, cost and gradient of the arithmetic are those of the whole graph."""
    x, fixed = problem.split(values)
    r, J = (np.asarray(part) for part in problem.derivative(x, fixed))
    size, largest = np.abs(r).max(), np.abs(J).max()
    alone = problem.residual(x, fixed).copy()
    np.testing.assert_allclose(alone, r.ravel(), rtol=0, atol=1e-11 * size)
    here = problem.linearize_at(x, fixed)
    np.testing.assert_allclose(here.residual, r.ravel(), rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(here.dense, J, rtol=1e-11, atol=1e-11 * largest)
    cost, gradient = problem.cost_and_gradient(x, fixed)
    np.testing.assert_allclose(cost, here.cost, rtol=1e-12)
    np.testing.assert_allclose(gradient, J.T @ r.ravel(), rtol=0, atol=1e-11 * abs(gradient).max())


def said(error: type[Exception], call: Callable[..., Any], *given: Any, **named: Any) -> str:
    """What a call says that is refused by an error of this kind; if it is not, that."""
    try:
        call(*given, **named)
    except error as refused:
        return str(refused)
    return "nothing was refused"
