"""Fits of synthetic bodies: what is known of each is true, and starts are paired."""

import pickle
from typing import Any

import numpy as np
import pytest

from tests.tiers import few
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, BadBounds, UnknownName, WorkbenchError
from workbench.experiments import SUITES, Setup, find, run
from workbench.experiments.body_fits import known_correspondences
from workbench.fitting.setup import KnownAnswer
from workbench.solvers import LevenbergMarquardt

NAMES = [experiment.name for experiment in SUITES["bodies"]]
CHEAP = ("body-vertices", "body-joints", "body-joints-alone", "body-four-cameras", "body-bounds")
EACH = pytest.mark.parametrize("name", few(NAMES, CHEAP))
KEPT: dict[str, Setup] = {}


def built(name: str, **arguments: Any) -> Setup:
    return find(name, arguments).setup()


def standard(name: str) -> tuple[Setup, KnownAnswer]:
    """As it comes; built once."""
    setup = KEPT[name] if name in KEPT else KEPT.setdefault(name, built(name))
    assert setup.known is not None
    return setup, setup.known


@EACH
def test_known_answers_are_minima(name: str) -> None:
    setup, known = standard(name)
    assert known.cost is not None
    start = setup.problem.linearize(setup.start).cost
    assert start > known.cost
    if known.values is None:
        assert name == "body-joints-alone"
        return
    at = setup.start | known.values
    here = setup.problem.linearize(at)
    assert here.cost == pytest.approx(known.cost, rel=1e-12, abs=1e-15 * start)
    x, fixed = setup.problem.split(at)
    off = setup.problem.optimality(x, here, setup.problem.rounding(x, fixed, here.residual))
    assert off < 3e-7  # of SCAPE: below, rounding hides by how much the cost still falls
    assert setup.measures(at)  # they can be asked for


@pytest.mark.parametrize("name", few(NAMES, ("body-vertices", "body-joints")))
def test_data_do_not_depend_on_the_start(name: str) -> None:
    setup, known = standard(name)
    second = built(name, start="2")
    assert "random start 2" in second.question
    assert second.known is not None
    assert second.known.cost == known.cost
    stranger = pickle.loads(pickle.dumps(find(name, {"seed": "1", "start": 2}))).setup()
    assert "synthetic" in stranger.question
    for free in setup.problem.free.names:
        assert (second.start[free] != setup.start[free]).any()
        assert (second.start[free] != stranger.start[free]).any()
    for fixed in setup.problem.fixed.names:
        np.testing.assert_array_equal(setup.start[fixed], second.start[fixed])


def test_joints_alone_have_rank_53() -> None:
    """43 of pose and trans (tests/diagnostics), and 10 of shape."""
    alone, _ = standard("body-joints-alone")
    somewhere = built("body-joints-alone", start=1).start
    assert alone.problem.linearize(somewhere).rank == 53
    with_priors, _ = standard("body-joints")
    assert with_priors.problem.linearize(somewhere).rank == 85


@pytest.mark.thorough
def test_impossible_bodies_are_refused() -> None:
    with pytest.raises(BadArgument, match="start must be from 0 on, not -1"):
        built("body-vertices", start=-1)
    with pytest.raises(BadArgument, match=r"cannot be built with .*seed=-1"):
        built("body-vertices", seed=-1)
    with pytest.raises(BadBounds, match="no number lies between"):
        built("body-bounds", limit=-1.0)
    with pytest.raises(WorkbenchError, match="there is no image to fit"):
        built("body-four-cameras", cameras=0)
    with pytest.raises(WorkbenchError, match="is finite and above zero"):
        built("body-joints", noise=0.0)
    with pytest.raises(UnknownName, match="no model is called 'star'"):
        built("body-points-smpl", model="star")


SEEDS = range(2)


@pytest.fixture(scope="module")
def setup() -> Setup:
    return known_correspondences("small")


def posed(body: SkinnedBody, seed: int, noise: float) -> Values:
    """The observation of `known_correspondences` with this seed, without building a graph."""
    rng = np.random.default_rng(seed)
    pose, betas = 0.3 * rng.standard_normal((24, 3)), rng.standard_normal(body.n_betas)
    clean = body.vertices(pose, betas)
    return {"observed": clean + noise * rng.standard_normal(clean.shape)}


@pytest.mark.parametrize("seed", few(SEEDS, 2))
def test_vertices_are_recovered_within_fifteen_iterations(setup: Setup, seed: int) -> None:
    body = setup.body
    assert body is not None
    observed = posed(body, seed, 0.0)
    solution = LevenbergMarquardt(max_iterations=15).solve(setup.problem, setup.start | observed)
    assert solution.converged
    assert np.abs(body.vertices(**solution.values) - observed["observed"]).max() < 1e-6  # m


@pytest.mark.thorough
def test_stranger_is_registered_to_the_limit_of_shapes() -> None:
    result = run(find("registration"))
    numbers = {m.name: m.value for m in result.measures}
    left = numbers["vertex to observation, rms"]
    floor = numbers["floor: without the prior, from the true pose, rms"]
    assert 1.0 < floor <= left <= 1.001 * floor  # mm; the prior costs next to nothing
    costs = [solution.cost for solution in result.compared.values()]
    assert len(costs) == 5
    assert max(costs) <= min(costs) * (1 + 1e-6)


def test_unknown_strangers_are_refused() -> None:
    with pytest.raises(UnknownName, match="0 to 3"):
        find("registration", {"person": 4}).setup()
    with pytest.raises(UnknownName, match="default, small"):
        find("registration", {"body": "full"}).setup()
