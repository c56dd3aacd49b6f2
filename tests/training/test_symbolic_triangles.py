"""What triangles learn, as one `Problem`: the same terms and minima as the fast blocks have."""

from dataclasses import replace
from functools import cache

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import tube_body
from tests.training.known_poses import Direct
from workbench import LevenbergMarquardt, Problem, diagnose, solve
from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.geometry.triangles import gradients
from workbench.training.triangles.learning import (
    PosedMeshes,
    learn_bends,
    learn_person,
    learn_shapes,
    neighbour_differences,
)
from workbench.training.triangles.symbolic import SymbolicTriangles, shape_term

RIDGE, SMOOTHNESS = 1e-3, 1e-4  # m^2
RNG = np.random.default_rng(0)


@cache
def generator(blended: bool = True) -> TriangleBody:
    body = (blend_scape if blended else scape)(tube_body(rings=3))
    return replace(body, posedirs=RNG.normal(scale=0.05, size=body.posedirs.shape))


@cache
def meshes() -> tuple[Array, PosedMeshes]:
    """D (2, F, 3, 3) of two people, and noisy meshes of them in four poses each."""
    true, betas = generator(), RNG.normal(size=(2, 2))
    person, poses = np.repeat([0, 1], 4), RNG.normal(scale=0.5, size=(8, 3, 3))
    exact = true.vertices(poses, betas[person])
    posed = PosedMeshes(exact + 0.002 * RNG.normal(size=exact.shape), poses, person)
    D = np.eye(3) + np.einsum("fabk,sk->sfab", true.shapedirs, betas)
    return D, posed


@cache
def symbolic() -> SymbolicTriangles:
    return SymbolicTriangles.of(generator(), *meshes())


@pytest.mark.parametrize("blended", [False, True])
def test_freed_arrays_move_points_as_new_arrays(blended: bool) -> None:
    body = generator(blended)
    learning = body.freed("template", "shapedirs", "posedirs")
    pose, betas, trans = (block.symbol for block in learning.blocks())
    points = learning.points(pose, betas, trans)
    assert points.source.numeric is None
    values = learning.start() | {"pose": RNG.normal(size=(3, 3)), "betas": RNG.normal(size=2)}
    for name in ("template", "shapedirs", "posedirs"):
        values[name] = values[name] + 0.01 * RNG.normal(size=values[name].shape)
    expected = learning.with_values(values).vertices(values["pose"], values["betas"])
    symbols = {s.name(): s for s in cs.symvar(points.graph())}
    function = cs.Function("f", list(symbols.values()), [points.graph()])
    given = [np.asarray(values[name]).reshape(-1, order="C") for name in symbols]
    given = [g.reshape(s.shape, order="F") for g, s in zip(given, symbols.values(), strict=True)]
    np.testing.assert_allclose(np.asarray(function(*given)).T, expected, atol=1e-13)
    assert learning.joint_points(pose, betas, trans).source.blocks[-1].name == "posedirs"


@pytest.mark.thorough
def test_terms_are_those_of_the_blocks() -> None:
    form, (D, posed) = symbolic(), meshes()
    values = form.values()
    modelled = np.stack(
        [
            form.subjects[s].vertices(pose, [1.0])
            for s, pose in zip(posed.person, posed.poses, strict=True)
        ]
    )
    away = posed.vertices - modelled
    away -= away.mean(axis=1, keepdims=True)
    tied = neighbour_differences(form.body.faces)
    expected = {
        "data": 0.5 * np.sum(away**2),
        "E_Q": 0.5 * RIDGE * np.sum(form.body.posedirs**2),
        "E_D": 0.5 * SMOOTHNESS * sum(np.sum((tied @ d.reshape(-1, 9)) ** 2) for d in D),
    }
    found = {
        "data": form.problem(form.data()),
        "E_Q": form.problem(form.small_posedirs(RIDGE)),
        "E_D": form.problem(form.smooth_subjects(SMOOTHNESS)),
    }
    costs = {name: problem.linearize(values).cost for name, problem in found.items()}
    assert costs == pytest.approx(expected, rel=1e-12)


@pytest.mark.thorough
def test_learned_bends_are_a_minimum_of_the_problem() -> None:
    form, (D, posed) = symbolic(), meshes()
    shaped = replace(generator(), shapedirs=np.moveaxis(D - np.eye(3), 0, 3))
    learned = learn_bends(shaped, posed, np.eye(2), ridge=RIDGE, by=Direct(most=10_000))
    terms = [*form.data(), *form.small_posedirs(RIDGE)]
    free = ["posedirs", *(f"mesh {j}/trans" for j in range(8))]
    problem = form.problem(terms, free)
    solver = LevenbergMarquardt(gradient_tolerance=1e-13)
    found = solve(problem, form.values(), solver).values
    np.testing.assert_allclose(found["posedirs"], learned.posedirs, atol=1e-9)


@pytest.mark.thorough
def test_learned_person_is_a_minimum_of_the_problem() -> None:
    form, (_, posed) = symbolic(), meshes()
    own = PosedMeshes(posed.vertices[:4], posed.poses[:4], posed.person[:4])
    learned = learn_person(generator(), own, smoothness=SMOOTHNESS, by=Direct(most=10_000))
    terms = [*form.data()[:4], *form.smooth_subjects(SMOOTHNESS)[:1]]
    free = ["subject 0/shapedirs", *(f"mesh {j}/trans" for j in range(4))]
    problem = form.problem(terms, free)
    solver = LevenbergMarquardt(gradient_tolerance=1e-13)
    found = solve(problem, form.values(), solver).values
    np.testing.assert_allclose(np.eye(3) + found["subject 0/shapedirs"][..., 0], learned, atol=1e-6)


@pytest.mark.thorough
def test_directions_and_betas_have_k_squared_plus_k_gauges() -> None:
    """S alone leaves k^2 + k directions open: a matrix between them, and where the mean is."""
    k, people = 2, tube_body(rings=3).vertices(betas=RNG.normal(size=(6, 2)))
    shapes = learn_shapes(people, generator().faces, k)
    D = np.stack([gradients(shapes.template, one, generator().faces) for one in people])
    residual, blocks = shape_term(D, k)
    problem = Problem([residual], [block.name for block in blocks], blocks=blocks)
    start = {block.name: RNG.normal(size=block.shape) for block in blocks}
    solution = solve(problem, start)
    flat = D.reshape(6, -1)
    left = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)[k:]
    assert solution.cost == pytest.approx(0.5 * np.sum(left**2), abs=1e-8)
    found = diagnose(problem, solution.values)
    assert found.shape[1] - found.rank == k * k + k
