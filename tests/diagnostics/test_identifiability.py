"""What is known of each number, against closed forms, and relative to its scale."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.diagnostics.identifiability import EntryIdentifiability
from workbench.errors import BadArgument, UnknownName


def gaussian_problem(
    A: np.ndarray, sigma: float, covariance: np.ndarray | None = None
) -> tuple[Problem, dict[str, np.ndarray]]:
    """Data A x with noise sigma, and a prior N(0, covariance) on x if there is one."""
    x = Block("x", (A.shape[1],))
    found = [Residual("data", cs.DM(A) @ x.symbol, sigma)]
    if covariance is not None:
        found.append(residuals.gaussian(x.symbol, covariance=covariance, name="prior"))
    return Problem(found, ("x",), blocks=(x,)), {"x": np.zeros(A.shape[1])}


def random_covariance(rng: np.random.Generator, n: int) -> np.ndarray:
    half = rng.normal(size=(n, n))
    return half @ half.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("seed", few(range(6), 2))
def test_a_linear_problem_agrees_with_the_closed_forms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    A = rng.normal(size=(int(rng.integers(1, 15)), n))  # sometimes fewer rows than unknowns
    sigma, C = float(rng.uniform(0.2, 3)), random_covariance(rng, n)
    known = diagnose(*gaussian_problem(A, sigma, C), priors=("prior",)).identifiability

    J = A / sigma
    posterior = np.linalg.inv(J.T @ J + np.linalg.inv(C))
    np.testing.assert_allclose(known.sigma, np.sqrt(np.diag(posterior)), rtol=1e-9)
    np.testing.assert_allclose(known.prior_sigma, np.sqrt(np.diag(C)), rtol=1e-9)
    np.testing.assert_allclose(known.shrinkage, known.sigma / known.prior_sigma, rtol=1e-12)
    hat = J @ posterior @ J.T
    assert known.effective == pytest.approx(np.trace(hat), rel=1e-9)
    share = np.sort(np.linalg.eigvals(posterior @ J.T @ J).real)[::-1]
    np.testing.assert_allclose(np.sort(known.data_share)[::-1], np.clip(share, 0, 1), atol=1e-9)
    assert known.better_from_data == np.sum(share > 0.5)
    expected = [
        EntryIdentifiability.IDENTIFIED if told < 0.9 else EntryIdentifiability.PRACTICAL
        for told in np.sqrt(np.diag(posterior) / np.diag(C))
    ]
    assert list(known.verdicts) == expected

    spread = np.sqrt(np.diag(posterior))
    correlation = posterior / np.outer(spread, spread)
    strong = {(i, j) for i in range(n) for j in range(i + 1, n) if abs(correlation[i, j]) > 0.5}
    assert {(i, j) for i, j, _ in known.correlations} == strong
    for i, j, c in known.correlations:
        assert c == pytest.approx(correlation[i, j], abs=1e-9)
    sizes = [abs(c) for _, _, c in known.correlations]
    assert sizes == sorted(sizes, reverse=True)


def test_a_prior_on_some_says_nothing_of_the_others() -> None:
    """And one on a sum says nothing of its parts."""
    x, y, z = Block("x", ()), Block("y", ()), Block("z", (2,))
    found = (
        Residual("data", cs.vertcat(x.symbol, y.symbol, z.symbol), 0.1),
        residuals.gaussian(y.symbol, covariance=4.0, name="on y"),
        residuals.gaussian(cs.sum1(z.symbol), covariance=9.0, name="on the sum of z"),
    )
    problem = Problem(found, ("x", "y", "z"), blocks=(x, y, z))
    at = {"x": 0.0, "y": 0.0, "z": np.zeros(2)}
    known = diagnose(problem, at, priors=("on y", "on the sum of z")).identifiability
    np.testing.assert_allclose(known.prior_sigma, [np.inf, 2, np.inf, np.inf], rtol=1e-12)
    np.testing.assert_allclose(
        known.shrinkage, [0, 0.5 / np.sqrt(0.25 + 100), 0, 0], rtol=1e-12, atol=1e-15
    )
    share_of_sum = 100 / (100 + 2 / 9)
    np.testing.assert_allclose(
        np.sort(known.data_share), np.sort([1, 1, 100 / 100.25, share_of_sum]), rtol=1e-12
    )


def test_verdicts_tell_the_ways_of_not_being_known_apart() -> None:
    x = Block("x", (2, 3), "1", ("first", "second"))
    a, b, c, d, e, _ = cs.vertsplit(cs.vec(x.symbol))
    data = Residual("data", cs.vertcat(a, b + c, 2 * (b + c), 1e-4 * d, 100 * e), 1.0)
    problem = Problem((data, residuals.gaussian(a, covariance=1e-6, name="prior")), ("x",))
    found = diagnose(problem, {"x": np.zeros((2, 3))}, priors=("prior",))
    assert [v.name for v in found.identifiability.verdicts] == [
        "PRACTICAL",  # the data know it worse than the prior does
        "NUMERICAL",
        "NUMERICAL",  # only their sum is seen
        "PRACTICAL",  # seen by a ten thousandth of a sigma
        "IDENTIFIED",
        "STRUCTURAL",  # read by nobody
    ]
    np.testing.assert_allclose(
        found.identifiability.sigma[[0, 3, 4]], [1e-3 / np.sqrt(1 + 1e-6), 1e4, 0.01], rtol=1e-9
    )
    assert np.isinf(found.identifiability.sigma[[1, 2, 5]]).all()
    assert found.rank == 4


def rms(found: Diagnosis, block: str) -> float:
    at = found.free.slices[block]
    return float(np.sqrt(np.mean(found.identifiability.sigma[at] ** 2)))


@pytest.mark.parametrize(
    "case",
    few([cases.the_same_twice, cases.template_and_translation, cases.shape_without_effect], 1),
)
def test_contributions_are_what_is_lost_without_them(case: Callable[[], cases.Case]) -> None:
    problem, values = case()
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    extra = residuals.gaussian(problem.free.blocks[0].symbol, covariance=0.01, name="prior")
    problem = Problem((*problem.residuals, extra), problem.free.names, blocks=blocks)
    whole = diagnose(problem, values)
    assert [c.residual for c in whole.contributions] == list(problem.rows)
    for contribution in whole.contributions:
        less = problem.without(contribution.residual)
        without = diagnose(less, values)
        assert contribution.rank_with == whole.rank
        assert contribution.rank_without == without.rank
        for name in problem.free.names:
            assert contribution.sigma_with[name] == pytest.approx(rms(whole, name))
            expected = rms(without, name) if name in less.free.names else np.inf
            assert contribution.sigma_without[name] == pytest.approx(expected)


def test_an_unknown_prior_is_refused() -> None:
    with pytest.raises(UnknownName, match="priro"):
        diagnose(*gaussian_problem(np.eye(2), 1.0, np.eye(2)), priors=("priro",))


# Characteristic scales: what is hardly noticed does not depend on the unit of a block.


def test_a_prior_is_a_scale() -> None:
    """50 px of prior: data that know the focal length to 40 px tell something, to 500 px not."""
    for known_to, verdict in (
        (40.0, EntryIdentifiability.IDENTIFIED),
        (500.0, EntryIdentifiability.PRACTICAL),
    ):
        f = Block("focal", (), "px")
        data = Residual("data", f.symbol - 1000, known_to, "px", blocks=(f,))
        prior = residuals.gaussian(f.symbol, mean=1000, covariance=50.0**2, name="prior")
        d = diagnose(Problem([data, prior], "focal"), {"focal": np.array(1000.0)}, priors="prior")
        assert d.identifiability.verdicts == (verdict,)
        assert d.scales.sizes.tolist() == [pytest.approx(50.0)]
        assert "the standard deviation of its prior" in str(d.scales)
        assert d.weak_count == 0  # the prior knows it


@pytest.mark.parametrize(
    ("unit", "values", "size", "said"),
    [
        ("rad", [5.0, 0.0], 1.0, "a radian"),
        ("deg", [5.0, 0.0], 180 / np.pi, "a radian"),
        ("sd", [0.0, 0.0], 1.0, "a standard deviation of shape"),
        ("mm", [0.0, 0.0], 1000.0, "a metre"),
        ("px", [3.0, 4.0], np.sqrt(12.5), "3.536 px, its size here"),
        ("1", [3.0, 4.0], np.sqrt(12.5), "3.536, its size here"),
        ("px", [0.0, 0.0], 600.0, "600 px, the size of all values in its unit"),
        ("1", [0.0, 0.0], 1.0, "1, since it is zero here and has no prior"),
    ],
)
def test_every_block_has_a_scale(unit: str, values: list[float], size: float, said: str) -> None:
    x, other = Block("x", (2,), unit), Block("image", (2,), "px")
    r = Residual("r", cs.vertcat(x.symbol, other.symbol), 1.0, blocks=(x, other))
    at: Values = {
        "x": np.array(values),
        "image": np.full(2, 600.0) if unit == "px" else np.zeros(2),
    }
    if unit == "px" and not any(values):
        at["image"] = np.sqrt([2 * 600.0**2, 2 * 600.0**2])  # with the zeros of x: 600
    scales = diagnose(Problem([r], "x"), at).scales
    np.testing.assert_allclose(scales.sizes, size)
    assert str(scales) == f"for x: {said}"


@pytest.mark.parametrize(
    ("size", "sigma", "identified"), [(1e-6, 3.7e-3, False), (7e6, 3.7, True), (1.7, 0.5, True)]
)
def test_lengths_unlike_people_are_compared_with_their_size(
    size: float, sigma: float, identified: bool
) -> None:
    x = Block("radius", (), "m")
    problem = Problem([Residual("seen", x.symbol - size, sigma, "m", blocks=(x,))], "radius")
    d = diagnose(problem, {"radius": np.array(size)})
    assert (d.identifiability.verdicts[0] == EntryIdentifiability.IDENTIFIED) == identified
    assert d.scales.sizes == pytest.approx(1.0 if size == 1.7 else size)


def test_scales_can_be_said() -> None:
    f, g = Block("focal", (), "px"), Block("shift", (2,), "m")
    r = Residual("seen", f.symbol * (g.symbol[0] - g.symbol[1]), 1.0, "px", blocks=(f, g))
    problem = Problem([r], ("focal", "shift"), blocks=(f, g))
    at = {"focal": np.array(1000.0), "shift": np.array([0.1, 0.3])}
    d = diagnose(problem, at, scales={"focal": 3.0, "shift": [0.1, 0.2]})
    assert d.scales.sizes.tolist() == [3.0, 0.1, 0.2]
    assert str(d.scales) == "for focal: 3 px, as given; for shift: 0.1 to 0.2 m, as given"
    priors = [s.what for s in diagnose(problem, at, scales={"shift": 0.25}).suggestions]
    assert "add a Gaussian prior on shift (sigma 0.25 m)" in priors
    with pytest.raises(BadArgument, match="above zero"):
        diagnose(problem, at, scales={"focal": -1.0})
    with pytest.raises(UnknownName, match="focus"):
        diagnose(problem, at, scales={"focus": 1.0})


def test_values_far_from_their_scale_are_noted() -> None:
    height, spot = Block("height", (), "m"), Block("spot", (), "m")
    seen = cs.vertcat(height.symbol, spot.symbol)
    problem = Problem(
        [Residual("seen", seen, 1e-6, "m", blocks=(height, spot))], ("height", "spot")
    )
    at = {"height": np.array(1.7), "spot": np.array(1e-4)}

    def notes(**scales: float) -> list[str]:
        return [f.text for f in diagnose(problem, at, scales=scales).findings if "scales" in f.text]

    (note,) = notes()
    assert note.startswith("values of spot and their characteristic scales differ by a factor of")
    assert not notes(spot=1e-4)
    at["spot"] = np.array(1e-17)  # zero, but for rounding
    assert not notes()
