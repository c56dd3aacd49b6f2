"""Modes far away are looked for; draws that miss one are not called usable; chains jump."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.sampling.densities import gaussian, two_modes
from workbench.residuals import geman_mcclure
from workbench.sampling import Usability, laplace, sample
from workbench.sampling.ensembles import SamplerSettings
from workbench.sampling.hamiltonian import HamiltonianRun, run_hamiltonian
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import (
    REACH,
    Mode,
    missed_mode,
    mode_from,
    modes,
    shortest_rotations,
    walkers_at,
)
from workbench.sampling.subspace import fixed


def target_of(problem: wb.Problem, at: dict[str, object]) -> LogDensity:
    x, given = problem.split(at)  # type: ignore[arg-type]
    every = np.arange(problem.free.size)
    return LogDensity(problem, given, fixed(problem, problem.linearize_at(x, given), x, every))


@pytest.mark.parametrize("apart", [20.0, 300.0])
def test_equal_wells_are_found_on_both_sides(apart: float) -> None:
    target = target_of(two_modes(apart), {"x": [apart, 0.0]})
    first = mode_from(target, target.subspace.centre)
    for seed in range(2):
        found = modes(target, first, np.random.default_rng(seed))
        assert sorted(mode.z[0] for mode in found.modes) == pytest.approx([-apart, apart])
        assert found.starts >= 16
        assert found.farthest == REACH[1]


def test_unvisited_modes_are_missed() -> None:
    target = target_of(two_modes(30.0), {"x": [30.0, 0.0]})
    found = modes(target, mode_from(target, target.subspace.centre), np.random.default_rng(0))
    rng = np.random.default_rng(1)
    here = rng.standard_normal((4000, 2)) + [30.0, 0.0]
    assert missed_mode(found.modes, here) == pytest.approx((0.5, 0.0), abs=1e-6)
    both = here * np.where(rng.uniform(size=(4000, 1)) < 0.5, 1, -1)
    assert missed_mode(found.modes, both) is None
    assert missed_mode(found.modes[:1], here) is None


def test_laplace_of_one_of_two_wells_is_not_usable() -> None:
    posterior = laplace(two_modes(50.0), {"x": [50.0, 0.0]})
    assert not posterior.usable
    assert posterior.judgement[0] is Usability.MODE_MISSED
    assert "another mode with 50% of the mass" in posterior.verdict
    alone = laplace(gaussian(np.eye(2)), {"x": np.zeros(2)})
    assert alone.usable
    assert "up to 1,000 sd away, found none; a much narrower mode can be missed" in alone.verdict


def test_plateaus_are_no_modes() -> None:
    """Far from the only cluster the kernel is flat: searches end there, and nothing is there."""
    z = wb.Block("z")
    fit = wb.Residual("fit", cs.DM(np.linspace(-1, 1, 20)) - z.symbol, 1.0, kernel=geman_mcclure)
    problem = wb.Problem([fit], "z", blocks=[z])
    found = laplace(problem, {"z": 0.0})
    assert len(found.modes) == 1


def test_draws_that_run_away_are_improper() -> None:
    """The kernel is flat far from the data, so that the integral of the density is infinite."""
    z = wb.Block("z")
    fit = wb.Residual("fit", cs.DM(np.linspace(-1, 1, 3)) - z.symbol, 1.0, kernel=geman_mcclure)
    posterior = sample(wb.Problem([fit], "z", blocks=[z]), {"z": 0.0}, walkers=16)
    assert posterior.judgement[0] is Usability.IMPROPER
    assert "prior or bounds" in posterior.verdict
    assert "1,000,000,000 sd" in posterior.verdict
    held = wb.residuals.gaussian(z.symbol, covariance=1e4**2)
    proper = sample(wb.Problem([fit, held], "z", blocks=[z]), {"z": 0.0}, walkers=16, steps=500)
    assert proper.judgement[0] is not Usability.IMPROPER


def test_components_of_a_mixture_are_modes() -> None:
    """The second component is ten times narrower, and no wide search finds it."""
    x, shares, means = wb.Block("x", (2,)), [0.5, 0.5], [[0.0, 0.0], [6.4, 4.8]]
    mixture = wb.residuals.max_mixture(
        x.symbol, shares=shares, means=means, covariances=[np.eye(2), 0.01 * np.eye(2)]
    )
    problem = wb.Problem([mixture], "x", blocks=[x])
    drawn = sample(problem, {"x": np.zeros(2)}, steps=200)
    assert [mode.share for mode in drawn.modes] == pytest.approx([0.5, 0.5], abs=0.01)
    assert np.mean(drawn.flat[:, 0] > 4.5) == pytest.approx(0.5, abs=0.05)
    told = laplace(problem, {"x": np.zeros(2)})
    assert told.judgement[0] is Usability.MODE_MISSED
    assert "each of 2 components" in str(told)
    assert "much narrower" not in str(told)
    pulled = wb.Problem([mixture, wb.Residual("data", x.symbol[0] - 3.0, 1.0)], "x", blocks=[x])
    target = target_of(pulled, {"x": np.zeros(2)})
    found = modes(target, mode_from(target, np.zeros(2)), np.random.default_rng(0))
    first = sorted(mode.z[0] for mode in found.modes)
    assert first == pytest.approx([1.5, (6.4 / 0.01 + 3.0) / (1 / 0.01 + 1)], abs=0.01)


def test_full_turns_are_no_other_modes() -> None:
    body = wb.load_body("small")
    pose, betas, trans = body.blocks()
    observed = wb.Block("observed", (body.n_joints, 3), "m")
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    problem = wb.Problem(
        [wb.residuals.landmarks(points, observed.symbol, sigma=0.01)], "pose", blocks=[observed]
    )
    truth = body.start() | {"pose": np.zeros((body.n_joints, 3))}
    truth["pose"][0] = [0.0, 3.0, 0.0]
    at = truth | {"observed": body.joints(*(truth[b.name] for b in body.blocks()))}
    posterior = laplace(problem, at, "pose[pelvis]")
    assert len(posterior.modes) == 1, [mode.z for mode in posterior.modes]
    x, given = problem.split(at)
    target = LogDensity(problem, given, posterior.subspace)
    np.testing.assert_allclose(
        shortest_rotations(target, np.array([0.0, 3.5, 0.0])),
        [0.0, 3.5 - 2 * np.pi, 0.0],
        atol=1e-12,
    )
    assert not np.isnan(x).any()


APART, NARROW, SHARE = 60.0, 0.2, 0.8  # of the modes; the second is narrower
ENDS = np.array([APART, 0.0, 0.0])


def jumping_target() -> LogDensity:
    """0.8 N(x; -60, 1) below 0 and 0.2 N(x; 60, 0.2^2) above, of the first of three numbers; the
    others are standard normal.
    """
    x = wb.Block("x", (3,))
    first, low = x.symbol[0], x.symbol[0] < 0
    missing = cs.if_else(low, -np.log(SHARE), -np.log((1 - SHARE) / NARROW))
    terms = [
        wb.Residual("nearer", cs.if_else(low, first + APART, (first - APART) / NARROW), 1.0),
        wb.Residual("share", cs.sqrt(2 * (1 + missing)), 1.0),
        wb.Residual("others", x.symbol[1:], 1.0),
    ]
    problem = wb.Problem(terms, ("x",), blocks=[x])
    at, given = problem.split({"x": -ENDS})
    return LogDensity(
        problem, given, fixed(problem, problem.linearize_at(at, given), at, np.arange(3))
    )


@pytest.fixture(scope="module")
def both_modes() -> list[Mode]:
    """Both modes, as if each had half of the mass."""
    of = jumping_target()
    return [replace(mode_from(of, z), share=0.5) for z in (-ENDS, ENDS)]


@pytest.fixture(scope="module")
def jumping_run(both_modes: list[Mode]) -> HamiltonianRun:
    """Half of the chains begin in each mode."""
    of, rng = jumping_target(), np.random.default_rng(0)
    starts = walkers_at(of, tuple(both_modes), 64, rng)
    plan = SamplerSettings(ensembles=4, walkers=16, steps=2000, whole=True)
    return run_hamiltonian(of, starts, both_modes, lambda z: z, ("x", "y", "z"), plan, rng)


@pytest.mark.thorough
def test_chains_find_the_shares_of_modes(jumping_run: HamiltonianRun) -> None:
    flat = jumping_run.mixing.draws.reshape(-1, 3)
    high = flat[:, 0] > 0
    assert np.mean(high) == pytest.approx(1 - SHARE, abs=0.03)
    assert flat[high, 0].std() == pytest.approx(NARROW, rel=0.1)
    assert flat[~high, 0].std() == pytest.approx(1.0, rel=0.1)
    assert jumping_run.mixing.usable, jumping_run.mixing
