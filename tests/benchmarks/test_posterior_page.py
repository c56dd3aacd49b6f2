"""POSTERIOR.md is written from its numbers, and what it claims of known posteriors holds."""

import json
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.posterior import coverage, known, page
from benchmarks.posterior.__main__ import PARTS
from benchmarks.posterior.pieces import Pieces, runs_of
from workbench.errors import BadFile

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


def test_a_run_whose_line_was_cut_by_a_kill_is_measured_again(tmp_path: Path) -> None:
    """Cut at every byte; the lines before it are kept, and the new one takes its place."""
    kept = {name: {"name": name, "run": {"off": [1, 23]}} for name in ("a", "b", "c")}
    first, second, third = (json.dumps(one) + "\n" for one in kept.values())
    file = tmp_path / "runs.jsonl"
    for cut in range(len(second) + 1):
        file.write_text(first + second[:cut])
        pieces, measured = Pieces(file), 0
        for name, one in kept.items():
            before = file.read_text()
            assert pieces.once(name, partial(deepcopy, one["run"])) == one["run"]
            measured += file.read_text() != before
        whole = cut >= len(second) - 1  # the line end alone may be missing
        assert measured == (1 if whole else 2), second[:cut]
        assert file.read_text() == first + second + third, second[:cut]


def test_a_broken_line_that_is_not_the_last_is_named(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    good = '{"name": "a", "run": {}}\n'
    for broken in ('{"name": "b", "ru\n', '{"name": "b"}\n', "[1]\n", "\n", '"\\ud8"\n'):
        for content in (good + broken + good, good + broken):  # what ends in a line end is no half
            file.write_text(content)
            with pytest.raises(BadFile, match=rf"line 2 of .*{file.name}"):
                Pieces(file)
            assert file.read_text() == content
    file.write_bytes(b"\xff\xfe\n" + good.encode())
    with pytest.raises(BadFile, match="line 1 of"):
        Pieces(file)


def test_interrupted_as_it_measures_or_writes_it_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "runs.jsonl"
    pieces = Pieces(file)
    pieces.once("a", lambda: {"off": 1})
    before = file.read_text()

    def interrupted() -> dict[str, Any]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pieces.once("b", interrupted)
    assert file.read_text() == before

    def half(file: Path, one: dict[str, Any]) -> None:
        with file.open("a") as lines:
            lines.write(json.dumps(one)[:9])
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("benchmarks.posterior.pieces._append", half)
        with pytest.raises(KeyboardInterrupt):
            pieces.once("b", lambda: {"off": 2})
    assert file.read_text() == before + '{"name": '
    assert runs_of(file) == {"a": {"off": 1}}
    assert pieces.once("b", lambda: {"off": 3}) == {"off": 3}  # in the same process
    assert runs_of(file) == {"a": {"off": 1}, "b": {"off": 3}}
    assert Pieces(file).once("b", lambda: pytest.fail("measured twice")) == {"off": 3}


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
