"""The suite of bodies: what is known of each is true, and starts are paired."""

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.tiers import few
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument, BadBounds, WorkbenchError
from workbench.experiments import SUITES, Setup, find
from workbench.experiments.synthetic_people import bent_person, random_start
from workbench.fitting.setup import KnownAnswer

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


def test_numbered_starts_are_reproducible() -> None:
    body = load_body("small")
    third = random_start(body, 0, 3, 0.3)
    for block in body.blocks():
        assert (random_start(body, 0, 0, 0.3)[block.name] == 0).all()
        np.testing.assert_array_equal(third[block.name], random_start(body, 0, 3, 0.3)[block.name])
        assert (third[block.name] != random_start(body, 0, 4, 0.3)[block.name]).all()
    far = random_start(body, 0, 3, 1.0)
    np.testing.assert_allclose(far["pose"], third["pose"] / 0.3)
    # nobody's start is another's truth
    truth = bent_person(body, np.random.default_rng(0), 0.3)
    assert all((random_start(body, 0, k, 0.3)["pose"] != truth["pose"]).all() for k in range(1, 5))


def test_joints_alone_have_rank_53() -> None:
    """43 of pose and trans (tests/diagnostics), and 10 of shape."""
    alone, _ = standard("body-joints-alone")
    somewhere = built("body-joints-alone", start=1).start
    assert alone.problem.linearize(somewhere).rank == 53
    with_priors, _ = standard("body-joints")
    assert with_priors.problem.linearize(somewhere).rank == 85


@pytest.mark.thorough
def test_bounds_are_active_at_the_known_answer() -> None:
    setup, known = standard("body-bounds")
    assert known.values is not None
    assert known.cost is not None
    x, fixed = setup.problem.split(setup.start | known.values)
    lower, upper = setup.problem.lower, setup.problem.upper
    assert ((x >= lower) & (x <= upper)).all()
    active = np.minimum(x - lower, upper - x) < 1e-4
    assert 8 < active.sum() < 40
    inside = np.clip(x, lower + 1e-3, upper - 1e-3)
    peer = least_squares(
        lambda x: setup.problem.residual(x, fixed),
        inside,
        lambda x: setup.problem.linearize_at(x, fixed).jacobian,
        (lower, upper),
        ftol=1e-14,
        xtol=1e-14,
        gtol=1e-14,
        max_nfev=2000,
    )
    assert peer.cost == pytest.approx(known.cost, rel=1e-6)
    assert peer.cost > known.cost * (1 - 1e-9)


@pytest.mark.thorough
def test_robust_kernels_see_past_outliers() -> None:
    off = {}
    for kernel in ("", "-huber", "-geman-mcclure"):
        setup, known = standard(f"body-outliers{kernel}")
        assert known.values is not None
        measured = {m.name: m.value for m in setup.measures(setup.start | known.values)}
        off[kernel] = measured["vertex to synthetic truth, rms"]
    assert max(off["-geman-mcclure"], off["-huber"]) < 10 < 30 < off[""]  # mm


def test_cameras_see_the_person_upright() -> None:
    for name in ("body-one-camera", "body-four-cameras"):
        setup, known = standard(name)
        assert setup.body is not None
        assert known.values is not None
        for view in setup.views:
            assert ((view.observed > 0) & (view.observed < view.size)).all()
            height = np.ptp(view.observed[:, 1])
            assert 300 < height < 700
            names = setup.body.landmark_names(view.landmarks)
            v = dict(zip(names, view.observed[:, 1], strict=True))
            assert v["nose"] < v["left_hip"] < v["left_ankle"]  # v points down
    front = standard("body-one-camera")[0].views[0]
    u = dict(zip(names, front.observed[:, 0], strict=True))
    assert u["left_shoulder"] > u["right_shoulder"]  # the person faces it


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
