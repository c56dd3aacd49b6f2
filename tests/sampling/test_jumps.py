"""Chains of Hamiltonian Monte Carlo between modes that are far from each other."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.sampling.descent import Mode, mode_from
from workbench.sampling.hamiltonian import HamiltonianRun, HamiltonianSettings, run_hamiltonian
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import nearest_mode, walkers_at
from workbench.sampling.subspace import fixed

APART, NARROW, SHARE = 60.0, 0.2, 0.8  # of the modes; the second is narrower
ENDS = np.array([APART, 0.0, 0.0])


def target() -> LogDensity:
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
def found() -> list[Mode]:
    """Both modes, as if each had half of the mass."""
    of = target()
    return [replace(mode_from(of, z), share=0.5) for z in (-ENDS, ENDS)]


@pytest.fixture(scope="module")
def run(found: list[Mode]) -> HamiltonianRun:
    """Half of the chains begin in each mode."""
    of, rng = target(), np.random.default_rng(0)
    starts = walkers_at(of, tuple(found), 64, rng)
    plan = HamiltonianSettings(ensembles=4, walkers=16, steps=2000, whole=True)
    return run_hamiltonian(of, starts, found, lambda z: z, ("x", "y", "z"), plan, rng)


def test_chains_find_the_shares_of_modes_that_laplace_has_wrong(run: HamiltonianRun) -> None:
    flat = run.mixing.draws.reshape(-1, 3)
    high = flat[:, 0] > 0
    assert np.mean(high) == pytest.approx(1 - SHARE, abs=0.03)
    assert flat[high, 0].std() == pytest.approx(NARROW, rel=0.1)
    assert flat[~high, 0].std() == pytest.approx(1.0, rel=0.1)
    assert run.mixing.usable, run.mixing


def test_the_distance_of_modes_does_not_shorten_steps(run: HamiltonianRun) -> None:
    """A unit of 60 standard deviations would ask for steps of 0.003 of it."""
    assert run.mixing.thin < 30


def test_a_point_belongs_to_the_mode_that_is_nearest_in_its_own_measure(found: list[Mode]) -> None:
    beside = ENDS - [1.0, 0.0, 0.0]  # 5 sd of the second mode, and 119 of the first
    assert nearest_mode(found, np.array([-ENDS, ENDS, beside, 0 * ENDS])).tolist() == [0, 1, 1, 0]
