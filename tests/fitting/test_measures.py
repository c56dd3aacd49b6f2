"""Measurements of bodies: known lengths, plane cuts, derivatives, uncertainties."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

import workbench as wb
from workbench.arrays import Array
from workbench.experiments.body_fits import body_cameras
from workbench.fitting.measures import measured_at, measured_in, measurements

BODY = wb.load_body("small")
GIRTHS = ("chest", "waist", "hips", "thigh", "upper arm", "neck")


def tape(surface: Array, origin: Array, normal: Array, near: Array) -> float:
    """The hull of the part of a plane's cut around a point, by trimesh: what a tape measures."""
    mesh = trimesh.Trimesh(surface, BODY.faces, process=False)
    lines = trimesh.intersections.mesh_plane(mesh, normal, origin)
    ends = np.round(lines.reshape(-1, 3), 7)
    _, which = np.unique(ends, axis=0, return_inverse=True)
    groups = trimesh.graph.connected_component_labels(which.reshape(-1, 2))[which]
    loops = [lines.reshape(-1, 3)[groups == k] for k in np.unique(groups)]
    loop = min(loops, key=lambda points: np.linalg.norm(points.mean(axis=0) - near))
    plane = np.linalg.svd(normal[None])[2][1:]
    return float(ConvexHull(loop @ plane.T).area)


def path_points(name: str, betas: Array) -> Array:
    """The points (P, 3) of a measurement's path, by the arguments of its expression."""
    from workbench.fitting.measures import _paths

    return np.asarray(_paths(BODY)[name].weights @ (BODY.template + BODY.shapedirs @ betas))


def test_lengths_are_those_of_the_template() -> None:
    found = wb.measured(BODY, np.zeros(BODY.n_betas))
    low, high = BODY.template.min(axis=0), BODY.template.max(axis=0)
    assert found["stature"] == pytest.approx(high[1] - low[1], abs=1e-12)
    assert found["arm span"] == pytest.approx(high[0] - low[0], rel=0.02)  # elbows are bent a bit
    assert 0.45 < found["inseam"] / found["stature"] < 0.5
    assert found["neck"] < found["thigh"] < found["waist"] < found["hips"]


@pytest.mark.parametrize("name", GIRTHS)
def test_girths_are_plane_cuts_of_the_template_and_near_them_elsewhere(name: str) -> None:
    for betas, most in ((np.zeros(10), 1e-9), (np.eye(10)[0], 0.015), (-np.eye(10)[2], 0.015)):
        points = path_points(name, betas)
        middle = points.mean(axis=0)
        normal = np.linalg.svd(points - middle)[2][2]
        own = tape(BODY.template + BODY.shapedirs @ betas, middle, normal, middle)
        assert wb.measured(BODY, betas)[name] == pytest.approx(own, abs=most)


def test_measures_scale_with_the_body_and_agree_across_meshes() -> None:
    betas = np.linspace(-1, 1, 10)
    twice = replace(BODY, template=2 * BODY.template, shapedirs=2 * BODY.shapedirs)
    small, large = wb.measured(BODY, betas), wb.measured(twice, betas)
    for name, value in small.items():
        assert large[name] == pytest.approx(2 * value, rel=1e-9)
    fine = wb.measured(wb.load_body("default"), np.zeros(10))
    for name, value in wb.measured(BODY, np.zeros(10)).items():
        assert fine[name] == pytest.approx(float(value), rel=0.05)


def test_sd_is_that_of_the_linear_problem_and_infinite_where_nothing_is_seen() -> None:
    betas = BODY.blocks()[1]
    quantities, start = wb.measures(BODY), BODY.start()
    known = wb.Problem([wb.residuals.gaussian(betas.symbol, covariance=0.04)], ("betas",))
    seen = wb.Residual("first", betas.symbol[0], 1.0, blocks=(betas,))
    part = wb.Problem([seen], ("betas",))
    slopes = np.array([BODY.shapedirs[k, 1] for k in np.argsort(BODY.template[:, 1])[[-1, 0]]])
    value, sd = measured_at(known, start, quantities)["stature"]
    assert value == pytest.approx(np.ptp(BODY.template[:, 1]))
    assert sd == pytest.approx(0.2 * np.linalg.norm(slopes[0] - slopes[1]), rel=1e-9)
    assert {sd for _, sd in measured_at(part, start, quantities).values()} == {np.inf}


def test_measurements_of_a_fit_say_what_the_data_determine() -> None:
    setup = body_cameras()
    problem, priors = setup.problem, setup.priors
    values = setup.start | wb.solve(problem, setup.start).values
    found = {m.name: m for m in measurements(setup.body, problem, values, priors)}
    assert found["stature"].contraction > 0.7 > 0.5 > found["waist"].contraction > 0
    assert found["stature"].interval[1] - found["stature"].interval[0] < 0.08
    assert measurements(wb.load_body("hand"), problem, setup.start, priors) == ()


def test_draws_have_the_spread_of_laplace_where_the_problem_is_linear() -> None:
    betas, start = BODY.blocks()[1], BODY.start()
    problem = wb.Problem([wb.residuals.gaussian(betas.symbol, covariance=0.01)], ("betas",))
    draws = measured_in(wb.laplace(problem, start, draws=4000), BODY)
    for name, (value, sd) in measured_at(problem, start, wb.measures(BODY)).items():
        assert np.mean(draws[name]) == pytest.approx(value, abs=0.1 * sd + 0.002)
        assert np.std(draws[name]) == pytest.approx(sd, rel=0.06)


@pytest.mark.parametrize("name", ["hand", "small-scape"])
def test_bodies_of_no_person_are_refused(name: str) -> None:
    with pytest.raises(wb.WorkbenchError, match="measurement"):
        wb.measures(wb.load_body(name))
