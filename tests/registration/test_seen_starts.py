"""Fits to what one camera saw: where they begin, and what they are kept out of."""

from dataclasses import replace

import numpy as np
import pytest

from tests.registration.clouds import PLACE, TURN, cloud, from_one_side, person
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting import Scan, loose_points
from workbench.registration import (
    FitStage,
    Recipe,
    arms_lowered,
    doubts,
    facing,
    fit_model,
    model_alone,
    register,
    scan_starts,
    seen_starts,
)
from workbench.registration.from_a_camera import KEPT_OUT, sees, start_poses

STAGE = FitStage(200, 0.02, 0.05, 3, 12)
FRONT = np.array([np.sin(TURN), 0.0, np.cos(TURN)])  # where the person faces


@pytest.fixture(scope="module")
def body() -> SkinnedBody:
    return load_body("small")


@pytest.fixture(scope="module")
def truth(body: SkinnedBody) -> Array:
    return person(body)


@pytest.fixture(scope="module")
def camera(truth: Array) -> Array:
    return np.asarray(truth.mean(axis=0) + 2.5 * FRONT)


@pytest.fixture(scope="module")
def half(body: SkinnedBody, truth: Array) -> Scan:
    return from_one_side(cloud(body, truth, 2500), FRONT)


@pytest.mark.parametrize("name", ["small"])
def test_start_poses_are_reproducible(name: str) -> None:
    body = load_body(name)
    poses = start_poses(body, draws=5)
    assert poses.shape[1:] == (body.n_joints - 1, 3)
    assert len(poses) == (9 if name == "small" else 1) + 5
    np.testing.assert_array_equal(poses, start_poses(body, draws=5))


@pytest.mark.thorough
def test_seen_starts_face_the_camera(
    body: SkinnedBody, truth: Array, half: Scan, camera: Array
) -> None:
    given = scan_starts(body, half)
    found = seen_starts(body, half, camera, given, 4)
    assert len(found) == 4
    surfaces = [body.vertices(*(one[name] for name in ("pose", "betas", "trans"))) for one in found]
    for one in found[:2]:
        assert facing(one["pose"][0], body.bind_pose[0]) @ FRONT > np.cos(np.pi / 4) - 1e-9
    off = [np.linalg.norm(one - truth, axis=1).mean() for one in surfaces]
    of_given = [np.linalg.norm(body.vertices(**one) - truth, axis=1).mean() for one in given]
    assert min(off) < min(of_given)


def test_camera_sees_what_is_before_it(half: Scan, camera: Array) -> None:
    assert sees(camera, half.points)
    assert not sees(np.median(half.points, axis=0), half.points)
    assert not sees(half.points[0], half.points)


@pytest.mark.thorough
def test_empty_space_needs_a_camera(
    body: SkinnedBody, half: Scan, camera: Array, truth: Array
) -> None:
    """What `keep` leaves out of the fit was seen, and what is behind it may be there."""
    few = np.random.default_rng(0).random(half.n_points) < 0.3
    one = replace(STAGE, starts=1, iterations=4)
    fits = [
        fit_model(body, half, keep=few, stages=(one,), **given)
        for given in ({}, {"camera": camera})
    ]
    rows = [fit.problem.rows.get("empty space", slice(0, 0)) for fit in fits]
    assert [one.stop - one.start for one in rows] == [0, KEPT_OUT]
    assert [fit.scan.n_points for fit in fits] == [few.sum(), np.sum(few & ~loose_points(half))]


@pytest.mark.thorough
def test_body_beside_the_scan_is_brought_behind_it(
    body: SkinnedBody, half: Scan, camera: Array
) -> None:
    """Far points let it stand anywhere, but the camera would have seen it there."""
    start = seen_starts(body, half, camera, scan_starts(body, half), 1)[0]
    aside = start["trans"] + 0.5 * np.cross(FRONT, [0.0, 1.0, 0.0])
    stage = FitStage(200, 0.02, 0.02, 1, 15)
    off = []
    for given in (None, camera):
        fit = fit_model(
            body,
            half,
            camera=given,
            starts=lambda body, scan: ({**start, "trans": aside},),
            stages=(stage,),
        )
        off.append(np.linalg.norm(fit.values["trans"] - start["trans"]))
    assert off[1] < 0.15 < off[0]


@pytest.mark.thorough
def test_camera_among_the_points_is_doubted(body: SkinnedBody, half: Scan, camera: Array) -> None:
    recipe = Recipe((replace(STAGE, starts=1, iterations=3),), model_alone)
    told = [
        register(body, half, recipe=recipe, camera=place).doubts
        for place in (camera, half.points.mean(axis=0))
    ]
    assert [any("stands among the points" in text for text in one) for one in told] == [False, True]
    with pytest.raises(BadArgument, match="stands among the points"):
        fit_model(body, half, camera=half.points.mean(axis=0))


@pytest.mark.thorough
def test_missed_part_of_a_scan_is_doubted(body: SkinnedBody, truth: Array, half: Scan) -> None:
    """As many loose points are none."""
    stage = FitStage(300, 0.01, 0.03, 1, 30)
    rng = np.random.default_rng(0)
    limb = half.points[rng.permutation(half.n_points)[:60]] * 0.1 + [1.0, 0.5, 0.0]
    strewn = rng.uniform(-1, 1, (60, 3)) + [0.0, 0.0, 3.0]
    told = []
    for more in (limb, strewn):
        scan = Scan(
            np.vstack([half.points, more]), np.vstack([half.normals, np.tile(FRONT, (60, 1))])
        )
        fit = fit_model(body, scan, starts=lambda b, s: scan_starts(b, s, yaws=1), stages=(stage,))
        close = replace(fit, hypotheses=(replace(fit.hypotheses[0], values=near(body)),))
        told.append(any("lie side by side" in doubt for doubt in doubts(close)))
    assert told == [True, False]


def near(body: SkinnedBody) -> dict[str, Array]:
    """The values of `clouds.person`."""
    pose = arms_lowered(body, 0.9)
    pose[0] = [0.0, TURN, 0.0]
    pose[body.joint_names.index("left_knee")] = [0.4, 0.0, 0.0]
    return {"pose": pose, "betas": np.zeros(body.n_betas), "trans": PLACE}
