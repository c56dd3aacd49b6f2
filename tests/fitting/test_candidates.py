"""Cameras, keypoints, markers and poses as candidates, against residuals written by hand."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.fitting import default_markers
from workbench.fitting.body_priors import pose_prior, shape_prior, stature
from workbench.fitting.candidates import (
    cameras_of,
    cameras_on_a_sphere,
    depth_of,
    looking_at,
    marker_candidates,
    stature_of,
)
from workbench.fitting.keypoints import landmark_set
from workbench.fitting.observations import photograph
from workbench.geometry.camera import Camera

SEEN = 0.1  # rad, of a pose


BODY = wb.load_body("small")
RNG = np.random.default_rng(0)
AT: wb.Values = {
    "pose": SEEN * RNG.normal(size=(24, 3)),
    "betas": RNG.normal(size=BODY.n_betas),
    "trans": np.array([0.3, 0.0, -0.2]),
}
ROOT = BODY.joints(**AT)[0]
PLACE = wb.residuals.gaussian(BODY.blocks()[2].symbol, covariance=4.0, unit="m", name="place")
PROBLEM = wb.Problem([pose_prior(BODY), shape_prior(BODY), PLACE], list(AT), blocks=BODY.blocks())


def test_candidate_cameras_look_at_the_centre() -> None:
    centre = np.array([0.5, 1.0, -2.0])
    camera = Camera("a/")
    K = np.array([[1000.0, 0, 500], [0, 1000, 400], [0, 0, 1]])
    for around, up in ((0, 0), (90, 0), (200, 40), (30, 89)):
        R, t = looking_at(centre, around, up, 3.0)
        numbers = camera.values(K=K, R=R, t=t)
        np.testing.assert_allclose(camera.pixels(centre, numbers), [500, 400], atol=1e-9)
        assert camera.depths(centre, numbers) == pytest.approx(3.0)
        above = camera.pixels(centre + [0, 0.1, 0], numbers)
        assert above[1] < 400  # upright
        assert above[0] == pytest.approx(500, abs=1e-6)
        place = -R.T @ t - centre
        assert np.degrees(np.arcsin(place[1] / 3)) == pytest.approx(up)
        assert np.degrees(np.arctan2(place[0], place[2])) % 360 == pytest.approx(around)


@pytest.mark.thorough
def test_camera_candidate_equals_its_keypoint_residual() -> None:
    """As if the camera had been put up and its keypoints fitted."""
    several = cameras_on_a_sphere(BODY, ROOT, around=(0, 90), up=(10,), sigma=3.0)
    assert list(several) == ["0 around, 10 up", "90 around, 10 up"]
    found = wb.design(PROBLEM, several, AT)
    camera, name = Camera("real/"), landmark_set(BODY)
    R, t = looking_at(ROOT, 90, 10, 4.0)
    K = np.array([[1200.0, 0, 500], [0, 1200, 500], [0, 0, 1]])
    numbers = camera.values(K=K, R=R, t=t)
    points = BODY.landmark_points(name, *(block.symbol for block in BODY.blocks()))
    pixels = camera.pixels(BODY.landmark(name, **AT), numbers)
    term = wb.residuals.keypoints(points, camera, pixels, np.ones(len(pixels)), sigma=3.0)
    blocks = (*BODY.blocks(), *camera.blocks)
    whole = wb.Problem([*PROBLEM.residuals, term], PROBLEM.free.names, blocks=blocks)
    sd = np.sqrt(np.diag(whole.linearize(AT | numbers).covariance))
    one = wb.design(PROBLEM, {"it": several["90 around, 10 up"]}, AT)
    np.testing.assert_allclose(one.sd_after, sd, rtol=1e-7)
    assert found.after.sd <= one.after.sd
    photo = photograph("it", (1000, 1000), np.ones((3, 3)), {"K": K, "R": R, "t": t})
    same = wb.design(PROBLEM, cameras_of(BODY, [photo], sigma=3.0), AT)
    np.testing.assert_allclose(same.sd_after, sd, rtol=1e-7)
    depth = wb.design(PROBLEM, several, AT, criterion=wb.sd_of(depth_of(BODY, camera, numbers)))
    assert depth.best == "0 around, 10 up"  # across the view that depth is of
    with pytest.raises(BadArgument, match="has no calibration"):
        cameras_of(BODY, [photograph("it", (9, 9), np.ones((3, 3)))])
    with pytest.raises(BadArgument, match="centre of the cameras"):
        cameras_on_a_sphere(BODY, [0, 0])
    with pytest.raises(BadArgument, match="distance of cameras"):
        cameras_on_a_sphere(BODY, ROOT, distance=0)


@pytest.mark.thorough
def test_marker_candidates_determine_stature() -> None:
    worn = default_markers(BODY)
    several = marker_candidates(BODY, worn, sigma=0.003, offset_sigma=0.004)
    assert tuple(several) == worn.names
    height = stature_of(BODY)
    found = wb.design(PROBLEM, several, AT, choose=2, criterion=wb.sd_of(height))
    slope = stature(BODY, np.eye(BODY.n_betas)) - stature(BODY, np.zeros(BODY.n_betas))
    assert found.before.sd == pytest.approx(np.linalg.norm(slope), rel=1e-8)  # of the prior
    assert found.after.sd < found.steps[0].sd < found.before.sd
    up = {name: found.ranking[i].sd for i, name in enumerate(r.name for r in found.ranking)}
    assert len(up) == 41
    place = wb.diagnostics.with_candidates(PROBLEM, several, ["C7"])
    seen = place.residuals[-1]
    rows = place.linearize(AT).dense[place.rows["C7"]]
    trans = rows[:, place.free.slices["trans"]]
    lengths = np.linalg.norm(trans, axis=0)
    np.testing.assert_allclose(lengths, 1 / 0.005, rtol=1e-9)  # 3-4-5
    assert seen.size == 3 * 41
