"""The benchmark of posteriors: densities that are known, made-up truths, runs that are cut."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.design import simulated as designs
from benchmarks.images import draws
from benchmarks.images.intervals import places_of
from benchmarks.images.one_posterior import compiled_places
from benchmarks.posterior import coverage, known
from benchmarks.posterior.held_out import by_laplace, frames, simulated
from benchmarks.posterior.pieces import Pieces, runs_of
from tests.compilers import NEEDS_A_COMPILER
from workbench import load_body
from workbench.bodies import SkinnedBody
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


def test_made_up_truths_are_the_models() -> None:
    """At the truth, all that is whitened is standard normal: data and priors."""
    squares: dict[str, float] = {}
    count: dict[str, int] = {}
    for case in simulated(frames(6)):
        x, given = case.problem.split(case.truth)
        here = case.problem.linearize_at(x, given)
        some = abs(here.jacobian).any(axis=1)  # a keypoint of no confidence says nothing
        for name, rows in case.problem.rows.items():
            r = here.residual[rows][some[rows]]
            squares[name] = squares.get(name, 0.0) + float(r @ r)
            count[name] = count.get(name, 0) + r.size
    assert len(count) == 5
    for name, n in count.items():
        assert abs(squares[name] - n) < 4 * np.sqrt(2 * n), name


def test_laplaces_interval_is_about_the_answer() -> None:
    case = next(simulated([40]))
    found = by_laplace(case)
    ends, sd = np.array(found["ends"]), np.array(found["sd"])
    np.testing.assert_allclose(ends.mean(axis=0), found["mean"])
    np.testing.assert_allclose(np.ptp(ends, axis=0), 2 * 1.6448536 * sd)
    right = case.problem.free.pack(case.truth)[case.places]
    assert abs((right - found["mean"]) / sd).max() < 5


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


def test_interrupted_draws_continue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def drawn(fits: object, kind: str, method: str, case: object, seed: int, saved: Path) -> object:
        seen.append(seed)
        if len(seen) == 2:
            raise KeyboardInterrupt
        return {"seconds": 1.0, "times": 50.0, "seed": seed}

    monkeypatch.setattr(draws, "drawn", drawn)
    monkeypatch.setattr(draws, "compiled_places", lambda body: None)
    plan = (draws.Posteriors("people", "hamiltonian", (3, 4)),)
    with pytest.raises(KeyboardInterrupt):
        list(draws.draw(tmp_path, plan))
    assert len(list(draws.draw(tmp_path, plan))) == 2
    assert seen == [3, 4, 4]


@NEEDS_A_COMPILER
def test_compiled_places_are_those_of_the_body() -> None:
    body = load_body("default")
    assert isinstance(body, SkinnedBody)
    rng = np.random.default_rng(0)
    pose, betas, trans = (0.3 * rng.normal(size=(3, *block.shape)) for block in body.blocks())
    right = places_of(body, pose, betas, trans)
    np.testing.assert_allclose(compiled_places(body)(pose, betas, trans), right, atol=1e-12)
