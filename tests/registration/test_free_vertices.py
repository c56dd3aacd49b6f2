"""Free vertices against scans of a body that was changed where the model cannot follow."""

from functools import cache

import numpy as np
import pytest

from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting import Scan
from workbench.registration import (
    FreeVertices,
    Registered,
    ScanTerm,
    VertexStage,
    by_vertices,
    touched,
)
from workbench.registration.free_vertices import (
    BODY,
    MODEL_STAGES,
    NEAR,
    QUICK_VERTEX_STAGES,
    Settled,
)
from workbench.solvers.solution import Evaluations, Iterate

WEAK = QUICK_VERTEX_STAGES[-1]


@cache
def body() -> SkinnedBody:
    return load_body("small")


def belly() -> Array:
    """Which vertices (N,) are in front of the belly, from 0 to 1."""
    rest = body().vertices()
    middle = rest[np.argmax(rest[:, 2] - 10 * np.abs(rest[:, 1]) - 10 * np.abs(rest[:, 0]))]
    return np.exp(-0.5 * np.sum((rest - middle) ** 2, axis=1) / 0.08**2)


@cache
def bumped() -> Array:
    return np.asarray(body().vertices() + 0.03 * belly()[:, None] * [0, 0, 1])


def sampled(vertices: Array, n: int = 2000, seed: int = 0, front: bool = False) -> Scan:
    """Points on a surface, with normals and areas; of its front half only, if so."""
    rng = np.random.default_rng(seed)
    triangles = vertices[body().faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    if front:
        chosen = chosen[normals[chosen, 2] > 0]
    points = np.einsum("mk,mki->mi", rng.dirichlet((1, 1, 1), len(chosen)), triangles[chosen])
    each = np.full(len(chosen), areas.sum() / n)
    return Scan(points, normals[chosen] / (2 * areas[chosen, None]), weights=each)


@cache
def registered() -> Registered:
    return FreeVertices(body(), sampled(bumped())).register(body().start())


def off(vertices: Array) -> float:
    return float(np.linalg.norm(vertices - bumped(), axis=1).mean())


@pytest.mark.thorough
def test_edge_coupling_has_translations_as_null_space() -> None:
    problem = FreeVertices(body(), sampled(bumped())).problem(WEAK).without("scan")
    values = body().start() | {"vertices": bumped()}
    here = problem.linearize(values)
    s = np.linalg.svd(here.dense.T @ here.dense, compute_uv=False)
    assert (s < 1e-12 * s[0]).sum() == 3
    moved = problem.linearize(values | {"vertices": bumped() + [0.3, -1.0, 2.0]})
    np.testing.assert_allclose(moved.residual, here.residual, atol=1e-9)


def test_vertex_coupling_has_full_rank() -> None:
    fit = FreeVertices(body(), sampled(bumped()), couple=by_vertices)
    here = fit.problem(WEAK).without("scan").linearize(body().start() | {"vertices": bumped()})
    np.testing.assert_allclose(here.column_norms, 1 / WEAK.coupling)


@pytest.mark.thorough
def test_free_vertices_recover_a_bump() -> None:
    errors = [off(stage.vertices) for stage in registered().stages[1:]]
    assert (np.diff(errors) < 0).all()
    there = belly() > 0.7
    missed = np.linalg.norm(registered().model - bumped(), axis=1)[there].mean()
    left = np.linalg.norm(registered().vertices - bumped(), axis=1)[there].mean()
    assert left < 0.5 * missed


def test_gradient_matches_differences_with_contacts_chosen_anew() -> None:
    fit = FreeVertices(body(), sampled(bumped(), 300))
    problem = fit.problem(VertexStage("all", (*BODY, "vertices"), 0.01))
    rng = np.random.default_rng(1)
    values = body().start()
    values["vertices"] = bumped() + 0.004 * rng.standard_normal(bumped().shape)
    x, fixed = problem.split(values)
    _, g = problem.cost_and_gradient(x, fixed)
    np.testing.assert_allclose(problem.linearize_at(x, fixed).gradient, g, atol=1e-9 * abs(g).max())
    for _ in range(5):
        d = rng.standard_normal(x.size)
        d /= np.linalg.norm(d)
        h = 1e-7
        ends = [problem.linearize_at(x + step * d, fixed).cost for step in (h, -h)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(g @ d, rel=1e-5)


def test_unseen_vertices_are_untouched() -> None:
    done = FreeVertices(body(), sampled(bumped(), front=True)).register(
        body().start() | {"vertices": bumped()}, (WEAK,)
    )
    back = body().vertices()[:, 2] < body().vertices()[:, 2].mean() - 0.05
    a, b, c = bumped()[body().faces].transpose(1, 0, 2)
    facing = np.cross(b - a, c - a)[:, 2] > 0
    at_front = np.isin(np.arange(body().n_vertices), body().faces[facing])
    assert not done.touched[~at_front].any()
    assert done.touched[at_front].mean() > 0.8
    assert back[~done.touched].sum() > 0.3 * back.sum()


def test_settled_stages_end() -> None:
    small = Settled(1e-3)
    costs = [100.0, 50.0, 49.9, 49.89]
    assert [small(costing(cost)) for cost in costs] == [False, False, False, True]
    many = Settled(1e-3)
    assert [many(costing(0.5**k)) for k in range(31)] == [False] * 30 + [True]


def costing(cost: float) -> Iterate:
    return Iterate({}, cost, 0.0, 0.0, 0.0, Evaluations(), 0.0)


@pytest.mark.thorough
def test_first_stage_is_needed() -> None:
    """An arm is 20 degrees off: vertices that leave the model there are drawn to wrong places."""
    start = body().start()
    start["pose"][body().joint_names.index("left_shoulder"), 2] += 0.35
    fit = FreeVertices(body(), sampled(bumped()))
    whole = fit.register(start, QUICK_VERTEX_STAGES)
    skipped = fit.register(start, QUICK_VERTEX_STAGES[len(MODEL_STAGES) :])
    assert off(whole.vertices) < 0.5 * off(skipped.vertices)


def test_bad_vertex_stages_are_refused() -> None:
    with pytest.raises(BadArgument, match="the coupling is infinite"):
        VertexStage("odd", ("vertices",), 0.0)
    with pytest.raises(BadArgument, match="needs a free block"):
        VertexStage("odd", (), 0.01)
    with pytest.raises(BadArgument, match="one stage or more"):
        FreeVertices(body(), sampled(bumped())).register(body().start(), ())
    with pytest.raises(BadArgument, match=r"above zero, not -0\.1"):
        ScanTerm(sigma=-0.1)


def test_touched_needs_contacts() -> None:
    problem = FreeVertices(body(), sampled(bumped())).problem(WEAK)
    coupling = next(r for r in problem.residuals if r.name == "coupling")
    with pytest.raises(BadArgument, match="'coupling' chooses no contacts"):
        touched(coupling, body().start(), NEAR.outlier)
