"""The benchmark of posteriors: densities that are known, made-up truths, runs that are cut."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.design import simulated as designs
from benchmarks.posterior import coverage, known
from benchmarks.posterior.pieces import Pieces, runs_of
from workbench.errors import BadFile

pytestmark = pytest.mark.thorough


def test_known_densities_are_what_they_say() -> None:
    """Costs are minus the log densities, up to a constant."""
    one = known.tails_together(5.0, 3, ("x[0]",))
    C = known._covariance(3, 1e3)
    L = np.linalg.cholesky(C)
    rng = np.random.default_rng(0)
    x = (rng.standard_normal((5, 3)) * 2) @ L.T
    problem = one.problem
    x0, given = problem.split(one.at)
    u = np.sum(np.linalg.solve(L, x.T) ** 2, axis=0) / 5
    np.testing.assert_allclose(problem.costs(x0, given)(x), 4 * np.log(1 + u), rtol=1e-6)
    funnel = known.wide_funnel()
    x0, given = funnel.problem.split(funnel.at)
    z = rng.standard_normal((5, 30))
    v, w = z[:, 0], z[:, 1:]
    minus_log = v**2 / 2 + 29 * v / 2 + np.sum(w**2, axis=1) * np.exp(-v) / 2
    found = funnel.problem.costs(x0, given)(z)
    np.testing.assert_allclose(found - found[0], minus_log - minus_log[0], rtol=1e-9)


def test_simulated_fits_are_covered() -> None:
    """Two fits of each kind of problem, a body's among them."""
    for make in (coverage.line, coverage.shape):
        found = coverage.covered(make(), 2, seed=5)
        assert (found["usable"], found["failed"]) == (2, 0)
        assert len(found["covered"]) == len(found["labels"])
        assert max(found["covered"]) == 2


def test_simulated_designs_have_the_predicted_spread() -> None:
    """60 fits know a standard deviation to 9 %, and 4 of these are allowed."""
    again = designs.compared("a decay", 60)
    for when in ("before", "after"):
        ratio = again[when]["predicted"] / again[when]["simulated"]
        assert abs(ratio - 1) < 4 / np.sqrt(120)
        assert again[when]["low"] < again[when]["simulated"] < again[when]["high"]


def test_runs_whose_line_was_cut_are_measured_again(tmp_path: Path) -> None:
    """Cut at every byte; the lines before it are kept, and the new one takes its place."""
    kept = {name: {"name": name, "run": {"off": [1, 23]}} for name in ("a", "b", "c")}
    first, second, third = (json.dumps(one) + "\n" for one in kept.values())
    file = tmp_path / "runs.jsonl"
    for cut in range(len(second) + 1):
        file.write_text(first + second[:cut])
        pieces, measured = Pieces(file), 0
        for name, one in kept.items():
            before = file.read_text()
            assert pieces.once(name, partial(dict, one["run"])) == one["run"]
            measured += file.read_text() != before
        whole = cut >= len(second) - 1  # the line end alone may be missing
        assert measured == (1 if whole else 2), second[:cut]
        assert file.read_text() == first + second + third, second[:cut]


def test_broken_lines_before_the_last_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    good = '{"name": "a", "run": {}}\n'
    for broken in ('{"name": "b", "ru\n', '{"name": "b"}\n', "[1]\n", "\n", '"\\ud8"\n'):
        file.write_text(good + broken + good)
        with pytest.raises(BadFile, match="line 2"):
            Pieces(file)
        assert file.read_text() == good + broken + good


def test_interrupted_measurements_are_not_kept(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    pieces = Pieces(file)
    pieces.once("a", lambda: {"off": 1})
    before = file.read_text()

    def interrupted() -> dict[str, Any]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pieces.once("b", interrupted)
    assert file.read_text() == before
    assert pieces.once("b", lambda: {"off": 3}) == {"off": 3}
    assert runs_of(file) == {"a": {"off": 1}, "b": {"off": 3}}
    assert Pieces(file).once("b", lambda: pytest.fail("measured twice")) == {"off": 3}
