"""Free vertices against scans of a body that was changed where the model cannot follow."""

from functools import cache

import numpy as np
import pytest

from tests.registration.clouds import cloud
from workbench import load_body
from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.registration import (
    FreeVertices,
    Registered,
    ScanTerm,
    VertexStage,
    by_vertices,
    touched,
)
from workbench.registration.free_vertices import BLOCKS, NEAR_TERM, QUICK_VERTEX_STAGES

WEAK = QUICK_VERTEX_STAGES[-1]
SMALL = load_body("small")
REST = SMALL.vertices()
MIDDLE = REST[np.argmax(REST[:, 2] - 10 * np.abs(REST[:, 1]) - 10 * np.abs(REST[:, 0]))]
BELLY: Array = np.exp(-0.5 * np.sum((REST - MIDDLE) ** 2, axis=1) / 0.08**2)  # (N,) from 0 to 1
BUMPED: Array = REST + 0.03 * BELLY[:, None] * [0, 0, 1]
SCAN = cloud(SMALL, BUMPED, 2000, areas=True)
FIT = FreeVertices(SMALL, SCAN)


@cache
def registered() -> Registered:
    return FIT.register(SMALL.start())


def off(vertices: Array) -> float:
    return float(np.linalg.norm(vertices - BUMPED, axis=1).mean())


@pytest.mark.thorough
def test_edge_coupling_has_translations_as_null_space() -> None:
    problem = FIT.problem(WEAK).without("scan")
    here = problem.linearize(SMALL.start() | {"vertices": BUMPED})
    s = np.linalg.svd(here.dense.T @ here.dense, compute_uv=False)
    assert (s < 1e-12 * s[0]).sum() == 3
    moved = problem.linearize(SMALL.start() | {"vertices": BUMPED + [0.3, -1.0, 2.0]})
    np.testing.assert_allclose(moved.residual, here.residual, atol=1e-9)


def test_vertex_coupling_has_full_rank() -> None:
    problem = FreeVertices(SMALL, SCAN, couple=by_vertices).problem(WEAK).without("scan")
    here = problem.linearize(SMALL.start() | {"vertices": BUMPED})
    np.testing.assert_allclose(here.column_norms, 1 / WEAK.coupling)


@pytest.mark.thorough
def test_free_vertices_recover_a_bump() -> None:
    assert (np.diff([off(stage.vertices) for stage in registered().stages[1:]]) < 0).all()
    model, free = (
        np.linalg.norm(surface - BUMPED, axis=1)[BELLY > 0.7].mean()
        for surface in (registered().model, registered().vertices)
    )
    assert free < 0.5 * model


def test_gradient_matches_differences_with_contacts_chosen_anew() -> None:
    fit = FreeVertices(SMALL, cloud(SMALL, BUMPED, 300, areas=True))
    problem = fit.problem(VertexStage("all", (*BLOCKS, "vertices"), 0.01))
    rng = np.random.default_rng(1)
    values = SMALL.start() | {"vertices": BUMPED + 0.004 * rng.standard_normal(BUMPED.shape)}
    x, fixed = problem.split(values)
    _, g = problem.cost_and_gradient(x, fixed)
    np.testing.assert_allclose(problem.linearize_at(x, fixed).gradient, g, atol=1e-9 * abs(g).max())
    for _ in range(5):
        d = rng.standard_normal(x.size)
        d *= 1e-7 / np.linalg.norm(d)
        rise = problem.linearize_at(x + d, fixed).cost - problem.linearize_at(x - d, fixed).cost
        assert rise / 2 == pytest.approx(g @ d, rel=1e-5)


def test_unseen_vertices_are_untouched() -> None:
    assert SCAN.normals is not None
    front = SCAN.some(SCAN.normals[:, 2] > 0)
    values = SMALL.start() | {"vertices": BUMPED}
    done = FreeVertices(SMALL, front).register(values, (WEAK,))
    a, b, c = BUMPED[SMALL.faces].transpose(1, 0, 2)
    facing = np.cross(b - a, c - a)[:, 2] > 0
    at_front = np.isin(np.arange(SMALL.n_vertices), SMALL.faces[facing])
    assert not done.touched[~at_front].any()
    assert done.touched[at_front].mean() > 0.8


def test_bad_vertex_stages_are_refused() -> None:
    coupling = next(r for r in FIT.problem(WEAK).residuals if r.name == "coupling")
    for bad, said in [
        (lambda: VertexStage("odd", ("vertices",), 0.0), "above 0 m if vertices"),
        (lambda: VertexStage("odd", (), 0.01), "needs a free block"),
        (lambda: FIT.register(SMALL.start(), ()), "one stage or more"),
        (lambda: ScanTerm(sigma=-0.1), r"sigma of a scan's term .* not -0\.1"),
        (
            lambda: touched(coupling, SMALL.start(), NEAR_TERM.outlier),
            "'coupling' chooses no contacts",
        ),
    ]:
        with pytest.raises(BadArgument, match=said):
            bad()
