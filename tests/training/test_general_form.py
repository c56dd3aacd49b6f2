"""Training as a fit with other names free: what it finds, what it cannot, and its gradient."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.training.general_form import GeneralForm, gauges, general_form
from workbench import LevenbergMarquardt, Values, diagnose, solve

BODY = random_body(2, n_vertices=12, n_joints=3, n_betas=2)
RNG = np.random.default_rng(0)
N_SCANS = 6
MESHES = BODY.vertices(
    0.4 * RNG.normal(size=(N_SCANS, 3, 3)),
    RNG.normal(size=(N_SCANS, 2)),
    0.1 * RNG.normal(size=(N_SCANS, 3)),
)
WRONG = replace(BODY, template=BODY.template + 0.02 * RNG.normal(size=(12, 3)))
PRECISE = LevenbergMarquardt(gradient_tolerance=1e-12)


def solved(form: GeneralForm) -> Values:
    solution = solve(form.problem, form.start, PRECISE)
    assert solution.cost < 1e-10
    return form.start | solution.values


@pytest.mark.parametrize("freed", [("template",), ("template", "shapedirs")])
def test_training_is_a_fit_and_its_gauges_are_all_that_is_not_seen(
    freed: tuple[str, ...],
) -> None:
    form = general_form(WRONG, list(MESHES), freed=freed, shape_sigma=inf)
    values = solved(form)
    named = gauges(form, values, 2)
    if "shapedirs" not in freed:  # the mean along a known direction is one as well
        named |= {
            f"the mean along {b}": {"template": BODY.shapedirs[:, :, b]}
            | {f"scan {j}/betas": -np.eye(2)[b] for j in range(N_SCANS)}
            for b in range(2)
        }
    here = form.problem.linearize(values)
    zero = {name: 0 * values[name] for name in form.problem.free.names}
    flat = np.stack([form.problem.free.pack(zero | change) for change in named.values()])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    seen = np.linalg.norm(here.jacobian @ flat.T, axis=0)
    assert dict(zip(named, seen, strict=True)) == pytest.approx(dict.fromkeys(named, 0), abs=1e-4)
    found = diagnose(form.problem, values)
    assert len(found.null_directions) == np.linalg.matrix_rank(flat, tol=1e-8)
    said = " ".join(direction.name for direction in found.null_directions)
    assert all(name in said for name in (*freed, "betas"))


def test_with_a_shape_prior_the_mean_is_seen() -> None:
    form = general_form(WRONG, list(MESHES))
    solution = solve(form.problem, form.start, PRECISE)
    found = diagnose(form.problem, form.start | solution.values)
    assert len(found.null_directions) == 3  # it still does not matter where the template stands
    for direction in found.null_directions:
        assert "template" in direction.name


def test_the_gradient_of_the_minimum_is_the_partial_one() -> None:
    """Envelope theorem: the derivative of min over theta, beta by differences."""
    form = general_form(WRONG, list(MESHES[:3]), sigma=0.05)
    at = form.inner(form.start)
    cost, slope = form.projected(at)
    assert cost > 1e-3
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(12, 3))
    h = 1e-5
    ahead, behind = (
        form.projected(at | {"template": at["template"] + s * direction})[0] for s in (h, -h)
    )
    expected = (ahead - behind) / (2 * h)
    assert np.vdot(slope["template"], direction) == pytest.approx(expected, rel=1e-5)
    inner = form.problem.freeing(*form.own)
    _, rest = inner.cost_and_gradient(*inner.split(at))
    assert np.abs(rest).max() < 1e-6 * np.abs(slope["template"]).max()


def test_descending_the_minimum_is_training() -> None:
    """Steps down the projected gradient lower the cost, and the joint fit ends lower still."""
    form = general_form(WRONG, list(MESHES[:3]), sigma=0.05)
    values = form.inner(form.start)
    costs = []
    for _ in range(3):
        cost, slope = form.projected(values)
        costs.append(cost)
        values = values | {"template": values["template"] - 2e-4 * slope["template"]}
        values = form.inner(values)
    assert costs == sorted(costs, reverse=True)
    assert solve(form.problem, form.start, PRECISE).cost < costs[-1]
