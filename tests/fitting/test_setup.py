"""Setups: what is known of an answer, and what is said of data beside the fit."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from tests.fitting.test_cameras import person, written
from tests.fitting.test_detector_files import whole_body
from workbench.blocks import Block
from workbench.bodies.catalogue import load_body
from workbench.cli.run import print_outcome
from workbench.errors import BadArgument, BadSetup
from workbench.experiments import (
    EXPERIMENTS,
    SUITES,
    Experiment,
    KnownAnswer,
    Outcome,
    Setup,
    find,
    run,
)
from workbench.experiments.catalogue import SUMMARIES
from workbench.fitting.files.keypoints import read_observations
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.observations import COCO, FEET
from workbench.fitting.setup import digits
from workbench.problem import Problem
from workbench.reports import write_report
from workbench.residuals import gaussian

X = Block("x", (2,))
PROBLEM = Problem((gaussian(X.symbol, mean=[1.0, 2.0]),), ("x",), blocks=(X,))
START = {"x": np.zeros(2)}


def test_setup_keeps_a_known_answer() -> None:
    known = KnownAnswer("by hand", cost=0, values={"x": np.array([1.0, 2.0])}, residual_deviation=1)
    setup = Setup(PROBLEM, START, "?", known=known)
    assert setup.known is known
    assert known.cost == 0.0
    assert PROBLEM.linearize(known.values or {}).cost == known.cost
    assert Setup(PROBLEM, START, "?").known is None


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
        ({"views": [3]}, "`views` are a tuple of View, but something of type int"),
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


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """The keypoints of a body in one made-up image, and hands beside them."""
    body = load_body("small")
    points = body.landmark("coco", trans=[0.0, 0.0, 4.0]) * (1, -1, 1)  # v down
    pixels = points[:, :2] / points[:, 2:] * 500 + (320, 240)
    flat = np.column_stack([pixels, np.ones(len(pixels))])
    order = [body.landmark_names("coco").index(name) for name in (*COCO, *FEET)]
    data = whole_body(keypoints=flat[order].ravel().tolist(), lefthand_kpts=person(21))
    file = written(tmp_path_factory.mktemp("seen") / "a.json", data)
    setup = keypoint_fit(read_observations([file], focal=500.0), body, "which?")
    setup = replace(setup, synthetic="<all> of it")
    return run(Experiment("hands", lambda: setup, ""), compare=False)


@pytest.mark.thorough
def test_synthetic_data_are_called_so(outcome: Outcome, tmp_path: Path) -> None:
    surface = outcome.surface
    assert surface is not None
    made_up = replace(outcome, setup=replace(outcome.setup, truth=surface + 0.001))
    measured = replace(made_up, setup=replace(made_up.setup, synthetic=""))
    for one, heading in (
        (made_up, "Distances to the synthetic truth"),
        (measured, "Distances to the truth"),
    ):
        page = write_report(one, tmp_path / "run")
        text = page.read_text(encoding="utf-8")
        assert f"{heading}</h2>" in text
        assert ("Synthetic data</strong>: &lt;all&gt; of it." in text) == (one is made_up)
        said = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))["synthetic"]
        assert said == one.setup.synthetic
        assert ("in the synthetic truth" in text) == (one is made_up)
        console = Console(record=True, width=200, file=StringIO())
        print_outcome(console, one)
        assert ("synthetic data: <all> of it" in console.export_text()) == (one is made_up)
