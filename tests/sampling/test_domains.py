"""Posteriors end where a residual means nothing: no draw is behind a camera.

A pinhole projects p and -p to the same pixel. A flat square that faces the camera therefore has
the same image from in front, and from behind after half a turn about the camera's axis.
"""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.compilers import NEEDS_A_COMPILER
from tests.sampling.test_modes import target_of
from workbench.diagnostics.design import Candidate, with_candidates
from workbench.errors import BadArgument, BadResidual
from workbench.problem.costs import compiled, interpreted
from workbench.residuals import Residual, gaussian, keypoints
from workbench.sampling import laplace, posterior_mean, sample
from workbench.sampling.ensembles import SamplerSettings
from workbench.sampling.hamiltonian import run_hamiltonian
from workbench.sampling.modes import mode_from, modes, walkers_at

CAMERA = wb.Camera("camera/")
AT = wb.Block("at", (3,), "m", ("x", "y", "z"))
TURN = wb.Block("turn", (1,), "rad")
SURE = wb.Block("confidence", (5,))
SQUARE = 0.5 * np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
HIDDEN = np.array([0.3, 0.2, -10.0])  # from the middle of the square: behind the camera
TRUE = {"at": np.array([0.1, -0.2, 3.0]), "turn": np.zeros(1)}
LENS = CAMERA.values(K=[[500, 0, 320], [0, 500, 240], [0, 0, 1]])
FREE = ("at", "turn")


def square() -> cs.MX:
    """The corners, and a point that is hidden, (3, 5) m."""
    c, s = cs.cos(TURN.symbol), cs.sin(TURN.symbol)
    R = cs.vertcat(cs.horzcat(c, -s, 0), cs.horzcat(s, c, 0), cs.DM([[0, 0, 1]]))
    return R @ cs.DM(np.vstack([SQUARE, HIDDEN]).T) + cs.repmat(AT.symbol, 1, 5)


def seen() -> np.ndarray:
    pixels = CAMERA.pixels(np.vstack([SQUARE, SQUARE[:1]]) + TRUE["at"], LENS)
    return pixels + np.random.default_rng(0).normal(scale=2.0, size=(5, 2))


def problem(confidence: object = SURE.symbol, sigma: float = 5.0) -> wb.Problem:
    data = keypoints(square(), CAMERA, seen(), confidence, sigma=sigma, name="seen")  # type: ignore[arg-type]
    priors = [
        gaussian(AT.symbol, covariance=9.0, unit="m", name="place"),
        gaussian(TURN.symbol, covariance=4.0, unit="rad", name="turned"),
    ]
    return wb.Problem([data, *priors], FREE, blocks=[AT, TURN, SURE])


SEEN = problem()
VALUES = TRUE | LENS | {"confidence": np.array([1.0, 1.0, 0.5, 1.0, 0.0])}
BEHIND = VALUES | {"at": -TRUE["at"], "turn": np.array([np.pi])}


def everywhere(of: wb.Problem) -> wb.Problem:
    """The same problem as if every residual meant something everywhere."""
    return of.variant([replace(one, domain=None) for one in of.residuals], of.free.spelled())


def depth(draws: np.ndarray) -> np.ndarray:
    return draws.reshape(-1, draws.shape[-1])[:, 2]


def test_searches_do_not_step_behind_the_camera() -> None:
    """It ends in front of the border if its minimum lies beyond, and has then found no mode."""
    beyond = Residual("beyond", AT.symbol + 1.0, 1.0, domain=AT.symbol)
    limited = wb.Problem([beyond], "at")
    at = np.array([0.5, 1.0, 2.0])
    for which, end, settled in ((limited, 0.0, False), (everywhere(limited), -1.0, True)):
        found = mode_from(target_of(which, {"at": at}), at)
        assert (found.z[0], found.settled) == (pytest.approx(end, abs=1e-2), settled)
        assert found.z.min() >= end
    assert sample(limited, {"at": at}, steps=100, walkers=32).flat.min() > 0


@pytest.mark.thorough
def test_samplers_draw_only_in_front() -> None:
    rng = np.random.default_rng(0)
    drawn = sample(SEEN, VALUES, steps=400, walkers=32, seed=1)
    assert (depth(drawn.draws) > 0).all()
    drawn = sample(SEEN, VALUES, "at", steps=400, walkers=32, seed=1)  # the rest is integrated out
    assert (depth(drawn.draws) > 0).all()
    assert (depth(laplace(SEEN, VALUES, draws=4000).draws) > 0).all()
    assert (depth(posterior_mean(SEEN, VALUES).draws) > 0).all()
    target = target_of(SEEN, VALUES)
    found = modes(target, mode_from(target, target.subspace.centre), rng).modes
    starts = walkers_at(target, found, 32, rng)
    assert (starts[:, 2] > 0).all()
    run = run_hamiltonian(
        target,
        starts,
        found,
        lambda z: z,
        target.subspace.labels,
        SamplerSettings(8, 4, 500),
        rng,
    )
    assert (depth(run.mixing.draws) > 0).all()


def test_wide_gaussian_is_cut_off_at_the_camera() -> None:
    """Laplace's draws behind the camera are replaced; the others are what they were."""
    wide = problem(np.array([1.0, 0, 0, 0, 0]), 100.0)  # one corner: the prior alone has a depth
    at = VALUES | wb.solve(wide, VALUES).values
    given = {name: at[name] for name in VALUES if name != "confidence"}
    cut, whole = laplace(wide, given, draws=4000), laplace(everywhere(wide), given, draws=4000)
    inside = whole.flat[depth(whole.draws) > 0]
    assert 0.01 < 1 - len(inside) / 4000 < 0.9
    assert (depth(cut.draws) > 0).all()
    assert cut.flat.shape == (4000, 4)
    np.testing.assert_array_equal(cut.flat[: len(inside)], inside)


def test_keypoints_of_no_confidence_may_be_behind() -> None:
    hidden = CAMERA.depths(HIDDEN + TRUE["at"], LENS)
    assert hidden < 0
    for confidence in (np.zeros(5), np.array([0.0, 1.0, 1.0, 1.0, 0.0])):
        density = target_of(SEEN, VALUES | {"confidence": confidence})
        assert np.isfinite(density(density.subspace.centre[None])).all()
    unsure = target_of(SEEN, VALUES | {"confidence": np.array([1.0, 1.0, 1.0, 1.0, 1e-3])})
    assert np.isneginf(unsure(unsure.subspace.centre[None])).all()


@pytest.mark.parametrize("way", [interpreted, pytest.param(compiled, marks=NEEDS_A_COMPILER)])
def test_depths_of_zero_and_nan_have_no_density(way: object) -> None:
    target = replace(target_of(SEEN, VALUES), way=way)
    z = np.repeat(target.subspace.centre[None], 4, axis=0)
    z[1:, 2] = 0.0, np.nan, -1e-9
    assert np.isfinite(target(z)).tolist() == [True, False, False, False]
    assert target.in_domain(z).tolist() == [True, False, False, False]
    log_p, slope = target.with_gradient(z)
    assert np.isfinite(log_p).tolist() == [True, False, False, False]
    assert np.isfinite(slope).all()


def test_starts_behind_the_camera_are_refused() -> None:
    for draw in (sample, laplace, posterior_mean):
        with pytest.raises(BadArgument, match=r"seen\[0\] means nothing there, .* is -3, below"):
            draw(SEEN, BEHIND)


def test_only_points_that_count_have_a_domain() -> None:
    """A weight of zero, of the residual, of a point, or of both rows of a point, takes it away."""
    limited = Residual("r", AT.symbol, 1.0, domain=AT.symbol)
    two = Residual("r", cs.vertcat(AT.symbol, 0), 1.0, rows_per_point=2, domain=AT.symbol[:2])
    x = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]])
    for residual, finite in (
        (limited, [True, False, False]),
        (limited.weighed(0.0), [True, True, True]),
        (replace(limited, weights=[1.0, 0.0, 1.0]), [True, True, False]),
        (replace(limited, weights=cs.MX(0.5)), [True, False, False]),
        (replace(two, weights=[1.0, 0.0, 0.0, 0.0]), [True, True, False]),
        (replace(two, weights=[0.0, 1.0, 0.0, 1.0]), [True, False, False]),
        (replace(two, weights=[0.0, 1.0]), [True, False, True]),
    ):
        whole = wb.Problem([residual], "at")
        found = whole.costs(np.zeros(3), np.zeros(0))(x)
        assert np.isfinite(found).tolist() == finite
        inside = [not whole.domain.outside_in_words(one, np.zeros(0)) for one in x]  # type: ignore[union-attr]
        assert inside == finite


def test_candidates_have_domains_of_their_own() -> None:
    """One residual stands for many cameras; in a problem the one that is chosen is constants."""
    other = wb.Camera("other/")
    shared = keypoints(square(), other, seen(), np.ones(5), sigma=5.0, name="other")
    for t, finite in ((20.0, True), (5.0, False)):  # of the hidden point, which counts here
        lens = other.values(K=[[500, 0, 320], [0, 500, 240], [0, 0, 1]], t=[0, 0, t])
        several = {"other": Candidate((shared,), lens)}
        both = with_candidates(SEEN, several, ["other"])
        assert both.fixed.names == SEEN.fixed.names
        target = target_of(both, VALUES)
        assert np.isfinite(target(target.subspace.centre[None])).all() == finite


def test_domains_are_checked_and_read() -> None:
    with pytest.raises(BadResidual, match=r"domain of shape \(3, 1\), .* not of \(2, 1\)"):
        Residual("r", AT.symbol, 1.0, domain=AT.symbol[:2])
    with pytest.raises(BadResidual, match="the domain must be a CasADi symbol"):
        Residual("r", AT.symbol, 1.0, domain=np.ones(3))  # type: ignore[arg-type]
    body = wb.load_body("small")
    points = body.joint_points(*(block.symbol for block in body.blocks()))
    with pytest.raises(BadResidual, match="does not say which"):
        Residual("r", AT.symbol, 1.0, domain=points.symbol[2, :3].T)
    limited = Residual("r", AT.symbol, 1.0, domain=AT.symbol - TURN.symbol, blocks=(AT, TURN))
    assert limited.reads == ("at", "turn")
    whole = wb.Problem([limited], "at")
    assert whole.fixed.names == ("turn",)
    costs = whole.costs(np.zeros(3), np.array([0.5]))
    assert np.isfinite(costs(np.array([[1.0, 1, 1], [1, 0, 1]]))).tolist() == [True, False]
