"""POSTERIOR.md is written from its numbers, and what it claims of known posteriors holds."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.posterior import coverage, known, page
from benchmarks.posterior.__main__ import PARTS
from benchmarks.posterior.pieces import Pieces

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def kept(part: str) -> dict[str, Any]:
    file = BENCHMARKS / "results" / f"posterior-{part}.json"
    found: dict[str, Any] = json.loads(file.read_text())
    return found


def test_the_page_is_that_of_the_numbers() -> None:
    parts = [part for part in PARTS if (BENCHMARKS / "results" / f"posterior-{part}.json").exists()]
    assert (BENCHMARKS / "POSTERIOR.md").read_text() == page.text({p: kept(p) for p in parts})


def test_no_interval_called_usable_is_wrong() -> None:
    found = kept("known")["found"]
    for name, runs in found["densities"].items():
        assert known.counted(runs)["wrong"] == 0, name
        assert known.counted(runs)["runs"] > 0, name
    counts = [known.counted(runs) for runs in found["densities"].values()]
    assert sum(one["refused"] for one in counts) <= 0.05 * sum(one["right"] for one in counts)
    for block, ways in found["person"]["blocks"].items():
        for name, way in ways.items():
            assert not way["usable"] or max(way["end"]) < known.OFF, (block, name)
            if name.startswith("sample"):
                assert way["usable"], (block, name)
                assert max(abs(np.array(way["ratio"]) - 1)) < known.OFF, (block, name)


def test_intervals_cover_truths_that_are_drawn_from_the_prior() -> None:
    for name, one in kept("coverage")["found"].items():
        low, high = one["band"]
        assert [low, high] == [*coverage.band(one["usable"], len(one["covered"]))], name
        assert low <= min(one["covered"]), name
        assert max(one["covered"]) <= high, name


def test_a_few_simulated_fits() -> None:
    """Two fits of each kind of problem, a body's among them."""
    for make in (coverage.line, coverage.shape):
        found = coverage.covered(make(), 2, seed=5)
        assert found["usable"] == 2
        assert found["failed"] == 0
        assert len(found["covered"]) == len(found["labels"])
        assert max(found["covered"]) == 2


def test_what_was_measured_is_not_measured_again(tmp_path: Path) -> None:
    file = tmp_path / "some" / "runs.jsonl"
    assert Pieces(file).once("a", lambda: {"off": 0.1}) == {"off": 0.1}
    again = Pieces(file)
    assert again.once("a", lambda: pytest.fail("measured twice")) == {"off": 0.1}
    again.once("b", lambda: {"off": 0.2})
    assert len(file.read_text().splitlines()) == 2
    assert Pieces().once("a", lambda: {"off": 0.3}) == {"off": 0.3}


def test_an_interval_is_wrong_by_its_width_or_by_an_end() -> None:
    runs = [
        {"off": 0.1, "end": 0.1, "usable": True},
        {"off": 0.2, "end": 0.1, "usable": True},
        {"off": 0.1, "end": 0.3, "usable": True},
        {"off": 0.0, "end": 0.0, "usable": False},
    ]
    found = {"runs": 4, "right": 2, "usable": 3, "wrong": 2, "refused": 1}
    assert known.counted(runs) == found


def test_two_of_the_known_densities_are_what_they_say() -> None:
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
