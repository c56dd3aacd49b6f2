"""Bodies on scans that nobody labelled: what is found, where it begins, and what is doubted."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from tests.registration.clouds import TURN, cloud, from_one_side, person, standing
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.fitting import BadScan, Scan
from workbench.registration import (
    FitProgress,
    FitStage,
    ModelFit,
    Recipe,
    doubts,
    facing,
    fit_model,
    register,
    scan_starts,
    seen_starts,
    support,
)
from workbench.registration.free_vertices import BLOCKS
from workbench.registration.model_fit import limbs, with_limb
from workbench.solvers import Hypothesis, Status

FIT_STAGES = (FitStage(200, 0.05, 0.10, 8, 15), FitStage(600, 0.005, 0.03, 2, 40, 0.001))
BODY = load_body("small")
NAMES = BODY.joint_names
TRUTH = person(BODY)
SCAN = cloud(BODY, TRUTH)
FRONT = np.array([np.sin(TURN), 0.0, np.cos(TURN)])  # where the person faces
CAMERA: Array = TRUTH.mean(axis=0) + 2.5 * FRONT
HALF = from_one_side(cloud(BODY, TRUTH, 2500), FRONT)
STAGE = FitStage(200, 0.02, 0.05, 1, 4)


def off(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other, axis=1).mean())


@pytest.fixture(scope="module")
def fit() -> ModelFit:
    return fit_model(
        BODY, SCAN, stages=FIT_STAGES, starts=lambda body, scan: scan_starts(body, scan, yaws=4)
    )


def test_body_is_recovered_from_a_clean_scan(fit: ModelFit) -> None:
    assert off(fit.vertices(), TRUTH) < 0.01
    costs = [one.cost for one in fit.hypotheses]
    assert costs == sorted(costs)
    known = support(fit)
    assert not doubts(fit, known)
    assert known.touching.mean() > 0.95
    assert known.contacts.sum() == 3 * known.touching.sum()
    assert 0 < known.mean_sd < 0.01


@pytest.mark.thorough
def test_vertex_spread_matches_laplace_draws(fit: ModelFit) -> None:
    """Draws from Laplace's covariance scatter the vertices as `sd` says."""
    C = fit.problem.linearize(fit.values).covariance
    x, fixed = fit.problem.split(fit.values)
    steps = 0.1 * np.random.default_rng(1).multivariate_normal(np.zeros(len(x)), C, 400)
    drawn = [fit.problem.values(x + step, fixed) for step in steps]
    surfaces = [BODY.vertices(*(one[name] for name in BLOCKS)) for one in drawn]
    scatter = 10 * np.sqrt(np.var(surfaces, axis=0).sum(axis=1))
    np.testing.assert_allclose(scatter, support(fit).sd, rtol=0.15)


def test_facings_of_equal_cost_are_doubted(fit: ModelFit) -> None:
    turned = {**fit.values, "pose": fit.values["pose"].copy()}
    turned["pose"][0] = [0.0, TURN + np.pi, 0.0]
    twin = Hypothesis(turned, 1.001 * fit.cost, Status.CONVERGED, (1,))
    (told,) = doubts(replace(fit, hypotheses=(fit.hypotheses[0], twin)))
    assert "which way the body faces is not decided: turned by 180 degrees" in told


def test_scans_of_something_else_are_doubted() -> None:
    ball = np.random.default_rng(0).standard_normal((400, 3))
    scan = Scan(0.8 * ball / np.linalg.norm(ball, axis=1)[:, None])
    fit = fit_model(BODY, scan, stages=(FitStage(200, 0.02, 0.05, 2, 10),))
    assert any("touch no surface" in doubt for doubt in doubts(fit))


def test_body_before_the_scan_is_doubted(fit: ModelFit) -> None:
    behind = replace(fit, scan=Scan(fit.scan.points - [0.0, 0.0, 0.3]))
    told = [
        any("where the camera would have seen" in d for d in doubts(behind, camera=[0, 0, z]))
        for z in (3.0, -3.0)
    ]
    assert told == [True, False]


def test_progress_can_stop_a_fit() -> None:
    told: list[FitProgress] = []

    def stop(one: FitProgress) -> bool:
        told.append(one)
        return len(told) == 3

    fit = fit_model(BODY, SCAN, progress=stop)
    assert [(one.stages, one.starts) for one in told] == [(3, 24)] * 3
    assert "callback" in fit.stopped
    assert np.isfinite(fit.cost)
    assert any("did not end by itself" in doubt for doubt in doubts(fit))


def test_bad_scans_of_fits_are_refused() -> None:
    for points, said in [
        (np.zeros((5, 3)), "at least 20 points, but the scan has 5"),
        (np.zeros((30, 3)), "points are expected in metres"),
        (1700 * np.random.default_rng(0).random((30, 3)), "millimetres look 1000 times too large"),
    ]:
        with pytest.raises(BadScan, match=said):
            fit_model(BODY, Scan(points))


def test_bad_fit_settings_are_refused() -> None:
    for bad, said in [
        (lambda: fit_model(BODY, SCAN, stages=()), "at least one stage"),
        (lambda: fit_model(BODY, SCAN, starts=lambda body, scan: ()), "no start"),
        (lambda: fit_model(BODY, HALF, camera=HALF.points.mean(axis=0)), "among the points"),
        (lambda: scan_starts(BODY, SCAN, yaws=0), "one facing"),
        (lambda: FitStage(0, 0.1, 0.1, 1, 1), "points of a stage must be"),
        (lambda: FitStage(1, 0.1, 0.1, 1, 1, limbs=-1), "limbs of a stage"),
    ]:
        with pytest.raises(BadArgument, match=said):
            bad()


# Limbs that are folded the wrong way.


def test_limbs_are_arms_and_legs() -> None:
    firsts = {NAMES[limb[0]]: limb for limb in limbs(BODY.parents)}
    joints = ("hip", "knee", "collar", "shoulder", "elbow")
    assert firsts.keys() == {f"{side}_{joint}" for side in ("left", "right") for joint in joints}
    forearm = [NAMES[joint] for joint in firsts["left_elbow"]]
    assert forearm == ["left_elbow", "left_wrist", "left_hand"]
    pose, other = np.random.default_rng(0).standard_normal((2, 24, 3))
    moved, limb = with_limb(pose, firsts["left_elbow"], other[1:]), list(firsts["left_elbow"])
    np.testing.assert_array_equal(moved[limb], other[limb])
    np.testing.assert_array_equal(np.delete(moved, limb, axis=0), np.delete(pose, limb, axis=0))


def folded() -> tuple[Values, Values, Scan]:
    """A person with a bent elbow, the same with the forearm folded wrongly, and a scan."""
    there, wrong, elbow = BODY.start(), BODY.start(), NAMES.index("left_elbow")
    there["pose"][elbow], wrong["pose"][elbow] = [0, -1.2, 0], [0, 0.5, -2]
    return there, wrong, cloud(BODY, BODY.vertices(**there), areas=True)


@pytest.mark.thorough
def test_fit_tries_other_poses_of_limbs() -> None:
    """What it finds takes the place of the hypothesis that it comes from, and tells its start."""
    there, start, scan = folded()
    stage = FitStage(800, 0.01, 0.06, 1, 20, 0.002)
    fits = [
        fit_model(BODY, scan, starts=lambda body, scan: (start,), stages=(one,))
        for one in (stage, replace(stage, limbs=1))
    ]
    assert fits[1].cost < 0.95 * fits[0].cost
    hand = NAMES.index("left_hand")
    away = [
        BODY.joints(*(fit.values[name] for name in BLOCKS))[hand] - BODY.joints(**there)[hand]
        for fit in fits
    ]
    assert np.linalg.norm(away[1]) < 0.03 < np.linalg.norm(away[0])
    assert fits[1].iterations > 2 * fits[0].iterations
    for fit in fits:
        assert [one.starts for one in fit.hypotheses] == [(0,)]
        here = fit.problem.linearize(fit.values)
        assert here.cost == pytest.approx(fit.cost)  # of the stage's own problem


# What one camera saw.


@pytest.mark.thorough
def test_seen_starts_face_the_camera() -> None:
    starts = scan_starts(BODY, HALF)
    best = seen_starts(BODY, HALF, CAMERA, starts, 4)
    assert len(best) == 4
    for one in best[:2]:
        assert facing(one["pose"][0], BODY.bind_pose[0]) @ FRONT > np.cos(np.pi / 4) - 1e-9
    nearest = [min(off(BODY.vertices(**one), TRUTH) for one in some) for some in (best, starts)]
    assert nearest[0] < nearest[1]


@pytest.mark.thorough
def test_body_beside_the_scan_is_brought_behind_it() -> None:
    """Far points let it stand anywhere, but the camera would have seen it there."""
    start = seen_starts(BODY, HALF, CAMERA, scan_starts(BODY, HALF), 1)[0]
    aside = {**start, "trans": start["trans"] + 0.5 * np.cross(FRONT, [0.0, 1.0, 0.0])}
    stages, away = (FitStage(200, 0.02, 0.02, 1, 15),), []
    for camera in (None, CAMERA):
        fit = fit_model(BODY, HALF, camera=camera, starts=lambda *_: (aside,), stages=stages)
        away.append(np.linalg.norm(fit.values["trans"] - start["trans"]))
    assert away[1] < 0.15 < away[0]


@pytest.mark.thorough
def test_camera_among_the_points_is_doubted() -> None:
    recipe = Recipe((STAGE,), ())
    told = [
        " ".join(register(BODY, HALF, recipe=recipe, camera=place).doubts)
        for place in (CAMERA, HALF.points.mean(axis=0))
    ]
    assert ["stands among the points" in doubt for doubt in told] == [False, True]


def test_scan_of_the_body_itself_is_not_doubted() -> None:
    """Vertices of its hands are off by a centimetre: many points, and hardly any area."""
    scan = Scan.of(trimesh.Trimesh(BODY.vertices(), BODY.faces, process=False))
    assert doubts(fit_model(BODY, scan)) == ()


@pytest.mark.thorough
def test_missed_part_of_a_scan_is_doubted() -> None:
    """As many loose points are none."""
    stages, rng, told = (FitStage(300, 0.01, 0.03, 1, 30),), np.random.default_rng(0), []
    limb = HALF.points[rng.permutation(HALF.n_points)[:60]] * 0.1 + [1.0, 0.5, 0.0]
    strewn = rng.uniform(-1, 1, (60, 3)) + [0.0, 0.0, 3.0]
    for more in (limb, strewn):
        normals = np.vstack([HALF.normals, np.tile(FRONT, (60, 1))])
        scan = Scan(np.vstack([HALF.points, more]), normals)
        fit = fit_model(BODY, scan, starts=lambda b, s: scan_starts(b, s, yaws=1), stages=stages)
        close = replace(fit, hypotheses=(replace(fit.hypotheses[0], values=standing(BODY)),))
        told.append(any("lie side by side" in doubt for doubt in doubts(close)))
    assert told == [True, False]
