"""Points of a body: which vertices, of what symbols, and without building what nobody asks for."""

from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies_made_up import random_body, smpl_like_body
from workbench.bodies.forward import surface
from workbench.errors import BadBody

BODY = replace(
    random_body(),
    landmarks={"face": wb.Landmarks(("nose", "eye"), csr_array(np.eye(2, 30)))},
)
SYMBOLS = tuple(block.symbol for block in BODY.blocks())


def seen(points: wb.Points) -> np.ndarray:
    f = cs.Function("f", list(SYMBOLS), [points.source.expression])
    return np.asarray(f(np.full((3, 5), 0.1), np.ones(3), np.zeros(3))).T


# Which vertices.


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ([3, 1, 1], [3, 1, 1]),
        (range(0, 30, 7), [0, 7, 14, 21, 28]),
        (np.array([29, 0], dtype=np.uint8), [29, 0]),
        (np.arange(30) % 10 == 4, [4, 14, 24]),
        (np.zeros(30, dtype=bool), []),
        ([], []),
        (np.ones(30, dtype=bool).tolist(), list(range(30))),
    ],
    ids=["list", "range", "unsigned", "mask", "none of a mask", "none", "list of bools"],
)
def test_vertices_are_chosen_by_number_or_by_mask(chosen: Any, expected: list[int]) -> None:
    points = BODY.points(*SYMBOLS, vertices=chosen)
    assert points.count == len(expected)
    assert points.labels == tuple(f"vertex {i}" for i in expected)
    np.testing.assert_array_equal(seen(points), seen(BODY.points(*SYMBOLS))[expected])


@pytest.mark.parametrize(
    ("chosen", "text"),
    [
        ([0, -1], "there is no vertex -1; body 'made-up' has vertices 0 to 29"),
        ([2, 30, 31], "there is no vertex 30; body 'made-up' has vertices 0 to 29"),
        ([1.0, 2.0], r"choose some by a list of whole numbers, or by a mask of shape \(30,\)"),
        (np.ones(29, dtype=bool), r"not by an array of bool of shape \(29,\)"),
        (np.ones((30, 1), dtype=bool), r"not by an array of bool of shape \(30, 1\)"),
        ([[0, 1]], r"not by an array of int64 of shape \(1, 2\)"),
        (3, r"not by an array of int64 of shape \(\)"),
        (["nose"], "vertices must be .*, not text; body 'made-up' has vertices 0 to 29"),
        (slice(3), "vertices must be .*, not something of type slice; body"),
        ([[0], [1, 2]], "vertices must be .*, not rows of different lengths"),
    ],
)
def test_vertices_that_are_not_there_are_refused(chosen: Any, text: str) -> None:
    with pytest.raises(BadBody, match=text):
        BODY.points(*SYMBOLS, vertices=chosen)


# Of what symbols.


@pytest.mark.parametrize("which", range(3))
@pytest.mark.parametrize("made", ["points", "joint_points", "landmark_points"])
def test_a_symbol_of_the_wrong_shape_is_named(made: str, which: int) -> None:
    name, needed = [("pose", (3, 5)), ("betas", (3, 1)), ("trans", (3, 1))][which]
    symbols = list(SYMBOLS)
    symbols[which] = cs.MX.sym("wrong", 7, 2)
    needed_and_found = rf"of shape \({needed[0]}, {needed[1]}\) for {name}, not \(7, 2\)"
    arguments = ("face",) if made == "landmark_points" else ()
    with pytest.raises(BadBody, match=f"body 'made-up' takes a symbol {needed_and_found}; take"):
        getattr(BODY, made)(*arguments, *symbols)


@pytest.mark.parametrize("wrong", [np.zeros((5, 3)), BODY.blocks()[0], cs.SX.sym("pose", 3, 5)])
def test_what_is_no_symbol_is_refused(wrong: Any) -> None:
    kind = type(wrong).__name__
    with pytest.raises(BadBody, match=f"a symbol for pose, not something of type {kind}; take"):
        BODY.points(wrong, *SYMBOLS[1:])


# How many, and of which blocks, without the expression.


def all_points(body: wb.SkinnedBody, prefix: str = "") -> tuple[wb.Points, ...]:
    symbols = [block.symbol for block in body.blocks(prefix)]
    return (
        body.points(*symbols),
        body.points(*symbols, vertices=[4, 2]),
        body.joint_points(*symbols),
        body.landmark_points("face", *symbols),
    )


@pytest.mark.parametrize(
    "free",
    [(), ("template",), ("shapedirs",), ("posedirs",), ("J_regressor",), ("weights",)],
    ids=str,
)
def test_count_and_blocks_are_those_of_the_expression(free: tuple[str, ...]) -> None:
    for points in all_points(BODY.freed(*free)):
        said = {block.name for block in points.source.blocks}
        expression = points.source.expression
        assert said == {symbol.name() for symbol in cs.symvar(expression)}
        assert expression.shape == points.symbol.shape == (3, points.count)


def test_blocks_of_pieces_are_what_the_pieces_are_of() -> None:
    whole = wb.Block("both", (4, 3), "rad")
    pose = cs.horzcat(whole.symbol, cs.MX.zeros(3, 1))
    points = BODY.points(pose, *SYMBOLS[1:])
    assert [block.name for block in points.source.blocks] == ["both", "betas", "trans"]
    assert points.source.numeric is not None
    tree = points.source.tree
    assert tree is not None
    assert tree.places == (("both", 0), ("both", 3), ("both", 6), ("both", 9), None)
    bent = BODY.points(cs.sin(pose), *SYMBOLS[1:]).source
    assert bent.tree is None
    assert bent.numeric is None


def tiled(N: int) -> wb.SkinnedBody:
    """A body of N vertices, the small one's again and again."""
    small = wb.load_body("small")
    names = ("template", "shapedirs", "posedirs", "weights")
    arrays = {n: np.resize(getattr(small, n), (N, *getattr(small, n).shape[1:])) for n in names}
    J = small.J_regressor
    face = wb.Landmarks(("nose", "eye"), csr_array(np.eye(2, N)))
    return replace(
        small,
        **arrays,
        J_regressor=csr_array((J.data, J.indices, J.indptr), shape=(small.n_joints, N)),
        mirror=None,
        landmarks={"face": face},
    )


def test_a_large_mesh_is_linearized_without_its_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    body, rng = tiled(100_000), np.random.default_rng(0)
    observed = wb.Block("observed", (body.n_vertices, 3), "m").symbol

    def built(*_: object) -> None:
        raise AssertionError("the graph of the whole mesh was built")

    monkeypatch.setattr(surface, "posed", built)
    symbols = [block.symbol for block in body.blocks()]
    points, some, _, face = all_points(body)
    terms = (
        wb.residuals.vertices(points, observed, sigma=0.002),
        wb.residuals.vertices(some, rng.normal(size=(2, 3)), sigma=0.01),
        wb.residuals.landmarks(face, rng.normal(size=(2, 3)), sigma=0.01),
        wb.residuals.gaussian(symbols[1], name="shape prior"),
    )
    problem = wb.Problem(terms, ("pose", "betas", "trans"))
    assert problem.row_label(3 * 100_000) == f"{terms[1].name}[vertex 4, x]"
    assert [tree.pose for tree in problem.trees] == ["pose"]
    target = body.template + 0.01
    here = problem.linearize(body.start() | {"observed": target})
    assert here.jacobian.shape == (300_000 + 12 + 10, 72 + 10 + 3)
    np.testing.assert_allclose(here.residual[:300_000], -5, atol=1e-9)
    x, fixed = problem.split(body.start() | {"observed": target})
    np.testing.assert_allclose(problem.cost_and_gradient(x, fixed)[0], here.cost)
    other = problem.freeing("trans").without("shape prior")
    assert other.linearize(body.start() | {"observed": target}).jacobian.shape == (300_012, 3)
    with pytest.raises(AssertionError, match="graph of the whole mesh"):
        _ = problem.function


# Free arrays, and back.


def test_blocks_made_before_and_after_freeing_are_the_same() -> None:
    body = smpl_like_body()
    before = body.blocks("early/")
    trained = body.freed("template").freed("weights")
    assert trained.blocks("early/") is before
    assert trained.blocks("late/") is body.blocks("late/")
    points = trained.points(*(block.symbol for block in before))
    pose, betas, trans, *_ = points.source.blocks
    assert (pose, betas, trans) == before  # with their units and labels
    problem = wb.Problem([wb.residuals.vertices(points, body.template, sigma=1.0)], "early/pose")
    assert problem.free.label(5) == "early/pose[left_hip, z]"
    assert problem.free.unit(5) == "rad"


def test_a_template_is_trained_in_five_lines() -> None:
    body = random_body(n_vertices=8, n_joints=3)
    data = body.template + np.random.default_rng(0).normal(scale=0.01, size=(8, 3))

    student = body.freed("template")
    points = student.points(*(block.symbol for block in student.blocks()))
    problem = wb.Problem([wb.residuals.vertices(points, data, sigma=0.001)], free="template")
    solution = wb.solve(problem, student.start())
    trained = student.with_values(solution.values)

    assert not trained.free
    np.testing.assert_allclose(trained.template, data, atol=1e-9)
    np.testing.assert_allclose(trained.vertices(), data, atol=1e-9)
    np.testing.assert_array_equal(body.template, student.template)
    assert trained.blocks() is body.blocks()


def test_every_array_comes_back_as_it_was() -> None:
    body = BODY.freed("template", "shapedirs", "posedirs", "J_regressor", "weights", prefix="new ")
    back = body.with_values(body.start())
    assert isinstance(back.J_regressor, csr_array)
    assert back.J_regressor.nnz == BODY.J_regressor.nnz
    for name in ("template", "shapedirs", "posedirs", "J_regressor", "weights"):
        np.testing.assert_array_equal(back.array(name), BODY.array(name))
    np.testing.assert_array_equal(back.vertices(), BODY.vertices())


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({}, r"block 'weights' \(30, 5\) was given no value"),
        ({"weights": np.ones((30, 4))}, r"block 'weights' has shape \(30, 5\), but was given"),
        ({"weights": np.full((30, 5), np.nan)}, r"block 'weights' holds nan at \[0, 0\]"),
        ({"weights": np.ones((30, 5))}, "weights of vertex 0 sum to 5, but must sum to 1"),
        ({"weights": "heavy"}, "block 'weights' must be an array of real numbers, not text"),
    ],
)
def test_values_that_make_no_body_are_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises(wb.WorkbenchError, match=text):
        BODY.freed("weights").with_values(values)
