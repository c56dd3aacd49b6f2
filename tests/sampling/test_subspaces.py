"""What is sampled and what becomes of the rest, against Gaussians of which all is known."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.sampling.densities import conditioned, gaussian
from workbench.blocks.entries import entries
from workbench.sampling import (
    Improper,
    NotConverged,
    compared_with_laplace,
    directions,
    fixed,
    integrated,
    laplace,
    sample,
    sampling_blocks,
)
from workbench.sampling.limbs import limbs

C, MEAN = conditioned(4, 30.0, seed=3), np.array([1.0, -2.0, 0.5, 3.0])
TWO = ("x[1]", "x[3]")


def test_the_rest_fixed_gives_the_conditional_variance() -> None:
    posterior = laplace(gaussian(C, MEAN), {"x": MEAN}, TWO, rest=fixed, draws=40_000)
    precision = np.linalg.inv(C)[np.ix_([1, 3], [1, 3])]
    true = np.linalg.inv(precision)
    chance = np.max(true) * np.sqrt(2 / 40_000)  # the standard deviation of a variance
    np.testing.assert_allclose(posterior.covariance, true, atol=4 * chance)


def test_the_rest_integrated_gives_the_marginal_variance_and_the_joint_one() -> None:
    problem = gaussian(C, MEAN)
    posterior = laplace(problem, {"x": MEAN}, TWO, rest=integrated, draws=40_000)
    scale = np.abs(C).max()
    np.testing.assert_allclose(posterior.covariance, C[np.ix_([1, 3], [1, 3])], atol=0.03 * scale)
    whole = posterior.points(40_000)
    np.testing.assert_allclose(np.cov(whole.T), C, atol=0.03 * scale)
    np.testing.assert_allclose(whole.mean(axis=0), MEAN, atol=0.03 * np.sqrt(scale))
    assert posterior.importance is not None
    assert posterior.importance.holds
    assert posterior.importance.effective == pytest.approx(4000)  # all weights are equal


def test_sampled_and_integrated_say_the_same() -> None:
    problem = gaussian(C, MEAN)
    drawn = sample(problem, {"x": MEAN}, TWO, rest=integrated, steps=3000, seed=1)
    assert drawn.usable, drawn.verdict
    true = np.sqrt(np.diag(C)[[1, 3]])
    np.testing.assert_allclose(drawn.sd, true, rtol=4 / np.sqrt(drawn.mixing.effective.min()))


def curved(scale: float) -> wb.Problem:
    """y given x is N(0, (1 + scale x^2)^-2): no Gaussian conditional serves all x."""
    x = wb.Block("x")
    y = wb.Block("y")
    wide = 1 + scale * x.symbol**2
    return wb.Problem(
        [wb.Residual("x", x.symbol, 1.0), wb.Residual("y", y.symbol * wide, 1.0)],
        ("x", "y"),
        blocks=[x, y],
    )


def test_a_conditional_that_does_not_hold_is_noticed() -> None:
    at = {"x": 0.0, "y": 0.0}
    fine = laplace(curved(0.0), at, "x", rest=integrated)
    assert fine.usable
    tail = wb.Block("tail", (8,))
    heavy = wb.Problem(
        [
            wb.Residual("tails", cs.sqrt(3 * cs.log(1 + tail.symbol**2 / 2) + 1e-12), 1.0),
            wb.Residual("pull", tail.symbol, 30.0),
        ],
        "tail",
        blocks=[tail],
    )
    found = laplace(heavy, {"tail": np.full(8, 1e-3)}, "tail[0]", rest=integrated)
    assert found.importance is not None
    assert not found.importance.holds, str(found.importance)
    assert "does not hold" in found.verdict
    with pytest.raises(NotConverged, match="k-hat"):
        found.interval()


def test_directions_that_the_data_know() -> None:
    """Two measured, two not: the measured ones come first, the rest is the prior."""
    x = wb.Block("x", (4,))
    A = np.array([[1.0, 2.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0]])
    data = wb.Residual("data", cs.DM(A) @ x.symbol - 1, 0.01)
    problem = wb.Problem([data, wb.residuals.gaussian(x.symbol, name="prior")], "x", blocks=[x])
    at = wb.solve(problem, {"x": np.zeros(4)}).values
    posterior = laplace(problem, at, directions(2, ["prior"]), draws=40_000)
    assert "100% data" in posterior.labels[0]
    np.testing.assert_allclose(posterior.covariance, np.eye(2), atol=0.03)
    exact = problem.linearize(at).covariance
    np.testing.assert_allclose(np.cov(posterior.points(40_000).T), exact, atol=0.03)


def test_what_nothing_holds_is_refused_by_name() -> None:
    x = wb.Block("x", (2,))
    problem = wb.Problem([wb.Residual("sum", cs.sum(x.symbol) - 1, 0.1)], "x", blocks=[x])
    with pytest.raises(Improper, match=r"x\[0\]|x\[1\]"):
        sample(problem, {"x": np.zeros(2)}, steps=100)
    bounds = {"x": (-1.0, 1.0)}
    held = wb.Problem(problem.residuals, "x", bounds, [x])
    posterior = sample(held, {"x": [0.5, 0.5]}, steps=4000, seed=1)
    assert posterior.usable, posterior.verdict
    assert np.abs(posterior.flat).max() <= 1.0
    # x0 + x1 = 1 and both below 1: nearly uniform on (0, 1)
    assert posterior.sd[0] == pytest.approx(np.sqrt(1 / 12), rel=0.1)


def test_names() -> None:
    body = wb.load_body("small")
    layout = wb.Layout(body.blocks())
    assert entries(layout, "betas").size == 10
    arm = entries(layout, ["pose[left_elbow]", "pose[left_wrist, x]"])
    assert next(layout.label(i) for i in arm) == "pose[left_elbow, x]"
    assert arm.size == 4
    for wrong, match in (
        ("bettas", "no free block is called 'bettas'"),
        ("pose[elbow]", r"pose\[left_elbow\]"),
        ("betas[77]", r"betas\[9\]"),
        ((), "no free number is named"),
    ):
        with pytest.raises(wb.WorkbenchError, match=match):
            entries(layout, wrong)


def test_parts_of_a_body_are_small_and_cover_it() -> None:
    body = wb.load_body("small")
    layout = wb.Layout(body.blocks())
    tree = body.points(*(b.symbol for b in body.blocks())).source.tree
    assert tree is not None
    parts = sampling_blocks(layout, (tree,))
    assert parts["shape and place"] == ("betas", "trans", "pose[pelvis]")
    meant = np.concatenate([entries(layout, names) for names in parts.values()])
    assert sorted(meant) == list(range(layout.size))
    assert max(entries(layout, names).size for names in parts.values()) <= 21
    assert [tree.names[k] for k in limbs(tree)[0]][:2] == ["left_hip", "left_knee"]


def test_draws_beside_laplace() -> None:
    agrees = [laplace(gaussian(np.eye(2)), {"x": np.zeros(2)}, seed=s) for s in (0, 1)]
    assert [row.remark for row in compared_with_laplace(*agrees)] == ["agrees", "agrees"]
    from tests.sampling.densities import rosenbrock, two_modes

    curved_one = sample(rosenbrock(), {"x": np.ones(2)}, steps=1600, walkers=16, seed=2)
    rows = compared_with_laplace(curved_one, laplace(rosenbrock(), {"x": np.ones(2)}))
    assert "curved" in rows[1].remark
    both = sample(two_modes(3.0), {"x": [3.0, 0.0]}, steps=2000, walkers=16, seed=4)
    rows = compared_with_laplace(both, laplace(two_modes(3.0), {"x": [3.0, 0.0]}))
    assert rows[0].remark == "2 modes"
    assert rows[1].remark == "agrees"
    with pytest.raises(wb.WorkbenchError, match="different entries"):
        compared_with_laplace(both, laplace(gaussian(np.eye(3)), {"x": np.zeros(3)}))


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"walkers": 3}, "3 walkers"),
        ({"walkers": 7}, "even"),
        ({"steps": 0}, "steps must be 1"),
        ({"ensembles": 0}, "ensembles must be 1"),
        ({"steps": 2, "thin": 5}, "cannot be kept"),
    ],
)
def test_bad_numbers_are_said(wrong: dict[str, int], match: str) -> None:
    with pytest.raises(wb.WorkbenchError, match=match):
        sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, **wrong)  # type: ignore[arg-type]


def test_a_start_without_density_is_said() -> None:
    x = wb.Block("x")
    problem = wb.Problem([wb.Residual("log", cs.log(x.symbol), 1.0)], "x", blocks=[x])
    with pytest.raises(wb.WorkbenchError, match="no density"):
        sample(problem, {"x": -1.0}, steps=100)
    positive = sample(
        problem, {"x": 1.0}, steps=400, walkers=16, seed=0
    )  # NaN below zero is no density
    assert positive.flat.min() > 0
