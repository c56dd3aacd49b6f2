"""Known correspondences: recovery, and solvers that agree; registration of a stranger."""

import numpy as np
import pytest

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import UnknownName
from workbench.experiments import find, run
from workbench.experiments.correspondences import known_correspondences
from workbench.fitting.setup import Setup
from workbench.solvers import SOLVERS, LevenbergMarquardt

SEEDS = range(10)


@pytest.fixture(scope="module", params=["small", "default"])
def setup(request: pytest.FixtureRequest) -> Setup:
    return known_correspondences(request.param)


def posed(body: SkinnedBody, seed: int, noise: float) -> Values:
    """The observation of `known_correspondences` with this seed, without building a graph."""
    rng = np.random.default_rng(seed)
    pose, betas = 0.3 * rng.standard_normal((24, 3)), rng.standard_normal(body.n_betas)
    clean = body.vertices(pose, betas)
    return {"observed": clean + noise * rng.standard_normal(clean.shape)}


@pytest.mark.parametrize("seed", SEEDS)
def test_every_vertex_is_recovered_within_fifteen_iterations(setup: Setup, seed: int) -> None:
    body = setup.body
    assert body is not None
    observed = posed(body, seed, 0.0)
    solution = LevenbergMarquardt(max_iterations=15).solve(setup.problem, setup.start | observed)
    assert solution.converged
    assert np.abs(body.vertices(**solution.values) - observed["observed"]).max() < 1e-6  # m


def test_the_full_body_is_recovered_too() -> None:
    result = run(find("known-correspondences", {"body": "full"}), compare=False)
    assert result.solution.converged
    assert result.solution.iterations <= 15
    assert max(m.value for m in result.measures) < 1e-3  # mm


@pytest.mark.parametrize(
    "seed", [pytest.param(one, marks=[pytest.mark.thorough] * (one >= 3)) for one in SEEDS]
)
def test_with_a_millimetre_of_noise_all_solvers_agree(setup: Setup, seed: int) -> None:
    body = setup.body
    assert body is not None
    start = setup.start | posed(body, seed, 0.001)
    names = ("trust-region", "gauss-newton", "levenberg-marquardt", "ipopt", "nlopt-lbfgs")
    costs = {name: SOLVERS[name].solve(setup.problem, start).cost for name in names}
    best = min(costs.values())
    other_basins = {name: cost for name, cost in costs.items() if cost > 1.5 * best}
    assert not {n: c for n, c in costs.items() if n not in other_basins and c > best * (1 + 1e-6)}
    assert not {"trust-region", "levenberg-marquardt"} & set(other_basins)
    if other_basins:
        print(f"seed {seed}: other basins {other_basins}, best {best}")


def test_a_stranger_is_registered_to_the_limit_of_the_shape_space() -> None:
    result = run(find("registration"))
    numbers = {m.name: m.value for m in result.measures}
    left = numbers["vertex to observation, rms"]
    floor = numbers["floor: without the prior, from the true pose, rms"]
    assert 1.0 < floor <= left <= 1.001 * floor  # mm; the prior costs next to nothing
    costs = [solution.cost for solution in result.compared.values()]
    assert len(costs) == 5
    assert max(costs) <= min(costs) * (1 + 1e-6)


def test_strangers_are_numbered() -> None:
    with pytest.raises(UnknownName, match="0 to 3"):
        find("registration", {"person": 4}).setup()
    with pytest.raises(UnknownName, match="default, small"):
        find("registration", {"body": "full"}).setup()
