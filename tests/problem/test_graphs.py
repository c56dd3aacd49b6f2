"""What is symbolic is handed out whole: the obvious calls of CasADi are right on it."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.residuals.test_every_residual import CASES, Case, near
from tests.tiers import THOROUGH, few
from workbench import residuals
from workbench.bodies.triangles.body import blend_scape
from workbench.errors import BadBody, BadResidual, TwoSymbolsOneName
from workbench.residuals import huber

BODY = random_body(4, n_vertices=20, n_joints=4, n_betas=2)
BLOCKS = BODY.blocks()
SYMBOLS = [block.symbol for block in BLOCKS]
FORWARDS, BACKWARDS = ({"helper_options": {"ad_weight": w}} for w in (0.0, 1.0))
DIRECTIONS = pytest.mark.parametrize(
    "options",
    [{}, pytest.param(FORWARDS, marks=THOROUGH), pytest.param(BACKWARDS, marks=THOROUGH)],
    ids=["plain", "forwards", "backwards"],
)


def numbers(expression: cs.MX, blocks: tuple[wb.Block, ...], values: wb.Values) -> np.ndarray:
    function = cs.Function("f", [block.symbol for block in blocks], [expression])
    return np.asarray(function(*(np.asarray(values[block.name]).T for block in blocks)))


def problem() -> wb.Problem:
    mesh = residuals.vertices(BODY.points(*SYMBOLS), BODY.template, sigma=0.1, kernel=huber(1.0))
    joints = residuals.landmarks(BODY.joint_points(*SYMBOLS), BODY.joints(), sigma=0.05)
    return wb.Problem([mesh, joints, residuals.gaussian(SYMBOLS[1])], ("pose", "trans"))


def somewhere(seed: int = 0) -> wb.Values:
    rng = np.random.default_rng(seed)
    return {block.name: rng.normal(scale=0.3, size=block.shape) for block in BLOCKS}


# Right in every direction.


@pytest.mark.parametrize("build", few(CASES, 3), ids=lambda build: build.__name__)
def test_jacobian_of_a_residuals_graph(build: Callable[[], Case]) -> None:
    """By every block that it reads, against central differences."""
    case = build()
    asked = case.problem(case.residual.kernel)
    graph, blocks = case.residual.graph(), asked.free.blocks
    x = near(case, asked, 0)
    for block in blocks:
        J = cs.jacobian(graph, block.symbol)
        J_numbers = numbers(J, blocks, asked.free.unpack(x))
        at = asked.free.slices[block.name]
        for column, i in enumerate(range(at.start, at.stop)):
            step = np.zeros(x.size)
            step[i] = 1e-5 * max(1.0, abs(x[i]))
            after, before = (
                numbers(graph, blocks, asked.free.unpack(x + s * step)).ravel() for s in (1, -1)
            )
            slope = (after - before) / (2 * step[i])
            # of central differences: a third derivative's 1e-10, and eps / 1e-5 of the row's size
            size = 1 + np.abs(after) + np.abs(slope)
            np.testing.assert_allclose(J_numbers[:, column] / size, slope / size, atol=3e-8)


@DIRECTIONS
def test_jacobian_of_a_problems_graph(options: dict) -> None:
    asked, values = problem(), somewhere()
    for block in BLOCKS:
        J_numbers = numbers(cs.jacobian(asked.graph(), block.symbol, options), BLOCKS, values)
        expected = asked.freeing(block.name).linearize(values).jacobian
        np.testing.assert_allclose(J_numbers, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@DIRECTIONS
def test_broadcast_scalars_keep_their_derivatives(options: dict) -> None:
    """A shift that is added to a row, with more unknowns than rows: CasADi goes backwards."""
    x, shift = wb.Block("x", (30,)), wb.Block("shift", ())
    expression = cs.sin(x.symbol[:6]) + shift.symbol
    expression = expression - cs.norm_2(expression) + cs.fmod(3 + shift.symbol, 2 + expression)
    graph = wb.Residual("shifted", expression, 1.0).graph()
    values = {"x": np.linspace(0.1, 0.9, 30), "shift": np.array(0.3)}
    for block in (x, shift):
        right = numbers(cs.jacobian(expression, block.symbol, FORWARDS), (x, shift), values)
        J_numbers = numbers(cs.jacobian(graph, block.symbol, options), (x, shift), values)
        np.testing.assert_allclose(J_numbers, right, atol=1e-13)
    same = numbers(graph, (x, shift), values)
    np.testing.assert_array_equal(same, numbers(expression, (x, shift), values))


# What cannot work says so.


def test_jacobian_of_placeholders_is_refused() -> None:
    residual = problem().residuals[0]
    assert cs.jacobian(residual.expression, SYMBOLS[0]).nnz() == 0  # CasADi cannot know
    with pytest.raises(BadResidual, match=r"placeholder\(vertices\).*would be zero.*graph\(\)"):
        wb.jacobian(residual.expression, SYMBOLS[0])
    with pytest.raises(BadResidual, match=r"not of something of type Residual; take its graph\(\)"):
        wb.jacobian(residual, SYMBOLS[0])  # type: ignore[arg-type]
    with pytest.raises(BadResidual, match="not of something of type ndarray"):
        wb.jacobian(np.zeros(3), SYMBOLS[0])  # type: ignore[arg-type]
    with pytest.raises(TwoSymbolsOneName, match="pose"):
        wb.jacobian(residual.graph(), cs.MX.sym("pose", 3, 4))
    J = wb.jacobian(residual.graph(), BLOCKS[0])
    assert J.nnz() > 0
    assert wb.jacobian(residual.graph(), wb.Block("other", (2,))).nnz() == 0  # it reads none
    bare = cs.sin(SYMBOLS[1]) + SYMBOLS[1][0]
    right = numbers(cs.jacobian(bare, SYMBOLS[1], FORWARDS), BLOCKS, somewhere())
    J_numbers = numbers(wb.jacobian(bare, SYMBOLS[1]), BLOCKS, somewhere())
    np.testing.assert_array_equal(J_numbers, right)


def test_sx_symbols_are_refused_but_graphs_take_them() -> None:
    scalars = [cs.SX.sym(b.name, *b.symbol_shape) for b in BLOCKS]
    for ask in (BODY.points, BODY.joint_points, blend_scape(wb.load_body("small")).points):
        with pytest.raises(BadBody, match=r"a symbol for pose, .* type SX; .*points\.graph\(\)"):
            ask(*scalars)
    pose, betas, trans = SYMBOLS
    points = BODY.points(pose, betas, trans)
    expression = cs.Function("f", [pose, betas, trans], [points.graph()])(*scalars)
    assert isinstance(expression, cs.SX)
    values = somewhere()
    at = cs.Function("at", scalars, [expression, cs.jacobian(cs.vec(expression), scalars[0])])
    vertices, J = at(*(values[block.name].T for block in BLOCKS))
    np.testing.assert_allclose(np.asarray(vertices).T, BODY.vertices(*values.values()), atol=1e-12)
    expected = numbers(cs.jacobian(cs.vec(points.graph()), pose), BLOCKS, values)
    np.testing.assert_allclose(np.asarray(J), expected, atol=1e-12)
