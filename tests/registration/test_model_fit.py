"""Bodies on scans that nobody labelled: what is found, what is doubted, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting import BadScan, Scan
from workbench.fitting.body_priors import pose_gaussian
from workbench.registration import (
    FitStage,
    ModelFit,
    Progress,
    arms_lowered,
    doubts,
    fit_model,
    scan_starts,
    support,
)
from workbench.solvers import Hypothesis, Status

FIT_STAGES = (FitStage(200, 0.05, 0.10, 8, 15), FitStage(600, 0.005, 0.03, 2, 40, 0.001))
TURN, PLACE = 2.0, np.array([0.3, -0.1, 0.2])


@pytest.fixture(scope="module")
def body() -> SkinnedBody:
    return load_body("small")


def points_on(body: SkinnedBody, vertices: Array, n: int = 800) -> Scan:
    """Points of the surface, drawn by area, with normals."""
    a, b, c = vertices[body.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    rng = np.random.default_rng(0)
    face = rng.choice(len(areas), n, p=areas / areas.sum())
    shares = rng.dirichlet((1.0, 1.0, 1.0), n)
    points = np.einsum("mk,mki->mi", shares, vertices[body.faces[face]])
    return Scan(points, normals[face] / areas[face, None])


@pytest.fixture(scope="module")
def truth(body: SkinnedBody) -> Array:
    pose = arms_lowered(body, 0.9)
    pose[0] = [0.0, TURN, 0.0]
    pose[body.joint_names.index("left_knee")] = [0.4, 0.0, 0.0]
    return body.vertices(pose, np.zeros(body.n_betas), PLACE)


@pytest.fixture(scope="module")
def fit(body: SkinnedBody, truth: Array) -> ModelFit:
    return fit_model(
        body,
        points_on(body, truth),
        stages=FIT_STAGES,
        starts=lambda body, scan: scan_starts(body, scan, yaws=4),
    )


def test_body_is_recovered_from_a_clean_scan(fit: ModelFit, truth: Array) -> None:
    assert np.linalg.norm(fit.vertices() - truth, axis=1).mean() < 0.01
    costs = [one.cost for one in fit.hypotheses]
    assert costs == sorted(costs)
    assert not fit.stopped


def test_clean_fit_is_not_doubted(fit: ModelFit) -> None:
    known = support(fit)
    assert known.touching.mean() > 0.95
    assert not doubts(fit, known)
    assert known.contacts.sum() == 3 * known.touching.sum()
    assert 0 < known.mean_sd < 0.01


@pytest.mark.thorough
def test_unseen_vertices_rest_on_the_prior(body: SkinnedBody, truth: Array) -> None:
    scan = points_on(body, truth)
    low = scan.points[:, 1] < np.median(truth[:, 1])  # nothing of the arms
    seen = fit_model(
        body,
        scan,
        keep=low,
        stages=FIT_STAGES[1:],
        starts=lambda b, s: scan_starts(b, s, yaws=1, arms=(0.9,)),
    )
    assert seen.scan.n_points == low.sum()
    known = support(seen)
    assert known.sd[~known.seen].mean() > 3 * known.sd[known.seen].mean()


@pytest.mark.thorough
def test_vertex_spread_matches_laplace_draws(fit: ModelFit) -> None:
    """Draws from Laplace's covariance scatter the vertices as `sd` says."""
    C = fit.problem.linearize(fit.values).covariance
    x, fixed = fit.problem.split(fit.values)
    rng = np.random.default_rng(1)
    drawn = [
        fit.body.vertices(*(v[b.name] for b in fit.body.blocks()))
        for v in (
            fit.problem.values(x + 0.1 * d, fixed)
            for d in rng.multivariate_normal(np.zeros(len(x)), C, 400)
        )
    ]
    scatter = 10 * np.sqrt(np.var(np.stack(drawn), axis=0).sum(axis=1))
    np.testing.assert_allclose(scatter, support(fit).sd, rtol=0.15)


def test_facings_of_equal_cost_are_doubted(fit: ModelFit) -> None:
    turned = {**fit.values, "pose": fit.values["pose"].copy()}
    turned["pose"][0] = [0.0, TURN + np.pi, 0.0]
    twin = Hypothesis(turned, 1.001 * fit.cost, Status.CONVERGED, (1,))
    tied = ModelFit(fit.body, fit.scan, fit.problem, fit.reach, (fit.hypotheses[0], twin), 0, 0.0)
    (found,) = doubts(tied)
    assert "which way the body faces is not decided: turned by 180 degrees" in found


@pytest.mark.thorough
def test_unusual_unseen_poses_are_doubted(fit: ModelFit) -> None:
    """Where more was seen, the scan says that the pose is right."""
    known = support(fit)
    unseen = replace(known, seen=np.zeros_like(known.seen))
    deviations = np.sqrt(np.diag(pose_gaussian(fit.body)[1])).reshape(-1, 3)
    bent = {**fit.values, "pose": fit.values["pose"].copy()}
    bent["pose"][1:] += 2 * deviations
    there = replace(fit, hypotheses=(replace(fit.hypotheses[0], values=bent),))
    told = [
        any("people seldom stand like this" in doubt for doubt in doubts(what, seen))
        for what, seen in ((there, unseen), (there, known), (fit, unseen))
    ]
    assert told == [True, False, False]


def test_scans_of_something_else_are_doubted(body: SkinnedBody) -> None:
    ball = np.random.default_rng(0).standard_normal((400, 3))
    scan = Scan(0.8 * ball / np.linalg.norm(ball, axis=1)[:, None])
    fit = fit_model(body, scan, stages=(FitStage(200, 0.02, 0.05, 2, 10),))
    assert any("touch no surface" in doubt for doubt in doubts(fit))


def test_body_before_the_scan_is_doubted(fit: ModelFit, truth: Array) -> None:
    away = ModelFit(
        fit.body,
        Scan(fit.scan.points - [0.0, 0.0, 0.3]),
        fit.problem,
        fit.reach,
        fit.hypotheses[:1],
        0,
        0.0,
    )
    near, behind = (
        any("where the camera would have seen" in d for d in doubts(away, camera=[0.0, 0.0, z]))
        for z in (3.0, -3.0)
    )
    assert near
    assert not behind


@pytest.mark.parametrize("angle", [0.5])
def test_arms_point_below_the_horizontal(body: SkinnedBody, angle: float) -> None:
    joints = body.joints(arms_lowered(body, angle))
    names = body.joint_names
    for side in ("left", "right"):
        x, y, _ = joints[names.index(f"{side}_wrist")] - joints[names.index(f"{side}_shoulder")]
        assert np.arctan2(-y, abs(x)) == pytest.approx(angle, abs=1e-9)


def test_progress_can_stop_a_fit(body: SkinnedBody, truth: Array) -> None:
    told: list[Progress] = []

    def stop(one: Progress) -> bool:
        told.append(one)
        return len(told) == 3

    fit = fit_model(body, points_on(body, truth), progress=stop)
    assert len(told) == 3
    assert told[0].stages == 3
    assert told[0].starts == 24
    assert "callback" in fit.stopped
    assert np.isfinite(fit.cost)
    assert any("did not end by itself" in doubt for doubt in doubts(fit))


def test_bad_scans_of_fits_are_refused(body: SkinnedBody) -> None:
    for points, said in [
        (np.zeros((5, 3)), "at least 20 points, but the scan has 5"),
        (np.zeros((30, 3)), "points are expected in metres"),
        (1700 * np.random.default_rng(0).random((30, 3)), "millimetres look 1000 times too large"),
    ]:
        with pytest.raises(BadScan, match=said):
            fit_model(body, Scan(points))


def test_bad_fit_settings_are_refused(body: SkinnedBody, truth: Array) -> None:
    scan = points_on(body, truth)
    with pytest.raises(BadArgument, match="at least one stage"):
        fit_model(body, scan, stages=())
    with pytest.raises(BadArgument, match="no start"):
        fit_model(body, scan, starts=lambda body, scan: ())
    with pytest.raises(BadArgument, match="one facing"):
        scan_starts(body, scan, yaws=0)
    with pytest.raises(BadArgument, match="above zero"):
        FitStage(0, 0.1, 0.1, 1, 1)
    with pytest.raises(BadArgument, match="limbs 0 or more"):
        FitStage(1, 0.1, 0.1, 1, 1, limbs=-1)


@pytest.mark.parametrize("reach", [0.03])
def test_point_at_the_surface_lowers_cost_by_its_reach(body: SkinnedBody, reach: float) -> None:
    """Half the square of reach / sigma, compared with a point far away."""
    arguments = (body.bind_pose, np.zeros(body.n_betas), np.zeros(3))
    here = dict(zip((block.name for block in body.blocks()), arguments, strict=True))
    surface, stage = body.vertices(*arguments), FitStage(1000, 0.005, reach, 1, 1)

    def cost(more: Array) -> float:
        scan = Scan(np.concatenate([surface[:100], more]))
        fit = fit_model(body, scan, stages=(stage,), starts=lambda body, scan: (here,))
        return fit.problem.linearize(here).cost

    lowered = cost(surface[:1] + 100.0) - cost(surface[:1])
    assert lowered == pytest.approx((reach / stage.sigma) ** 2 / 2, rel=0.01)
