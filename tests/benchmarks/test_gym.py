"""The gym's problems: their answers in forty digits, their derivatives, their split."""

import hashlib
from pathlib import Path

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from benchmarks.gym import answers
from benchmarks.gym.cases import CASES, NEW
from benchmarks.gym.high_precision import derivatives, evaluated, newton_step, residual_of
from benchmarks.gym.looks import looked
from benchmarks.gym.regressions import MODELS, REGRESSIONS, certified
from benchmarks.gym.split import is_even, is_for_tuning, tuning, untouched
from workbench.errors import NotSupported
from workbench.experiments import SUITES
from workbench.fitting.setup import Setup

pytestmark = pytest.mark.thorough

FIRST = {one.problem: one for one in reversed(NEW)}
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


def built(problem: str) -> Setup:
    return FIRST[problem].experiment.setup()


def test_names_of_problems_are_not_used_twice() -> None:
    assert len(FIRST) >= 200
    assert len({one.name for one in CASES}) == len(CASES)
    assert {one.problem for one in CASES} >= set(STORED)


def test_certified_answers_are_minima_to_ten_digits() -> None:
    for name in MODELS:
        setup = built(f"nist-{name.lower()}")
        known = setup.known
        assert known is not None
        assert known.values is not None
        here = setup.problem.linearize(known.values)
        assert here.cost == pytest.approx(known.cost, rel=2e-10), name
        dof = setup.problem.size - setup.problem.free.size
        deviation = np.sqrt(2 * here.cost / dof)
        assert known.residual_deviation == pytest.approx(deviation, rel=2e-10), name
        with mp.workdps(40):
            x = setup.problem.free.pack(known.values)
            step = newton_step(residual_of(setup.problem), list(x))
        assert max(abs(float(s) / b) for s, b in zip(step, x, strict=True)) < 1e-10, name


def test_starts_of_regressions_are_nists() -> None:
    assert len(REGRESSIONS) == 2 * len(MODELS) == 2 * len(certified()) == 30
    by_name = {one.name: one.experiment for one in REGRESSIONS}
    assert by_name["nist-mgh10, start 1"].setup().start["b"].tolist() == [2, 400000, 25000]
    assert by_name["nist-mgh10, start 2"].setup().start["b"].tolist() == [0.02, 4000, 250]


def test_answers_in_closed_form_have_no_residual() -> None:
    for name in sorted(set(FIRST) - set(STORED)):
        if FIRST[name].family == "nist":
            continue
        setup = built(name)
        assert setup.known is not None
        assert setup.made_of is not None
        assert setup.known.cost == 0, name
        start = setup.problem.linearize(setup.start).cost
        found = setup.problem.linearize(dict(setup.start) | dict(setup.made_of)).cost
        assert found < 1e-20 * start, name


@pytest.mark.parametrize("part", range(4))
def test_stored_answers_are_minima(part: int) -> None:
    """The gradient in 40 digits leads Newton's method nowhere; the curvature is nowhere negative.

    A singular answer costs nothing, and so do equations that are solved.
    """
    for name in STORED[part::4]:
        setup, stored = built(name), answers.stored()[name]
        x = answers.point(name)
        r = setup.problem.residual(x, np.zeros(setup.problem.fixed.size))
        start = setup.problem.linearize(setup.start).cost
        assert r @ r / 2 == pytest.approx(stored["cost"], rel=1e-9, abs=1e-20 * start), name
        if stored["how"].endswith("singular"):
            continue
        gradient, hessian = derivatives(residual_of(setup.problem))
        with mp.workdps(40):
            g = np.array(evaluated(gradient, list(x)).tolist(), dtype=float).ravel()
        H = np.asarray(hessian(x))
        size = np.sqrt(np.diag(H))
        scaled = H / np.outer(size, size)
        assert np.linalg.eigvalsh(scaled)[0] > -1e-9, name
        step = np.linalg.lstsq(scaled, -g / size, rcond=1e-15)[0] / size
        assert np.abs(step).max() < 1e-11 * max(1e-3, np.abs(x).max()), name


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


def test_jacobians_are_differences_in_forty_digits() -> None:
    families = {one.family: name for name, one in FIRST.items() if not name.startswith("body")}
    for name in families.values():
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
        assert np.abs(J @ along - differences).max() <= 1e-9 * scale.max(), name


def test_operations_without_many_digits_are_refused() -> None:
    x = cs.SX.sym("x", 2)
    with pytest.raises(NotSupported, match="OP_ERF"):
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


def test_data_of_regressions_are_unchanged() -> None:
    told = hashlib.sha256(
        repr({name: certified()[name]["data"] for name in sorted(MODELS)}).encode()
    ).hexdigest()
    assert told[:16] == "faa590dc13818516"


def told(problems: tuple[str, ...]) -> str:
    return hashlib.sha256("\n".join(sorted(problems)).encode()).hexdigest()[:16]


def test_split_is_the_committed_one() -> None:
    """A problem that is added belongs where its hash says; none may change sides."""
    assert told(tuple({one.problem for one in untouched()})) == "c5f26e28fc1f135f"
    assert told(tuple({one.problem for one in tuning(NEW)})) == "a4734a7e15d25739"
    assert [is_even(name) for name in ("mgh-wood", "mgh-gulf", "beam")] == [True, False, True]


def test_starts_of_a_problem_are_on_one_side() -> None:
    sides: dict[str, set[bool]] = {}
    for one in CASES:
        sides.setdefault(one.problem, set()).add(is_for_tuning(one))
    assert all(len(side) == 1 for side in sides.values())
    assert {one.name for one in tuning()}.isdisjoint(one.name for one in untouched())
    assert len(tuning()) + len(untouched()) == len(CASES)


def test_untouched_problems_were_not_tuned_on() -> None:
    there = {one.problem for one in untouched()}
    assert not there & {one.name for one in SUITES["nist"]}
    functions = {str(one.arguments["function"]) for one in SUITES["more-wild"]}
    assert not {name for name in there if name.partition("-")[2] in functions}
    assert not {name for name in there if "rosenbrock" in name and "mgh" in name}
    assert sum(one.family == "nist" for one in untouched()) == 30


def test_looks_at_untouched_problems_are_logged(tmp_path: Path) -> None:
    log = tmp_path / "looks.md"
    assert looked("to try | the\nlog", log) == untouched()
    looked("again", log)
    first, second = log.read_text().splitlines()[-2:]
    assert "| to try / the log |" in first
    assert "| again |" in second
    assert len(first.split("|")) == 6
    with pytest.raises(ValueError, match="say what the look"):
        looked("  ", log)
    with pytest.raises(OSError, match="no"):
        looked("nowhere to write", tmp_path / "no" / "looks.md")
