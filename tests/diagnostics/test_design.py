"""Optimal design of measurements, compared with brute force and with the covariance itself."""

from itertools import combinations

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.tiers import few
from workbench.arrays import Array
from workbench.diagnostics.design import (
    Candidate,
    Quantity,
    a_optimal,
    d_optimal,
    design,
    e_optimal,
    sd_of,
    with_candidates,
)
from workbench.errors import BadArgument, NotFinite, UnknownName

N = 4


def rows(name: str, A: Array, x: wb.Block) -> wb.Residual:
    return wb.Residual(name, cs.DM(np.atleast_2d(A)) @ x.symbol, 1.0, blocks=(x,))


def linear(seed: int, count: int = 7, n: int = N) -> tuple[wb.Problem, dict, dict, wb.Block]:
    """A problem that determines everything, and candidates of one or two rows."""
    rng = np.random.default_rng(seed)
    x = wb.Block("x", (n,), "m")
    problem = wb.Problem([rows("known", rng.normal(size=(n + 1, n)), x)], ["x"], blocks=[x])
    several = {f"c{i}": rows(f"c{i}", rng.normal(size=(1 + i % 2, n)), x) for i in range(count)}
    return problem, several, {"x": rng.normal(size=n)}, x


def covariance(problem: wb.Problem, several: dict, at: dict, chosen: tuple[str, ...]) -> Array:
    return with_candidates(problem, several, chosen).linearize(at).covariance


BRUTE = (
    (d_optimal, lambda C: np.linalg.slogdet(C)[1]),
    (a_optimal, np.trace),
    (e_optimal, lambda C: np.linalg.eigvalsh(C)[-1]),
    (sd_of("x[2]"), lambda C: C[2, 2]),
    (d_optimal.over("x[0:2]"), lambda C: np.linalg.slogdet(C[:2, :2])[1]),
)


@pytest.mark.parametrize("which", range(len(BRUTE)))
@pytest.mark.parametrize("choose", few([2, 1, 3], 1))
def test_the_choice_is_that_of_brute_force(which: int, choose: int) -> None:
    criterion, size = BRUTE[which]
    problem, several, at, _ = linear(0)
    found = design(problem, several, at, choose=choose, criterion=criterion)
    each = {
        some: size(covariance(problem, several, at, some)) for some in combinations(several, choose)
    }
    assert set(found.chosen) == set(min(each, key=lambda some: each[some]))
    assert "all " in found.search


def test_numbers_are_those_of_the_covariance() -> None:
    problem, several, at, _ = linear(1)
    for criterion, value in (
        (d_optimal, lambda C: np.exp(np.linalg.slogdet(C)[1] / (2 * N))),
        (a_optimal, lambda C: np.sqrt(np.trace(C) / N)),
        (e_optimal, lambda C: np.sqrt(np.linalg.eigvalsh(C)[-1])),
        (sd_of("x"), lambda C: np.sqrt(np.trace(C))),
        (sd_of("x[1]"), lambda C: np.sqrt(C[1, 1])),
    ):
        found = design(problem, several, at, choose=2, criterion=criterion)
        C, after = (
            covariance(problem, several, at, ()),
            covariance(problem, several, at, found.chosen),
        )
        assert found.before.sd == pytest.approx(value(C), rel=1e-10)
        assert found.after.sd == pytest.approx(value(after), rel=1e-10)
        assert found.gain == pytest.approx(value(C) / value(after), rel=1e-10)
        np.testing.assert_allclose(found.sd_before, np.sqrt(np.diag(C)), rtol=1e-10)
        np.testing.assert_allclose(found.sd_after, np.sqrt(np.diag(after)), rtol=1e-10)
        for one in found.ranking:
            alone = covariance(problem, several, at, (one.name,))
            nats = 0.5 * (np.linalg.slogdet(C)[1] - np.linalg.slogdet(alone)[1])
            assert one.sd == pytest.approx(value(alone), rel=1e-10)
            assert one.nats == pytest.approx(nats, rel=1e-8)
        assert [one.sd for one in found.ranking] == sorted(one.sd for one in found.ranking)


def test_many_combinations_are_searched_greedily() -> None:
    problem, several, at, _ = linear(0, count=20)
    told = []
    found = design(
        problem, several, at, choose=6, progress=lambda done, of: told.append((done, of))
    )
    assert "no single exchange improves the choice" in found.search
    assert told
    assert all(0 < done <= of for done, of in told)
    assert len(set(found.chosen)) == 6
    sds = [found.before.sd, *(score.sd for score in found.steps)]
    assert sds == sorted(sds, reverse=True)


def test_null_directions_are_seen_first() -> None:
    """x - y is known; z is not, nor x + y. Small rows that see more come before large ones."""
    p = wb.Block("p", (3,), "m", ("x", "y", "z"))
    problem = wb.Problem([rows("apart", np.array([1.0, -1.0, 0.0]), p)], ["p"], blocks=[p])
    several = {
        "apart again": rows("a", 1e3 * np.array([1.0, -1.0, 0.0]), p),
        "x well": rows("b", np.array([100.0, 0, 0]), p),
        "x and z badly": rows("c", 0.01 * np.array([[1.0, 0, 0], [0, 0, 1.0]]), p),
        "z": rows("d", np.array([0, 0, 1.0]), p),
    }
    at = {"p": np.zeros(3)}
    found = design(problem, several, at)
    assert [one.name for one in found.ranking] == ["x and z badly", "x well", "z", "apart again"]
    assert [one.sees for one in found.ranking] == [2, 1, 1, 0]
    assert found.before.open == 2
    assert len(found.undetermined) == 2
    assert "undetermined" in found.report()
    assert found.gain == np.inf
    assert not np.isfinite(found.sd_before).any()
    np.testing.assert_allclose(found.sd_after[2], 100, rtol=1e-9)
    two = design(problem, several, at, choose=2)
    assert set(two.chosen) == {"x well", "z"}
    z = design(problem, several, at, criterion=sd_of("p[z]"))
    assert z.best == "z"  # which leaves x + y open, but that does not matter
    assert z.after.sd == pytest.approx(1, rel=1e-9)
    assert z.ranking[-1].sd == np.inf
    assert None in [one["sd"] for one in z.data()["ranking"]]
    apart = Quantity("x - y", p.symbol[0] - p.symbol[1], "m", blocks=(p,))
    assert design(problem, several, at, criterion=sd_of(apart)).before.sd == pytest.approx(1)


def test_a_quantity_has_the_sd_of_the_delta_method() -> None:
    problem, several, at, x = linear(6)
    length = Quantity("|x|", cs.norm_2(x.symbol), "m", blocks=(x,))
    found = design(problem, several, at, criterion=sd_of(length))
    C = covariance(problem, several, at, ())
    g = at["x"] / np.linalg.norm(at["x"])
    assert found.before.sd == pytest.approx(np.sqrt(g @ C @ g), rel=1e-9)
    assert found.unit == "m"
    both = Quantity("a place", x.symbol[:2], "m", blocks=(x,))
    place = design(problem, several, at, criterion=sd_of(both))
    assert place.before.sd == pytest.approx(np.sqrt(C[0, 0] + C[1, 1]), rel=1e-9)
    at_zero = Quantity("x0 squared", x.symbol[0] ** 2, "m^2", blocks=(x,))
    with pytest.raises(BadArgument, match="no free number changes x0 squared here"):
        design(problem, several, {"x": np.zeros(N)}, criterion=sd_of(at_zero))


def decay() -> tuple[wb.Problem, dict[str, wb.Residual]]:
    x = wb.Block("k", (1,), "1")

    def at(t: float) -> wb.Residual:
        return wb.Residual(f"{t:g}", cs.exp(-x.symbol * t), 0.01, blocks=(x,))

    hold = wb.residuals.gaussian(x.symbol, mean=[1.0], covariance=1.0, unit="1", name="prior")
    times = (0.25, 0.5, 1.0, 2.0, 4.0)
    return wb.Problem([hold], ["k"], blocks=[x]), {f"{t:g}": at(t) for t in times}


def test_designs_are_averaged_over_points() -> None:
    """exp(-k t) says most of k at t = 1 / k (the maximum of t exp(-k t))."""
    problem, several = decay()
    rates = (0.25, 0.5, 1.0, 2.0, 4.0)
    points = [{"k": np.array([k])} for k in rates]
    best = [design(problem, several, at).best for at in points]
    assert best == [f"{1 / k:g}" for k in rates]
    found = design(problem, several, points)
    assert found.points == 5
    assert found.best == "0.5"  # log(t exp(-k t)) has the mean log t - mean(k) t: best at 0.65
    log_sd = [np.log(design(problem, {"0.5": several["0.5"]}, at).after.sd) for at in points]
    assert found.after.log_sd == pytest.approx(np.mean(log_sd), rel=1e-10)
    assert "averaged over 5 points" in found.report()


def test_numbers_of_a_candidate_are_its_own() -> None:
    """One residual for several candidates, and constants in the problem that is made of them."""
    x, gain = wb.Block("x", (1,), "m"), wb.Block("gain", (1,))
    problem = wb.Problem([wb.Residual("known", x.symbol, 1.0, blocks=(x,))], ["x"], blocks=[x])
    seen = wb.Residual("seen", gain.symbol * x.symbol, 1.0, blocks=(x, gain))
    several = {f"{g}": Candidate((seen,), {"gain": np.array([g])}) for g in (1.0, 2.0, 3.0)}
    at = {"x": np.zeros(1)}
    found = design(problem, several, at, choose=2)
    assert found.chosen == ("3.0", "2.0")
    assert found.after.sd == pytest.approx(1 / np.sqrt(1 + 9 + 4))
    whole = with_candidates(problem, several, found.chosen)
    assert whole.fixed.names == ()
    assert np.sqrt(whole.linearize(at).covariance[0, 0]) == pytest.approx(found.after.sd)
    assert [r.name for r in whole.residuals] == ["known", "3.0", "2.0"]


def test_bad_input_gets_a_sentence() -> None:
    problem, several, at, x = linear(0)
    y = wb.Block("poze", (1,))
    wrong = wb.Residual("wrong", x.symbol[0] + y.symbol, 1.0, blocks=(x, y))
    with pytest.raises(
        UnknownName, match=r"no block is called 'poze'; there are x.*candidate 'far'"
    ):
        design(problem, {"far": wrong}, at)
    infinite = wb.Residual("infinite", cs.log(x.symbol[0] - float(at["x"][0])), 1.0, blocks=(x,))
    with pytest.raises(NotFinite, match="candidate 'near'"):
        design(problem, {"near": infinite}, at)
    for candidates, said in (
        ({}, "there are no candidates"),
        ({"a": ()}, "candidate 'a': a candidate has one residual or more"),
        ({"a": "poze"}, "candidate 'a'"),
        ({3: several["c0"]}, "must be a string"),
    ):
        with pytest.raises(BadArgument, match=said):
            design(problem, candidates, at)
    for choose in (0, 8, 1.5):
        with pytest.raises(BadArgument, match="1 to 7 of the candidates"):
            design(problem, several, at, choose=choose)
    with pytest.raises(BadArgument, match="the criterion is an object such as"):
        design(problem, several, at, criterion="d")
    with pytest.raises(BadArgument, match="a design is for a Problem"):
        design("balance", several, at)
    with pytest.raises(BadArgument, match="a list of such dicts"):
        design(problem, several, [])
    with pytest.raises(BadArgument, match="the name of an entry"):
        sd_of(3)
    with pytest.raises(UnknownName, match="no free block is called 'y'"):
        design(problem, several, at, criterion=sd_of("y"))
    with pytest.raises(UnknownName, match="no candidate is called 'far'"):
        with_candidates(problem, several, ["far"])


def test_equations_hold_exactly_and_bounds_do_not_count() -> None:
    """Three numbers of four in a plane: the covariance is that of what is left of the plane."""
    rng = np.random.default_rng(3)
    x = wb.Block("x", (N,), "m")
    A, normal = rng.normal(size=(N - 1, N)), rng.normal(size=N)  # with the plane: just enough
    at = {"x": rng.normal(size=N)}
    tie = wb.Constraint("tie", cs.dot(cs.DM(normal), x.symbol), normal @ at["x"], normal @ at["x"])
    touched = {"x": (np.where(np.arange(N) == 1, at["x"], -np.inf), np.inf)}
    problem = wb.Problem([rows("known", A, x)], ["x"], touched, [x], constraints=[tie])
    several = {f"c{i}": rows(f"c{i}", rng.normal(size=(1, N)), x) for i in range(4)}
    Z = np.linalg.svd(normal[None])[2][1:].T

    def known(*names: str) -> Array:
        J = with_candidates(problem, several, names).linearize(at).dense @ Z
        return Z @ np.linalg.inv(J.T @ J) @ Z.T

    for criterion, size in (
        (sd_of("x[2]"), lambda C: np.sqrt(C[2, 2])),
        (e_optimal, lambda C: np.sqrt(np.linalg.eigvalsh(C)[-1])),
        (d_optimal, lambda C: np.prod(np.linalg.eigvalsh(C)[1:]) ** (1 / 2 / (N - 1))),
    ):
        found = design(problem, several, at, criterion=criterion)
        assert not found.undetermined
        assert found.before.sd == pytest.approx(size(known()), rel=1e-9)
        by_hand = {name: size(known(name)) for name in several}
        assert {one.name: one.sd for one in found.ranking} == pytest.approx(by_hand, rel=1e-9)
    np.testing.assert_allclose(found.sd_before, np.sqrt(np.diag(known())), rtol=1e-9)
    all_known = wb.Constraint("all", x.symbol, at["x"], at["x"])
    held = wb.Problem([rows("known", A, x)], ["x"], blocks=[x], constraints=[all_known])
    with pytest.raises(BadArgument, match="equations hold all that matters"):
        design(held, several, at)
