"""Known correspondences are recovered, strangers registered, shapes seen by joints alone."""

import numpy as np
import pytest

from tests.tiers import few
from workbench import laplace, solve
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import UnknownName
from workbench.experiments import find, run
from workbench.experiments.body_fits import known_correspondences
from workbench.fitting.setup import Setup
from workbench.solvers import SOLVERS, LevenbergMarquardt

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
def test_full_body_is_recovered() -> None:
    result = run(find("known-correspondences", {"body": "full"}), compare=False)
    assert result.solution.converged
    assert result.solution.iterations <= 15
    assert max(m.value for m in result.measures) < 1e-3  # mm


@pytest.mark.thorough
@pytest.mark.parametrize("seed", SEEDS)
def test_solvers_agree_with_a_millimetre_of_noise(setup: Setup, seed: int) -> None:
    body = setup.body
    assert body is not None
    start = setup.start | posed(body, seed, 0.001)
    names = ("trust-region", "gauss-newton", "levenberg-marquardt", "ipopt", "nlopt-lbfgs")
    costs = {name: SOLVERS[name].solve(setup.problem, start).cost for name in names}
    best = min(costs.values())
    other_basins = {name: cost for name, cost in costs.items() if cost > 1.5 * best}
    assert not {n: c for n, c in costs.items() if n not in other_basins and c > best * (1 + 1e-6)}
    assert not {"trust-region", "levenberg-marquardt"} & set(other_basins)


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


@pytest.mark.thorough
def test_joints_are_met_and_shape_stays_open() -> None:
    setup = find("landmarks", {"body": "small"}).setup()
    found = setup.start | solve(setup.problem, setup.start).values
    measures = {measure.name: measure.value for measure in setup.measures(found)}
    assert measures["joint to synthetic truth, rms"] < 15
    # joints know how tall somebody is, and hardly how heavy: the prior's 1 is left of the last
    known = laplace(setup.problem, found, "betas").sd
    assert known[0] < 0.15
    assert known.max() > 0.5
    assert known.max() <= 1.0 + 0.05


def test_same_seed_is_the_same_person() -> None:
    one, same, other = (find("landmarks", {"body": "small", "seed": s}).setup() for s in (3, 3, 4))
    np.testing.assert_array_equal(one.start["observed"], same.start["observed"])
    assert not np.array_equal(one.start["observed"], other.start["observed"])
