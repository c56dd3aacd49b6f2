"""Coregistration with triangles: one cost that no block raises, and steps that are exact."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csc_array

from tests.registration.test_coregistration import TERM, body, made
from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.errors import BadArgument
from workbench.geometry.triangles import edges
from workbench.registration.coregistration.triangle_steps import (
    Bends,
    JointStep,
    OfScan,
    Persons,
    Unknown,
    learned_bends,
)
from workbench.registration.coregistration.triangles import (
    TriangleCoregistration,
    TrianglePlan,
    TriangleState,
)

PLAN = TrianglePlan(rounds=2, coupling=0.005, term=TERM)


@cache
def start() -> TriangleBody:
    """BlendSCAPE on the test's body, with a Q for triangles before they are stitched."""
    skinned = body()
    poses = 0.25 * np.random.default_rng(4).standard_normal((12, skinned.n_joints, 3))
    poses[:, 0] = 0
    return learned_bends(blend_scape(skinned), poses, skinned.vertices(poses), 0.02)


def apart() -> Array:
    """Where the fitted body is on each scan."""
    _, fits, _, _ = made()
    return np.stack([body().vertices(f.pose, f.betas, f.trans) for f in fits])


@cache
def run(plan: TrianglePlan) -> TriangleState:
    scans, fits, _, _ = made()
    return TriangleCoregistration(start(), scans, plan).run(fits, apart())


def away(state: TriangleState) -> float:
    return float(np.linalg.norm(state.vertices - made()[2], axis=2).mean())


def test_edges_before_stitching_follow_deformations() -> None:
    rng, b = np.random.default_rng(0), start()
    pose, betas = 0.3 * rng.standard_normal((b.n_joints, 3)), rng.standard_normal(b.n_betas)
    symbols = [block.symbol for block in b.blocks()[:2]]
    found = cs.Function("edges", symbols, [b.deformed_edges(*symbols)])(pose.T, betas)
    X = b.deformations(pose, betas)
    wanted = np.einsum("fab,fib->fia", X, edges(b.template, b.faces)).reshape(-1, 3)
    assert_allclose(np.asarray(found).T, wanted, atol=1e-14)


@pytest.mark.thorough
def test_triangle_cost_is_monotone_over_blocks() -> None:
    log = run(PLAN).log
    assert [entry.block for entry in log] == ["persons", "bends", "registrations"] * 2
    for entry in log:
        assert sum(entry.after.values()) < sum(entry.before.values())
    for before, after in pairwise(log):
        assert sum(before.after.values()) == pytest.approx(sum(after.before.values()))


@pytest.mark.thorough
def test_learned_triangles_improve_registrations() -> None:
    assert away(run(PLAN)) < 0.9 * away(run(replace(PLAN, blocks=())))


@pytest.mark.thorough
def test_bends_are_learned_before_stitching() -> None:
    skinned, rng, ratio = body(), np.random.default_rng(4), 0.02
    poses = 0.25 * rng.standard_normal((12, skinned.n_joints, 3))  # those of `start`
    poses[:, 0] = 0
    meshes = skinned.vertices(poses)

    def cost(posedirs: Array) -> float:
        b = replace(start(), posedirs=posedirs)
        total = ratio**2 * float((posedirs**2).sum())
        for pose, mesh in zip(poses, meshes, strict=True):
            at = b.arithmetic.evaluate(pose, np.zeros(b.n_betas))
            model = np.einsum("fab,fib->fia", at.B, at.shaped)
            total += float(((edges(mesh, b.faces) - model) ** 2).sum())
        return total

    least, aside = start().posedirs, 0.1 * rng.standard_normal(start().posedirs.shape)
    assert cost(least) < 0.7 * cost(np.zeros_like(least))
    up, down = cost(least + aside), cost(least - aside)
    assert abs(up - down) < 1e-9 * (up + down)  # a minimum of a quadratic
    assert min(up, down) > cost(least)
    with pytest.raises(BadArgument, match="above 0 m rad"):
        learned_bends(blend_scape(skinned), poses, meshes, 0.0)


def unknowns(at: TriangleBody, poses: Array) -> list[tuple[Unknown, list[int]]]:
    each = np.eye(at.n_betas)
    subject = made()[0].subject
    here = [at.arithmetic.evaluate(p, each[s]) for p, s in zip(poses, subject, strict=True)]
    own = [j for j, s in enumerate(subject) if s == 0]
    fitted = np.eye(3) + 0.9 * at.shapedirs[..., 0]
    return [
        (Persons(at, [here[j] for j in own], 0.05, fitted), own),
        (Bends(at, here, 0.1, 0.5 * at.posedirs), list(range(len(here)))),
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("which", [0, 1])
def test_joint_step_solves_the_normal_equations(which: int) -> None:
    state, rng = run(PLAN), np.random.default_rng(1)
    unknown, own = unknowns(state.body, state.poses)[which]
    N, s = state.body.n_vertices, 0.01
    A, free = state.body.stitching.A, 1e-6 / s**2
    scans, gaps = [], []
    for _ in own:
        few = rng.standard_normal((40, 3 * N))
        scans.append(OfScan(state.vertices[0], rng.standard_normal(3 * N), csc_array(few.T @ few)))
        gaps.append(1e-3 * rng.standard_normal((A.shape[0], 3)))
    e = edges(state.vertices[0], state.body.faces).reshape(-1, 3)
    step = JointStep(unknown, scans, [e - gap for gap in gaps], s, state.body, 1e-10, 2000)
    x, moved = step.found()
    slope = unknown.prior @ x + unknown.prior_slope
    for j, (scan, gap, v) in enumerate(zip(scans, gaps, moved, strict=True)):
        left = (A @ v + gap - unknown.forth(j, x)) / s**2
        slope -= unknown.back(j, left)
        on_vertices = scan.slope + scan.normal @ v.ravel() + (A.T @ left).ravel() + free * v.ravel()
        assert np.abs(on_vertices).max() < 1e-7 * np.abs(scan.slope).max()
    began = unknown.prior_slope - sum(unknown.back(j, g / s**2) for j, g in enumerate(gaps))
    assert np.abs(slope).max() < 1e-7 * np.abs(began).max()


def test_bad_triangle_plans_are_refused() -> None:
    for change, told in [
        ({"rounds": 0}, "one round or more, not 0"),
        ({"bends": 0.0}, "bends is above zero, not 0"),
        ({"blocks": ("templates",)}, "no block is called 'templates'; give persons and bends"),
    ]:
        with pytest.raises(BadArgument, match=told):
            replace(PLAN, **change)  # type: ignore[arg-type]
