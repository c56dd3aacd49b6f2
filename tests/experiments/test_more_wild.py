"""Moré and Wild's problems: our formulas against the published starts and another edition."""

import pickle
from typing import Any

import numpy as np
import pytest

from workbench.errors import BadArgument, UnknownName
from workbench.experiments import SUITES, Setup, find
from workbench.experiments.more_wild import LEAST, MORE_WILD

NAMES = [experiment.name for experiment in MORE_WILD]
# |f|^2 at the 53 starts, as in the output that comes with the paper's programs
PUBLISHED = """
7.20000e01 1.12500e03 1.16542e07 1.16859e09 4.98920e06 5.00936e08 2.42000e01 1.79577e06
2.50000e03 1.06000e04 2.15000e02 1.61540e06 4.00500e02 1.54575e08 4.16817e01 1.30623e03
5.31317e-3 1.69361e09 1.64308e01 2.32337e06 2.69042e01 8.15888e06 7.36782e01 2.05938e07
1.03115e03 4.17131e03 7.92669e06 3.08106e11 4.64282e-2 3.37706e-2 3.86177e-2 2.88830e-2
3.37633e-2 2.67406e-2 2.73248e02 1.61741e01 2.09342e00 1.99685e02 9.04000e02 1.35600e03
1.58200e03 1.80800e03 5.65000e01 7.05625e01 9.86875e01 2.53908e09 6.87380e12 3.36796e09
3.73513e09 3.99107e09 1.13001e13 9.38567e00 3.36582e10
"""


def built(name: str, **arguments: Any) -> Setup:
    return find(name, arguments).setup()


def test_starts_cost_what_is_published() -> None:
    assert SUITES["more-wild"] is MORE_WILD
    assert len(NAMES) == len(set(NAMES)) == 54
    assert len(PUBLISHED.split()) == 53
    for name, published in zip(NAMES, PUBLISHED.split(), strict=False):
        setup = built(name)
        cost = setup.problem.linearize(setup.start).cost
        assert float(f"{2 * cost:.5e}") == pytest.approx(float(published), rel=1.1e-5 / 2), name


def test_known_answers_are_stationary_and_cost_that() -> None:
    for name in NAMES:
        setup = built(name)
        assert setup.known is not None
        assert setup.known.cost is not None
        if setup.known.values is not None:
            here = setup.problem.linearize(setup.known.values)
            assert here.cost == pytest.approx(setup.known.cost, rel=1e-14, abs=1e-25), name
            np.testing.assert_allclose(here.gradient, 0, atol=1e-12, err_msg=name)
            assert setup.measures(setup.known.values)[0].value == pytest.approx(0, abs=1e-12)
        assert setup.measures(setup.start)[0].value > 0, name


def test_linear_problems_cost_their_least_squares() -> None:
    for name in ("linear-full-rank", "linear-rank-one", "linear-rank-one-zeros"):
        setup = built(f"more-wild-{name}")
        here = setup.problem.linearize(setup.start)
        step = np.linalg.lstsq(here.jacobian, -here.residual, rcond=1e-12)[0]
        n = setup.problem.free.size
        assert here.predicted_cost(step) == pytest.approx(LEAST[name, n], rel=1e-12)


def test_members_pickle_and_are_found_by_name() -> None:
    for name in [one.name for suite in SUITES.values() for one in suite]:
        again = pickle.loads(pickle.dumps(find(name, {"start": "2"})))
        assert again == find(name, {"start": 2})
        if name in NAMES:
            assert again.setup().problem.free.size == again.arguments["n"], name


def test_unknown_members_are_refused() -> None:
    with pytest.raises(UnknownName, match="no function is called 'watsen'; there are bard, "):
        built("more-wild-meyer", function="watsen")
    with pytest.raises(UnknownName, match="unknowns of watson is called '7'; there are 6, 9, 12"):
        built("more-wild-watson-6", n=7)
    with pytest.raises(BadArgument, match="start must be from 0 on, not -1"):
        built("more-wild-meyer", start=-1)
