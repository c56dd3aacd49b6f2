"""The surface of a body with free arrays in numbers: what its graph says, and differences."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.bodies.forward.freed_numbers import BLOCKS, FreedSurface, FreedSurfaceAt

PLAIN = random_body(4, n_vertices=9, n_joints=4, n_betas=2)
BENT = replace(PLAIN, bound_in=np.random.default_rng(1).normal(scale=0.4, size=(4, 3)))
GIVEN = replace(PLAIN, rest_joints=np.random.default_rng(2).normal(size=(4, 3)))
FREE = {
    "all but joints": ("template", "shapedirs", "posedirs", "J_regressor", "weights"),
    "joints": ("template", "posedirs", "weights", "joints"),
    "template alone": ("template",),
    "regressor": ("posedirs", "J_regressor"),
    "where joints are": ("joints", "shapedirs"),
}
CASES = {f"plain, {name}": (PLAIN, free) for name, free in FREE.items()}
CASES |= {f"drawn bent, {name}": (BENT, FREE[name]) for name in ("all but joints", "joints")}
LIMBS = random_body(5, n_vertices=9, n_joints=7, n_betas=2)  # no vertex hangs at all joints
CASES |= {f"limbs, {name}": (LIMBS, FREE[name]) for name in ("regressor", "where joints are")}
CASES["joints given"] = GIVEN, ("template", "shapedirs", "weights")
EACH = pytest.mark.parametrize(("body", "free"), CASES.values(), ids=list(CASES))
CHOSEN = {"all": np.arange(9), "some": np.array([7, 2, 3])}


def values_at(body: wb.SkinnedBody, free: tuple[str, ...], turned: float = 0.8) -> wb.Values:
    rng = np.random.default_rng(0)
    values = {
        "pose": turned * rng.normal(size=(body.n_joints, 3)),
        "betas": rng.normal(size=body.n_betas),
        "trans": rng.normal(size=3),
    }
    return values | {
        name: body.array(name) + 0.1 * rng.normal(size=body.array(name).shape) for name in free
    }


def at(body: wb.SkinnedBody, chosen: np.ndarray, values: wb.Values) -> FreedSurfaceAt:
    return FreedSurface(body, body.kinematics, chosen, {name: name for name in values}).evaluate(
        values
    )


def in_symbols(values: wb.Values, block: wb.Block) -> np.ndarray:
    """As CasADi has it: axes reversed, which is the same memory."""
    return values[block.name].ravel().reshape(block.symbol_shape, order="F")


@EACH
@pytest.mark.parametrize("chosen", CHOSEN.values(), ids=list(CHOSEN))
@pytest.mark.parametrize("turned", [0.0, 0.8])
def test_points_and_derivatives_are_those_of_the_graph(
    body: wb.SkinnedBody, free: tuple[str, ...], chosen: np.ndarray, turned: float
) -> None:
    student, values = body.freed(*free), values_at(body, free, turned)
    blocks = [*student.blocks(), *student.free.values()]
    points = student.points(*(b.symbol for b in blocks[:3]), vertices=chosen)
    column, symbols = cs.vec(points.source.expression), [b.symbol for b in blocks]
    forward = {"helper_options": {"ad_weight": 0}}
    slopes = [cs.jacobian(column, symbol, forward) for symbol in symbols]
    graph = cs.Function("graph", symbols, [column, *slopes])
    expected, *slopes = (np.asarray(a) for a in graph(*(in_symbols(values, b) for b in blocks)))
    here = at(body, chosen, values)
    np.testing.assert_allclose(here.points.ravel(), expected.ravel(), atol=1e-12)
    for block, slope in zip(blocks, slopes, strict=True):
        found = here.jacobian(block.name)
        assert found.shape == slope.shape
        np.testing.assert_allclose(found.toarray(), slope, atol=1e-11)


@EACH
def test_derivatives_are_those_of_differences(body: wb.SkinnedBody, free: tuple[str, ...]) -> None:
    values, h = values_at(body, free), 1e-6
    here = at(body, CHOSEN["some"], values)
    for name, value in values.items():
        slope = here.jacobian(name).toarray()
        for i in range(0, value.size, 5):
            step = np.zeros(value.size)
            step[i] = h
            ends = [
                at(body, CHOSEN["some"], values | {name: value + s * step.reshape(value.shape)})
                for s in (1, -1)
            ]
            difference = (ends[0].points - ends[1].points).ravel() / (2 * h)
            # a central difference loses 1e-16 / h of metres to rounding, and h^2 to curvature
            np.testing.assert_allclose(slope[:, i], difference, atol=1e-7)


@EACH
def test_what_goes_back_is_what_came_forth(body: wb.SkinnedBody, free: tuple[str, ...]) -> None:
    values = values_at(body, free)
    here, rng = at(body, CHOSEN["some"], values), np.random.default_rng(3)
    pull, scale = rng.normal(size=9), rng.normal(size=9)
    into = {name: np.empty((value.size, 9)) for name, value in values.items()}
    here.tangent(into, scale)
    back = here.adjoint(pull * scale)
    assert back.keys() == into.keys()
    for name in into:
        np.testing.assert_allclose(back[name], into[name] @ pull, atol=1e-11)


def test_a_vertex_notices_its_own_numbers_alone() -> None:
    """But for what joints are made from: the derivative is sparse where the model is."""
    values = values_at(PLAIN, FREE["joints"])
    here = at(PLAIN, CHOSEN["all"], values)
    for name, own in (("template", 3), ("posedirs", 3 * 27), ("weights", 4)):
        assert here.jacobian(name).nnz == 27 * own


# In a problem.


def training(body: wb.SkinnedBody, free: tuple[str, ...]) -> wb.Problem:
    """Two people of one body, each in a pose, and ridges on what is free."""
    student, rng, terms = body.freed(*free), np.random.default_rng(5), []
    for person in range(2):
        blocks = student.blocks(f"{person}/")
        points = student.points(*(b.symbol for b in blocks))
        assert points.source.numeric is not None
        data = rng.normal(size=(body.n_vertices, 3))
        terms.append(wb.residuals.vertices(points, data, sigma=0.1, name=f"{person}"))
    for name, block in student.free.items():
        terms.append(wb.residuals.gaussian(block.symbol, covariance=4.0, name=f"ridge of {name}"))
    names = (f"{person}/{b.name}" for person in range(2) for b in body.blocks())
    return wb.Problem(terms, (*names, *student.free))


@pytest.mark.parametrize("free", FREE.values(), ids=list(FREE))
def test_problems_with_free_arrays_go_by_the_chain_rule(free: tuple[str, ...]) -> None:
    problem = training(PLAIN, free)
    x = np.random.default_rng(6).normal(scale=0.5, size=problem.free.size)
    here, none = problem.linearize_at(x, np.zeros(0)), np.zeros(0)
    r, J = (np.asarray(part) for part in problem.derivative(x, none))
    np.testing.assert_allclose(here.residual, r.ravel(), atol=1e-10)
    np.testing.assert_allclose(here.jacobian, J, atol=1e-9)
    cost, gradient = problem.cost_and_gradient(x, none)
    np.testing.assert_allclose(cost, here.cost, rtol=1e-12)
    np.testing.assert_allclose(gradient, here.gradient, atol=1e-8 * np.abs(gradient).max())
    z = x + 0.1 * np.random.default_rng(7).normal(size=(3, len(x)))
    expected = [problem.cost_and_gradient(one, none)[0] for one in z]
    np.testing.assert_allclose(problem.costs(x, none)(z), expected, rtol=1e-10)


@pytest.mark.parametrize("some", [None, [7, 2, 3, 2]], ids=["all vertices", "some"])
@EACH
def test_patterns_are_where_derivatives_are_not_zero(
    body: wb.SkinnedBody, free: tuple[str, ...], some: list[int] | None
) -> None:
    """No fewer entries, at any values; and no more, where all numbers are random."""
    student, rng = body.freed(*free), np.random.default_rng(9)
    blocks = [*student.blocks(), *student.free.values()]
    source = student.points(*(b.symbol for b in blocks[:3]), vertices=some).source.numeric
    assert isinstance(source, FreedSurface)
    values = values_at(body, free)
    full = {name: v if name in BLOCKS else rng.normal(size=v.shape) for name, v in values.items()}
    sparse = set()
    for block in blocks:
        pattern = source.pattern(block.name)
        if pattern is None:
            continue
        sparse.add(block.name)
        there = pattern.toarray() != 0
        np.testing.assert_array_equal(
            source.evaluate(full).jacobian(block.name).toarray() != 0, there
        )
        for at in (values, body.start() | {name: body.array(name) for name in free}):
            assert there[source.evaluate(at).jacobian(block.name).toarray() != 0].all()
    through_regressor = {"template", "shapedirs"} if "J_regressor" in free else set()
    through_weights = {"J_regressor", "joints"} if "weights" in free else set()
    dense = through_weights | through_regressor
    assert sparse == set(free) - dense


def test_a_large_body_with_free_arrays_has_a_small_sparse_derivative() -> None:
    body = random_body(8, n_vertices=700, n_joints=2, n_betas=1)
    student = body.freed("template")
    points = student.points(*(b.symbol for b in student.blocks()))
    term = wb.residuals.vertices(points, body.template + 0.1, sigma=0.1)
    problem = wb.Problem([term], ("template", "pose"))
    values = student.start() | {"pose": np.random.default_rng(0).normal(size=(2, 3))}
    here = problem.linearize(values)
    assert problem.sparse
    assert here.jacobian.nnz < 0.02 * here.jacobian.shape[0] * here.jacobian.shape[1]
    x, fixed = problem.split(values)
    J = problem.derivative(x, fixed)[1].sparse()
    assert abs(here.jacobian - J).max() < 1e-11 * abs(J).max()
