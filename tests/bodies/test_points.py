"""Points of a body: which vertices, of what symbols, and without building what nobody asks for."""

import re
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies.laws import said
from tests.bodies_made_up import random_body
from workbench.bodies.forward import posed_points, surface
from workbench.errors import BadBody, UnknownName

BODY = replace(
    random_body(),
    landmarks={"face": wb.Landmarks(("nose", "eye"), csr_array(np.eye(2, 30)))},
)
SYMBOLS = tuple(block.symbol for block in BODY.blocks())
ARRAYS = ("template", "shapedirs", "posedirs", "J_regressor", "weights")


def seen(points: wb.Points) -> np.ndarray:
    f = cs.Function("f", list(SYMBOLS), [points.source.expression])
    return np.asarray(f(np.full((3, 5), 0.1), np.ones(3), np.zeros(3))).T


# Which vertices.


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ([3, 1, 1], [3, 1, 1]),
        (np.array([29, 0], dtype=np.uint8), [29, 0]),
        (np.arange(30) % 10 == 4, [4, 14, 24]),
    ],
    ids=["list", "unsigned", "mask"],
)
def test_vertices_are_chosen_by_number_or_mask(chosen: Any, expected: list[int]) -> None:
    points = BODY.points(*SYMBOLS, vertices=chosen)
    assert points.count == len(expected)
    assert points.labels == tuple(f"vertex {i}" for i in expected)
    np.testing.assert_array_equal(seen(points), seen(BODY.points(*SYMBOLS))[expected])


NOT_THERE: list[tuple[Any, str]] = [
    ([0, -1], "no vertex -1"),
    ([2, 30, 31], "no vertex 30; .* 0 to 29"),
    ([1.0, 2.0], "whole numbers"),
    (np.ones(29, dtype=bool), r"shape \(29,\)"),
    (3, r"shape \(\)"),
    (["nose"], "text"),
    (slice(3), "type slice"),
]


def test_vertices_that_are_not_there_are_refused() -> None:
    for chosen, words in NOT_THERE:
        found = said(BadBody, BODY.points, *SYMBOLS, vertices=chosen)
        assert re.search(words, found), found


# Of what symbols.


def test_symbols_of_wrong_shapes_are_named() -> None:
    for made in (BODY.points, BODY.joint_points, partial(BODY.landmark_points, "face")):
        for which, needed in enumerate([r"\(3, 5\) for pose", r"\(3, 1\) for betas", "for trans"]):
            for wrong, words in ((cs.MX.sym("wrong", 7, 2), needed), (np.zeros(3), "ndarray")):
                symbols = [*SYMBOLS[:which], wrong, *SYMBOLS[which + 1 :]]
                found = said(BadBody, made, *symbols)
                assert re.search(words, found), found


def all_points(body: wb.SkinnedBody) -> tuple[wb.Points, ...]:
    symbols = [block.symbol for block in body.blocks()]
    return (
        body.points(*symbols),
        body.points(*symbols, vertices=[4, 2]),
        body.joint_points(*symbols),
        body.landmark_points("face", *symbols),
    )


def test_counts_and_blocks_are_known_without_the_graph() -> None:
    for free in ((), *((name,) for name in ARRAYS)):
        for points in all_points(BODY.freed(*free)):
            said = {block.name for block in points.source.blocks}
            expression = points.source.expression
            assert said == {symbol.name() for symbol in cs.symvar(expression)}, free
            assert expression.shape == points.symbol.shape == (3, points.count)


def test_large_meshes_are_linearized_without_their_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    body, rng = wb.load_body("default"), np.random.default_rng(0)
    N, observed = body.n_vertices, wb.Block("observed", (body.n_vertices, 3), "m").symbol
    face = wb.Landmarks(("nose", "eye"), csr_array(np.eye(2, N)))
    body = replace(body, landmarks={"face": face})

    def built(*_: object) -> None:
        raise AssertionError("the graph of the whole mesh was built")

    monkeypatch.setattr(posed_points, "WORTH_COMPILING", np.inf)
    monkeypatch.setattr(surface, "posed", built)
    points, some, _, marks = all_points(body)
    terms = (
        wb.residuals.vertices(points, observed, sigma=0.002),
        wb.residuals.vertices(some, rng.normal(size=(2, 3)), sigma=0.01),
        wb.residuals.landmarks(marks, rng.normal(size=(2, 3)), sigma=0.01),
        wb.residuals.gaussian(body.blocks()[1].symbol, name="shape prior"),
    )
    problem = wb.Problem(terms, ("pose", "betas", "trans"))
    assert problem.row_label(3 * N) == f"{terms[1].name}[vertex 4, x]"
    values = body.start() | {"observed": body.template + 0.01}
    here = problem.linearize(values)
    assert here.jacobian.shape == (3 * N + 12 + 10, 72 + 10 + 3)
    np.testing.assert_allclose(here.residual[: 3 * N], -5, atol=1e-9)
    x, fixed = problem.split(values)
    np.testing.assert_allclose(problem.cost_and_gradient(x, fixed)[0], here.cost)
    other = problem.freeing("trans").without("shape prior")
    assert other.linearize(values).jacobian.shape == (3 * N + 12, 3)
    with pytest.raises(AssertionError, match="graph of the whole mesh"):
        _ = problem.function


# Free arrays, and back.


def test_free_arrays_are_blocks_of_their_shapes() -> None:
    body = random_body().freed("J_regressor", "template", prefix="new ")
    shapes = {block.name: block.shape for block in body.free.values()}
    assert shapes == {"new J_regressor": (5, 30), "new template": (30, 3)}
    assert body.freed("weights").free.keys() == {"J_regressor", "template", "weights"}
    start = body.start()
    np.testing.assert_array_equal(start["new J_regressor"], body.J_regressor.toarray())
    with pytest.raises(UnknownName, match="'faces'"):
        body.freed("faces")
