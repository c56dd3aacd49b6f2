"""The distance of a person in one image, and how uncertain it is."""

from dataclasses import replace

import numpy as np
import pytest

from tests.fitting.test_image_fit import BODY, person, seen
from workbench import LevenbergMarquardt, Values
from workbench.fitting.body_priors import stature
from workbench.fitting.images import (
    INTERVAL_NOTE,
    Z90,
    ByHeight,
    WithStature,
    depth_interval,
    depth_spread,
    image_fit,
)
from workbench.fitting.keypoints import as_marked
from workbench.fitting.observations import Observations
from workbench.fitting.setup import Setup

PRECISE = LevenbergMarquardt(gradient_tolerance=1e-9)


def fitted(observed: Observations, recipe: ByHeight | None = None) -> tuple[Setup, Values]:
    setup = image_fit(observed, BODY, "q", recipe=recipe or ByHeight(solver=PRECISE))
    assert setup.strategy is not None
    solution = setup.strategy(None).solve(setup.problem, setup.start)
    return setup, setup.start | solution.values


def root_depth(setup: Setup, values: Values) -> float:
    root = BODY.joints(*(values[name] for name in ("pose", "betas", "trans")))[:1]
    return float(setup.views[0].camera.depths(root, values)[0])


@pytest.fixture(scope="module")
def one() -> tuple[Setup, Values]:
    return fitted(seen(person(1)))


def test_depth_without_offsets_is_laplace(one: tuple[Setup, Values]) -> None:
    """The camera looks along -z from 4 m: depth is 4 - root_z, linear in betas and trans."""
    setup, values = one
    found = depth_interval(setup, values, 0.0)
    assert found is not None
    assert found.mean == pytest.approx(root_depth(setup, values))
    free = setup.problem.free
    gradient = np.zeros(free.size)
    gradient[free.slices["trans"]] = [0, 0, -1]
    rest = BODY.joints(betas=np.zeros(BODY.n_betas))[0, 2]
    gradient[free.slices["betas"]] = [
        rest - BODY.joints(betas=unit)[0, 2] for unit in np.eye(BODY.n_betas)
    ]
    covariance = setup.problem.linearize(values).covariance
    assert found.sd == pytest.approx(np.sqrt(gradient @ covariance @ gradient), rel=1e-6)
    assert found.high - found.low == pytest.approx(2 * Z90 * found.sd)
    wider = depth_interval(setup, values)
    assert wider is not None
    assert wider.sd > found.sd
    assert f"{wider.low:.2f} to {wider.high:.2f} m" in str(wider)


@pytest.mark.thorough
def test_depth_lever_matches_refits(one: tuple[Setup, Values]) -> None:
    """Keypoints are moved one after another, and Gauss and Newton's step follows them; the whole
    fit does so up to the curvature that this method leaves out.
    """
    setup, values = one
    view, free = setup.views[0], setup.problem.free
    found, _, lever = depth_spread(setup, view, values)
    before, moves, refitted = root_depth(setup, values), [], []
    for k, axis in np.ndindex(*view.observed.shape):
        observed = values["one/observed"].copy()
        observed[k, axis] += 0.01
        start = values | {"one/observed": observed}
        step = setup.problem.linearize(start).step(0.0)
        after = values | free.unpack(free.pack(values) + step, values)
        moves.append((root_depth(setup, after) - before) / 0.01)
        if k < 3:
            again = start | PRECISE.solve(setup.problem, start).values
            refitted.append((root_depth(setup, again) - before) / 0.01)
    of_a_metre = values["one/focal"].mean() / before  # px
    assert found == pytest.approx(before)
    relative = np.repeat(as_marked(BODY.landmark_names("coco")), 2)  # all have the confidence 1
    expected = of_a_metre * np.linalg.norm(relative * moves)
    assert lever == pytest.approx(expected, rel=1e-2)
    assert np.linalg.norm(moves[:6]) == pytest.approx(np.linalg.norm(refitted), rel=0.25)


@pytest.mark.thorough
def test_known_stature_narrows_depth(one: tuple[Setup, Values]) -> None:
    photo = seen(person(1)).photographs[0]
    unknown_lens = Observations(tuple(BODY.landmark_names("coco")), (replace(photo, K=None),))
    tall = float(stature(BODY, person(1)["betas"]))
    known = ByHeight(solver=PRECISE, priors=WithStature(tall))
    each = [one, fitted(seen(person(1)), known), fitted(unknown_lens)]
    usual, narrow, wide = (depth_interval(*some) for some in each)
    assert usual is not None
    assert narrow is not None
    assert wide is not None
    assert narrow.sd < usual.sd < 0.5 * wide.sd


def test_fit_of_one_image_measures_depth(one: tuple[Setup, Values]) -> None:
    setup, values = one
    told = {measure.name: measure for measure in setup.measures(values)}
    found = depth_interval(setup, values)
    assert found is not None
    of = "distance from the camera"
    ends = [told[f"{of}, {end} end of the 90 % interval"].value for end in ("lower", "upper")]
    assert [told[of].value, *ends] == [found.mean, found.low, found.high]
    assert INTERVAL_NOTE in setup.notes


def test_two_images_have_no_depth_interval() -> None:
    truth = person(2)
    shots = [seen(truth, name=name).photographs[0] for name in ("one", "two")]
    both = Observations(tuple(BODY.landmark_names("coco")), tuple(shots))
    setup = image_fit(both, BODY, "q")
    assert depth_interval(setup, setup.start) is None
    assert INTERVAL_NOTE not in setup.notes
    out = image_fit(both, BODY, "q", held_out=("two",))
    assert depth_interval(out, out.start) is not None
