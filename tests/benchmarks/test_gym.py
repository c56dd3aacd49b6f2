"""The gym's problems: their answers in forty digits, their derivatives, their seeds."""

import hashlib

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from benchmarks.gym import answers
from benchmarks.gym.cases import CASES, NEW
from benchmarks.gym.high_precision import derivatives, evaluated, newton_step, residual_of
from benchmarks.gym.regressions import MODELS, REGRESSIONS, certified
from workbench.errors import NotSupported
from workbench.fitting.setup import Setup

FIRST = {one.problem: one for one in reversed(NEW)}
SCALAR = [name for name in sorted(FIRST) if not name.startswith("body")]
BODIES = [name for name in sorted(FIRST) if name.startswith("body")]
STORED = sorted(answers.stored())
PUBLISHED = {  # the least sum of squares, as published
    "chain-singular-broyden": "0",
    "el-attar": "1.712780",
    "exponential-growth": "0.240511",
    "hatfield-d": "6.615114e-08",
    "himmelblau-32": "318.572",
    "judge": "16.0817",
    "mgh-broyden-banded": "0",
    "mgh-discrete-boundary": "0",
    "mgh-discrete-integral": "0",
    "mgh-gaussian": "1.12793e-08",
    "mgh-penalty-1": "7.08765e-05",
    "mgh-penalty-2": "2.93661e-04",
    "mgh-powell-badly-scaled": "0",
    "schittkowski-308": "0.773199",
    "vibrating-beam": "0.156446",
}
STARTS = {  # sums of squares there, which the edition of CUTEst in sif2jax has as well
    "beale": 14.203125,
    "biggs-exp6": 0.77907007565597,
    "brown-badly-scaled": 999998000003.0,
    "gaussian": 3.88810699e-06,
    "powell-badly-scaled": 1.13526171734838,
}
OTHER_STARTS = {
    "cluster": 1.0,
    "dennis-schnabel-d": 83210000.0,
    "devilliers-glasser-1": 105127.0,
    "devilliers-glasser-2": 10940.1,
    "engvall": 629.0,
    "exponential-growth": 24.0625,
    "gottfried": 5.78993,
    "heart-6": 564.813,
    "pole-fit": 946.568,
    "vibrating-beam": 8231.28,
}
DRAWN = {  # by problem the cost at its start, which depends on all that was drawn
    "exponentials-exact-0": 6.05559,
    "exponentials-noisy-0": 6.00691,
    "peaks-noisy-1": 661.972,
    "logistic-noisy-2": 185.172,
    "saturation-noisy-3": 678.896,
    "damped-exact-4": 146.779,
    "rational-noisy-5": 16.1979,
    "robust-damped-huber-1": 3543.34,
    "robust-circle-geman-mcclure-2": 16.5048,
    "robust-motion-huber-0": 1267.05,
    "bundle-noisy-0": 2.78442e06,
    "arm-planar-6-1": 2208.49,
    "arm-spatial-2": 15967.1,
    "body-0.6-1003": 1.26526e08,
}


def built(problem: str) -> Setup:
    return FIRST[problem].experiment.setup()


def test_there_are_enough_and_names_are_not_used_twice() -> None:
    assert len(FIRST) >= 200
    assert len({one.name for one in CASES}) == len(CASES)
    assert {one.problem for one in CASES} >= set(STORED)


@pytest.mark.parametrize("name", MODELS)
def test_what_is_certified_is_a_minimum_to_ten_digits(name: str) -> None:
    setup = built(f"nist-{name.lower()}")
    known = setup.known
    assert known is not None
    assert known.values is not None
    assert known.residual_deviation is not None
    here = setup.problem.linearize(known.values)
    assert here.cost == pytest.approx(known.cost, rel=2e-10)
    dof = setup.problem.size - setup.problem.free.size
    assert known.residual_deviation == pytest.approx(np.sqrt(2 * here.cost / dof), rel=2e-10)
    with mp.workdps(40):
        x = setup.problem.free.pack(known.values)
        step = newton_step(residual_of(setup.problem), list(x))
    assert max(abs(float(s) / b) for s, b in zip(step, x, strict=True)) < 1e-10


def test_starts_of_regressions_are_nists() -> None:
    assert len(REGRESSIONS) == 2 * len(MODELS) == 2 * len(certified()) == 30
    by_name = {one.name: one.experiment for one in REGRESSIONS}
    assert by_name["nist-mgh10, start 1"].setup().start["b"].tolist() == [2, 400000, 25000]
    assert by_name["nist-mgh10, start 2"].setup().start["b"].tolist() == [0.02, 4000, 250]


@pytest.mark.parametrize("name", [name for name in sorted(FIRST) if name not in STORED])
def test_an_answer_in_closed_form_has_no_residual(name: str) -> None:
    setup = built(name)
    assert setup.known is not None
    if FIRST[name].family == "nist":
        return
    assert setup.made_of is not None
    assert setup.known.cost == 0
    start = setup.problem.linearize(setup.start).cost
    assert setup.problem.linearize(dict(setup.start) | dict(setup.made_of)).cost < 1e-20 * start


@pytest.mark.parametrize("name", STORED)
def test_a_stored_answer_is_a_minimum(name: str) -> None:
    """The gradient in 40 digits leads Newton's method nowhere; the curvature is nowhere negative.

    A singular answer costs nothing, and so do equations that are solved.
    """
    setup, stored = built(name), answers.stored()[name]
    x = answers.point(name)
    assert setup.known is not None
    assert setup.known.cost == stored["cost"]
    r = setup.problem.residual(x, np.zeros(setup.problem.fixed.size))
    start = setup.problem.linearize(setup.start).cost
    assert r @ r / 2 == pytest.approx(stored["cost"], rel=1e-9, abs=1e-20 * start)
    if stored["how"].endswith("singular"):
        return
    residual = residual_of(setup.problem)
    gradient, hessian = derivatives(residual)
    with mp.workdps(40):
        g = np.array(evaluated(gradient, list(x)).tolist(), dtype=float).ravel()
    H = np.asarray(hessian(x))
    size = np.sqrt(np.diag(H))
    scaled = H / np.outer(size, size)
    assert np.linalg.eigvalsh(scaled)[0] > -1e-9
    step = np.linalg.lstsq(scaled, -g / size, rcond=1e-15)[0] / size
    assert np.abs(step).max() < 1e-11 * max(1e-3, np.abs(x).max())


def test_published_minima_come_out_in_all_their_digits() -> None:
    for name, published in PUBLISHED.items():
        found = 2 * answers.stored()[name]["cost"]
        if published == "0":
            assert found == 0, name
            continue
        digits = len(published.partition("e")[0].replace(".", "").lstrip("0"))
        assert found == pytest.approx(float(published), rel=2 * 10.0 ** (1 - digits)), name


def test_published_starts_cost_what_others_say() -> None:
    for name, cost in {**{f"mgh-{k}": v for k, v in STARTS.items()}, **OTHER_STARTS}.items():
        setup = built(name)
        found = 2 * setup.problem.linearize(setup.start).cost
        assert found == pytest.approx(cost, rel=1e-5), name


def test_far_starts_are_multiples_of_the_near_one() -> None:
    starts = {
        one.name: one.experiment.setup().start["x"] for one in NEW if one.problem == "mgh-wood"
    }
    near = starts["mgh-wood, start x 1"]
    assert near.tolist() == [-3, -1, -3, -1]
    assert (starts["mgh-wood, start x 10"] == 10 * near).all()
    assert (starts["mgh-wood, start x 100"] == 100 * near).all()


@pytest.mark.parametrize("name", [name for name in SCALAR if not name[-1].isdigit() or "0" in name])
def test_jacobians_are_differences_in_forty_digits(name: str) -> None:
    setup = built(name)
    x, fixed = setup.problem.split(setup.start)
    along = np.random.default_rng(0).standard_normal(x.size)
    residual = residual_of(setup.problem)
    with mp.workdps(40):
        h = mp.mpf("1e-12")
        ahead, behind = (
            evaluated(
                residual, [a + sign * h * b for a, b in zip(map(mp.mpf, x), along, strict=True)]
            )
            for sign in (1, -1)
        )
        differences = np.array(((ahead - behind) / (2 * h)).tolist(), dtype=float).ravel()
    J = np.asarray(setup.problem.linearize_at(x, fixed).jacobian)
    scale = np.abs(J) @ np.abs(along)
    assert np.abs(J @ along - differences).max() <= 1e-9 * scale.max()


def test_jacobians_of_bodies_are_differences() -> None:
    setup = built(BODIES[0])
    x, fixed = setup.problem.split(setup.start)
    along = np.random.default_rng(0).standard_normal(x.size)
    ahead, behind = (setup.problem.residual(x + h * along, fixed) for h in (1e-6, -1e-6))
    J = np.asarray(setup.problem.linearize_at(x, fixed).jacobian)
    np.testing.assert_allclose(J @ along, (ahead - behind) / 2e-6, rtol=0, atol=1e-3)


def test_what_is_drawn_is_drawn_again() -> None:
    for name, cost in DRAWN.items():
        setup = built(name)
        assert setup.problem.linearize(setup.start).cost == pytest.approx(cost, rel=1e-5), name
        again = built(name)
        assert all((setup.start[k] == again.start[k]).all() for k in setup.start)


def test_an_operation_without_many_digits_is_named_with_those_that_there_are() -> None:
    x = cs.SX.sym("x", 2)
    with pytest.raises(
        NotSupported, match=r"'odd' has CasADi's operation OP_ERF, .*OP_EXP, OP_LOG"
    ):
        evaluated(cs.Function("odd", [x], [cs.erf(x)]), [1.0, 2.0])


def test_high_precision_sees_what_doubles_do_not() -> None:
    setup = built("hatfield-d")
    residual = residual_of(setup.problem)
    x = answers.point("hatfield-d")
    with mp.workdps(40):
        exact = evaluated(residual, list(x))
        shifted = evaluated(residual, [mp.mpf(x[0]) + mp.mpf("1e-25"), *x[1:]])
        moved = float(mp.norm(exact - shifted, mp.inf))
    np.testing.assert_allclose(
        np.array(exact.tolist(), dtype=float).ravel(),
        setup.problem.residual(x, np.zeros(0)),
        atol=1e-14,
    )
    assert 1e-26 < moved < 1e-24


def test_the_data_of_regressions_are_those_that_were_read() -> None:
    told = hashlib.sha256(
        repr({name: certified()[name]["data"] for name in sorted(MODELS)}).encode()
    ).hexdigest()
    assert told[:16] == "faa590dc13818516"
