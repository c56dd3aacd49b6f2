"""SCAPE and BlendSCAPE from meshes in poses that nobody is told."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from tests.training.known_poses import Direct
from tests.training.test_triangles import B, P, generator, untrained
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.training.registrations import InMemory
from workbench.training.triangles.alternation import (
    SMOOTHNESS,
    TriangleEstimate,
    TriangleOptions,
    bends,
    persons,
    shapes,
    train_triangles,
    unposed,
)
from workbench.training.triangles.learning import neighbour_differences

SMALL = wb.load_body("small")
BY = Direct()
ONCE = TriangleOptions(rounds=1, bends=BY, persons=BY)
RIDGE = 1e-7


def made(blended: bool) -> tuple[TriangleBody, TriangleEstimate, InMemory, InMemory]:
    """A generator, a start that knows poses to 0.1 rad and nothing of Q, and its meshes."""
    true, rng = generator(blended), np.random.default_rng(0)
    betas = rng.normal(size=(P, B))
    still = rng.normal(scale=0.05, size=(P, 3, 3))
    who, poses = np.arange(24) % P, rng.normal(scale=0.6, size=(24, 3, 3))
    standing = InMemory(true.vertices(still, betas, rng.normal(size=(P, 3))), np.arange(P))
    posed = InMemory(true.vertices(poses, betas[who], rng.normal(size=(24, 3))), who)
    D = np.eye(3) + np.moveaxis(true.shapedirs @ betas.T, 3, 0)
    off = [p + rng.normal(scale=0.1, size=p.shape) for p in (poses, still)]
    return true, TriangleEstimate(untrained(true), D, *off), standing, posed


@pytest.mark.thorough
@pytest.mark.parametrize("blended", [True])
def test_training_cost_is_monotone(blended: bool) -> None:
    true, state, standing, posed = made(blended)
    state = shapes(state, standing, B)
    E, left = [np.inf], []
    for _ in range(2):
        for block in (
            lambda s: bends(s, posed, RIDGE, BY),
            lambda s: replace(s, poses=s.fits(posed).poses),
            lambda s: persons(s, posed, BY),
        ):
            state = block(state)
            E.append(cost(true, state, posed))
            left.append(state.fits(posed, 0).rms(posed.vertices))
    assert (np.diff(E) < 0).all()
    assert left[-1] < 0.15 * left[0]
    assert left[0] > 0.01  # m


def cost(true: TriangleBody, state: TriangleEstimate, posed: InMemory) -> float:
    """The meshes', E_Q and E_D, m^2."""
    data = posed.vertices.size / 3 * state.fits(posed, 0).rms(posed.vertices) ** 2
    tied = neighbour_differences(true.faces)
    rough = sum(np.sum((tied @ D.reshape(len(D), 9)) ** 2) for D in state.D)
    return float(data + RIDGE * np.sum(state.body.posedirs**2) + SMOOTHNESS * rough)


@pytest.mark.thorough
def test_rounds_find_a_model_of_the_meshes() -> None:
    _, begun, standing, posed = made(blended=False)
    end = train_triangles(begun, standing, posed, n_betas=B, ridge=RIDGE, options=ONCE)
    before, after = (s.fits(posed, 10).rms(posed.vertices) for s in (begun, end))
    assert after < 0.2 * before
    assert end.body.n_betas == B
    np.testing.assert_allclose(end.body.template.mean(axis=0), 0, atol=1e-12)
    apart = [np.linalg.norm(s.poses - begun.poses) for s in (begun, end)]
    assert apart[1] > apart[0] == 0


def test_changed_template_changes_no_subject() -> None:
    _, begun, standing, _ = made(blended=True)
    after = shapes(begun, standing, B)
    assert abs(after.body.template - begun.body.template).max() > 0.01
    still = [s.subjects.vertices(0 * s.poses[:P], np.eye(P)) for s in (begun, after)]
    shown = [V - V.mean(axis=1, keepdims=True) for V in still]
    np.testing.assert_allclose(*shown, atol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("make", [blend_scape])
def test_persons_are_unposed(make: object) -> None:
    assert callable(make)
    body: TriangleBody = make(SMALL)
    rng = np.random.default_rng(1)
    betas, pose = rng.normal(size=10), np.zeros((24, 3))
    rest = body.vertices(betas=betas)
    rest -= rest.mean(axis=0)
    pose[0] = [1.0, -2.0, 0.5]  # only turned: to the last digit
    turned = body.vertices(pose, betas, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(unposed(body, pose, turned), rest, atol=1e-11)
    pose += rng.normal(scale=0.05, size=(24, 3))
    moved = body.vertices(pose, betas)
    apart = np.linalg.norm(unposed(body, pose, moved) - rest, axis=1)
    pose[1:] = 0  # as if the jitter were not known
    ignored = np.linalg.norm(unposed(body, pose, moved) - rest, axis=1)
    assert apart.max() < 0.1 * ignored.max()
