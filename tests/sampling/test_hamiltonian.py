"""Hamiltonian Monte Carlo: named marginals of many numbers, and means of posteriors."""

import casadi as cs
import numpy as np
import pytest
import scipy.stats

import workbench as wb
from tests.sampling.densities import bounded, gaussian
from workbench.errors import BadArgument
from workbench.residuals import Residual
from workbench.sampling import (
    Improper,
    SamplingProgress,
    Usability,
    fixed,
    integrated,
    laplace,
    posterior_mean,
    sample,
)
from workbench.sampling.ensembles import SamplerSettings
from workbench.sampling.hamiltonian import HamiltonianRun, run_hamiltonian
from workbench.sampling.importance import Importance, compared, of_laplace, psis
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import mode_from
from workbench.sampling.subspace import subspace_of

WALKERS = 16  # in each of four ensembles


def target_of(problem: wb.Problem) -> LogDensity:
    """Of all free numbers, about zero."""
    x, given = problem.split({"x": np.zeros(problem.free.size)})
    return LogDensity(problem, given, subspace_of(problem, x, given, None, fixed))


def beside(kind: str) -> wb.Problem:
    """x ~ N(0, 1), and 24 numbers y that make the whole far from a Gaussian.

    `bent`: y given x is N(x^2 / 2, 1). `heavy`: y does not depend on x, and has Student's
    distribution of 3 degrees of freedom.
    """
    x, y = wb.Block("x"), wb.Block("y", (24,))
    terms = [wb.Residual("x", x.symbol, 1.0)]
    if kind == "bent":
        terms.append(wb.Residual("y", y.symbol - 0.5 * x.symbol**2, 1.0))
    else:
        u = y.symbol**2 / 3 + 1e-12
        terms.append(wb.Residual("y", y.symbol * cs.sqrt(4 / 3 * cs.log(1 + u) / u), 1.0))
    return wb.Problem(terms, ("x", "y"), blocks=[x, y])


AT = {"x": 0.0, "y": np.zeros(24)}


@pytest.mark.thorough
def test_bent_ridge_leaves_the_marginal() -> None:
    posterior = sample(beside("bent"), AT, "x", steps=6_000, walkers=WALKERS, seed=1)
    assert posterior.method == "hamiltonian"
    assert posterior.usable, posterior.verdict
    found = scipy.stats.norm.cdf(posterior.interval()[0])
    few = posterior.mixing.effective.min()
    np.testing.assert_allclose(found, [0.05, 0.95], atol=4 * np.sqrt(0.0475 / few))
    assert posterior.rest == "sampled too"
    some = posterior.points(2000)
    assert some.shape == (2000, 25)
    # the rest is drawn from the posterior as well: y - x^2 / 2 is standard normal
    assert (some[:, 1:] - 0.5 * some[:, :1] ** 2).std() == pytest.approx(1.0, abs=0.03)
    assert "Hamiltonian Monte Carlo of all free numbers: 4 groups of 16 chains" in str(posterior)


@pytest.mark.thorough
def test_laplace_is_judged_in_named_numbers() -> None:
    """y is far from Gaussian, so the weights of all numbers fail; the marginal of x is exact."""
    problem = beside("heavy")
    at = AT | {"y": np.full(24, 1e-3)}
    fine = laplace(problem, at, "x")
    assert fine.importance is not None
    assert fine.importance.k_hat > 0.7
    assert fine.usable, fine.verdict
    assert "effective draws of all 25 free numbers" in fine.verdict
    two = ("x", "y[0]")
    drawn = sample(problem, at, two, steps=2000, walkers=WALKERS)
    told = laplace(problem, at, two, against=drawn)
    assert told.judgement[0] is Usability.NOT_GAUSSIAN
    assert "effective draws by `sample`" in told.verdict
    assert told.importance is not None
    assert told.importance.worst == "y[0]"
    with pytest.raises(wb.WorkbenchError, match="different entries"):
        laplace(problem, at, "x", against=drawn)


@pytest.mark.thorough
def test_funnels_are_not_usable() -> None:
    """v ~ N(0, 1), and 29 numbers are N(0, exp(v)): along the ridge v is 14.5 too small."""
    v, x = wb.Block("v"), wb.Block("x", (29,))
    terms = [
        wb.Residual("width", v.symbol + 29 / 2, 1.0),
        wb.Residual("x", x.symbol * cs.exp(-v.symbol / 2), 1.0),
    ]
    problem = wb.Problem(terms, ("v", "x"), blocks=[v, x])
    at = {"v": -29 / 2, "x": np.zeros(29)}
    for names in ("v", "x[0]"):
        posterior = sample(problem, at, names, steps=1000, walkers=WALKERS)
        assert not posterior.usable, posterior.verdict


def test_progress_ends_at_its_goal_and_numpys_true_stops() -> None:
    target = target_of(gaussian(np.eye(2)))
    modes = (mode_from(target, np.zeros(2)),)
    plan = SamplerSettings(4, 2, steps=100, whole=True)
    seen: list[int] = []

    def draw(stop: int) -> HamiltonianRun:
        def callback(progress: SamplingProgress) -> np.bool_:
            seen.append(progress.step)
            return np.bool_(len(seen) == stop)

        starts, rng = np.zeros((8, 2)), np.random.default_rng(0)
        return run_hamiltonian(target, starts, modes, lambda z: z, ("a", "b"), plan, rng, callback)

    assert not draw(stop=0).interrupted
    assert max(seen) == plan.steps
    assert draw(stop=len(seen) + 70).interrupted


def test_gradients_along_subspaces_are_differences() -> None:
    problem = beside("bent")
    x, given = problem.split(AT)
    rng = np.random.default_rng(0)
    for names in ("x", ("x", "y")):
        space = subspace_of(problem, x, given, names, integrated)
        target = LogDensity(problem, given, space)
        z, h = rng.standard_normal((3, space.size)), 1e-5
        value, slope = target.with_gradient(z)
        np.testing.assert_allclose(value, target(z))
        for i in range(space.size):
            step = h * np.eye(space.size)[i]
            np.testing.assert_allclose(
                slope[:, i], (target(z + step) - target(z - step)) / (2 * h), atol=1e-6
            )


def test_no_draw_is_effective_where_none_has_a_density() -> None:
    target, rng = target_of(bounded()), np.random.default_rng(0)
    told = of_laplace(target, -np.abs(rng.standard_normal((100, 2))), np.zeros(100), 0.0, rng)
    assert told.effective == 0
    assert told.outside == 1
    assert "k-hat inf, above 0.7; importance weights leave 0% of the draws effective" in str(told)


def test_smoothed_weights_are_those_of_arviz() -> None:
    """By ArviZ 0.23's `psislw`: k-hat, the largest of 1000 weights, and their effective number."""
    heavy = scipy.stats.t(2).ppf((np.arange(1000) + 0.5) / 1000)
    for log_weights, known in (
        (0.5 * heavy, (1.6494, 0.6032, 2.6541)),
        (0.1 * heavy, (0.7162, 0.009578, 874.36)),
    ):
        smoothed, k_hat = psis(log_weights)
        weights = np.exp(smoothed - np.logaddexp.reduce(smoothed))
        found = k_hat, weights.max(), 1 / np.sum(weights**2)
        np.testing.assert_allclose(found, known, rtol=0.01)
    for few in (np.where(heavy > 0, 0.0, -1e3), 1e3 * heavy):  # no tail to fit
        smoothed, k_hat = psis(few)
        assert k_hat == np.inf
        assert np.isfinite(smoothed).all()


def test_importance_compares_quantiles_and_widths() -> None:
    """N(0, 1) beside N(1, 4): its 5 % quantile holds 9 %, and an interval is twice as wide."""
    rng = np.random.default_rng(0)
    told = Importance(1.5, 10.0, 4000, labels=("a", "b"))
    right = np.column_stack([rng.standard_normal(200_000), 1 + 2 * rng.standard_normal(200_000)])
    found = compared(told, rng.standard_normal((100_000, 2)), right, "draws")
    assert not found.holds
    assert found.worst == "b"
    assert found.widths == pytest.approx([1.0, 2.0], abs=0.03)
    off = abs(
        scipy.stats.norm.cdf(np.array([-1.645, -0.674, 0, 0.674, 1.645]), 1, 2)
        - [0.05, 0.25, 0.5, 0.75, 0.95]
    ).max()
    assert found.errors == pytest.approx([0.0, off], abs=0.01)
    assert found.of_entries(np.array([0])).holds  # whatever k-hat is
    assert not told.holds


X = wb.Block("x", (2,), "m")
ROWS = np.array([[2.0, 0.3], [0.0, 0.5], [1.0, 1.0]])
RIGHT = np.array([1.0, -0.5, 0.2])
LINEAR = wb.Problem([Residual("line", cs.DM(ROWS) @ X.symbol - cs.DM(RIGHT), 1.0)], ["x"])
SKEWED = wb.Problem(
    [Residual("skewed", cs.if_else(X.symbol < 0, 4 * X.symbol, X.symbol), 1.0)], ["x"]
)


def test_mean_of_a_gaussian_is_its_mode() -> None:
    mode, *_ = np.linalg.lstsq(ROWS, RIGHT, rcond=None)
    found = posterior_mean(LINEAR, {"x": mode}, chains=32, trajectories=100)
    sd = np.sqrt(np.diag(np.linalg.inv(ROWS.T @ ROWS)))
    np.testing.assert_allclose(found.sd, sd, rtol=0.1)
    assert (found.error < 0.05 * sd).all()
    assert (abs(found.values["x"] - mode) < 4 * found.error).all()
    assert 0.5 < found.accepted <= 1
    assert found.draws.shape == (3200, 2)


def test_mean_of_a_skewed_density_is_known() -> None:
    """exp(-x^2 / 2) on the right and exp(-8 x^2) on the left of zero, in two numbers."""
    found = posterior_mean(SKEWED, {"x": np.zeros(2)}, chains=32, trajectories=100)
    mean = np.sqrt(2 / np.pi) * (1 - 1 / 4)
    assert (abs(found.values["x"] - mean) < 4 * found.error).all()
    assert (found.error < 0.05).all()
    few, again, other = (posterior_mean(SKEWED, {"x": np.zeros(2)}, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(few.draws, again.draws)
    assert (few.draws != other.draws).any()
    assert (abs(few.values["x"] - mean) < 5 * few.error).all()


def test_mean_respects_bounds() -> None:
    ahead = wb.Problem([Residual("ahead", X.symbol, 1.0)], ["x"], bounds={"x": (0.0, np.inf)})
    found = posterior_mean(ahead, {"x": np.zeros(2)}, chains=32, trajectories=100)
    assert (abs(found.values["x"] - np.sqrt(2 / np.pi)) < 4 * found.error).all()
    assert (found.draws >= 0).all()


def test_improper_means_are_refused() -> None:
    with pytest.raises(BadArgument, match="`chains` must be 2 or more, not 1"):
        posterior_mean(LINEAR, {"x": np.zeros(2)}, chains=1)
    with pytest.raises(BadArgument, match="`trajectories` must be 1 or more, not 0"):
        posterior_mean(LINEAR, {"x": np.zeros(2)}, trajectories=0)
    open_ended = wb.Problem([Residual("one", X.symbol[:1], 1.0)], ["x"])
    with pytest.raises(Improper, match="x"):
        posterior_mean(open_ended, {"x": np.zeros(2)})
    held = wb.Problem([Residual("x", X.symbol, 1.0)], ["x"], bounds={"x": ([0, 1], [2, 1])})
    with pytest.raises(BadArgument, match=r"x\[1\] has equal bounds"):
        posterior_mean(held, {"x": np.ones(2)})
