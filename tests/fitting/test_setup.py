"""Setups: what is known of an answer, and what is said of data beside the fit."""

import numpy as np
import pytest

from workbench.blocks import Block
from workbench.errors import BadArgument, BadSetup
from workbench.experiments import (
    EXPERIMENTS,
    SUITES,
    KnownAnswer,
    Setup,
    find,
)
from workbench.experiments.catalogue import SUMMARIES
from workbench.fitting.setup import digits
from workbench.problem import Problem
from workbench.residuals import gaussian

X = Block("x", (2,))
PROBLEM = Problem((gaussian(X.symbol, mean=[1.0, 2.0]),), ("x",), blocks=(X,))
START = {"x": np.zeros(2)}


def test_bad_known_answers_are_refused() -> None:
    for facts, said in [
        ({"source": " "}, "needs its source as a text"),
        ({"cost": -1.0}, "known cost must be a number from 0 on, not -1.0"),
        ({"cost": np.nan}, "known cost"),
        ({"cost": "1"}, "known cost must be a number"),
        ({"residual_deviation": np.inf}, "known residual_deviation"),
        ({"values": [1.0, 2.0]}, "dict of arrays"),
        ({"deviations": {"x": np.ones(2)}}, "which are missing; give them too"),
        ({"values": {"y": np.ones(2)}}, "hold y, which is not free; the free blocks are x"),
        ({"values": {"x": np.ones(3)}}, "not the problem's: block 'x' has shape"),
        ({"values": {"x": np.array([1, np.nan])}}, r"not the problem's: .* at \[1\]"),
        ({"values": START, "deviations": {"x": [1, -1]}}, r"known deviation of x\[1\] is -1"),
    ]:
        with pytest.raises(BadSetup, match=said):
            Setup(PROBLEM, START, "?", known=KnownAnswer(**({"source": "by hand"} | facts)))


def test_bad_fields_of_setups_are_refused() -> None:
    for fields, said in [
        ({"known": {"cost": 1.0}}, "`known` of a setup must be a KnownAnswer or None"),
        ({"strategy": 3}, "`strategy` of a setup must be a function that makes a solver"),
        ({"views": [3]}, "`views` are a tuple of View, but among them is something of type int"),
    ]:
        with pytest.raises(BadSetup, match=said):
            Setup(PROBLEM, START, "?", **fields)  # type: ignore[arg-type]


def test_suites_are_not_experiments() -> None:
    with pytest.raises(
        BadArgument, match="nist is a suite; give one of its 12 problems, such as nist-c"
    ):
        find("nist")
    members = [one.name for suite in SUITES.values() for one in suite]
    assert len(set(members) | set(EXPERIMENTS)) == len(members) + len(EXPERIMENTS)
    assert SUITES.keys() == SUMMARIES.keys()
    for one in members:
        assert find(one).name == one


def test_digits_are_those_of_the_worst_parameter() -> None:
    c = {"x": np.array([2.0, -3.0, 0.0])}
    assert digits(c, c) == 11
    assert digits({"x": [2.0 + 2e-5, -3.0, 0.0]}, c) == pytest.approx(5)
    assert digits({"x": [2.0 + 2e-5, -3.0, 1e-3]}, c) == pytest.approx(3)
    assert digits({"x": [2.0 + 2e-13, -3.0, 0.0]}, c) == 11
    assert digits({"x": [200.0, -3.0, 0.0]}, c) == 0
    assert digits({"x": [np.nan, -3.0, 0.0]}, c) == 0
    assert digits({"x": [-np.inf, -3.0, 0.0], "y": 1.0}, c) == 0
    with pytest.raises(BadSetup, match="no values of x to compare; there are y"):
        digits({"y": 1.0}, c)
