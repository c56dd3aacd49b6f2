"""The benchmarks run at tiny sizes and agree; how fast they are is not asked here."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from benchmarks import __main__ as command
from benchmarks import candidates, measuring, page, performance, performance_large
from benchmarks.candidates import COMPILED, FLOOR, JAX, NUMPY, Candidate, Disagreement
from benchmarks.problems import Case, case_of, random_body

pytestmark = pytest.mark.thorough


def test_candidates_take_turns_on_changing_inputs() -> None:
    seen: dict[str, list[int]] = {"a": [], "b": []}
    calls = {name: each.append for name, each in seen.items()}
    seconds = measuring.side_by_side(calls, [1, 2, 3], 2)
    for each in seen.values():  # the points of the last two are remembered
        assert all(len({*some}) == 3 for some in zip(each, each[1:], each[2:], strict=False))
    assert 0 < seconds["a"]["least"] <= seconds["a"]["median"]


def test_words_of_the_command_name_results_and_parts() -> None:
    assert command.chosen(["performance", "fits"]) == {"performance": ("fits",)}
    assert command.chosen(["page"]) == {}
    assert list(command.chosen([]))[:2] == ["performance", "solvers"]
    with pytest.raises(ValueError, match="no part of performance is called fit; there are deriv"):
        command.chosen(["performance", "fit"])
    with pytest.raises(ValueError, match="no measurement is called speed; there are performance"):
        command.chosen(["speed"])


def test_numbers_are_kept_beside_those_of_other_parts(tmp_path: Path) -> None:
    assert measuring.kept("a", tmp_path) is None
    measuring.keep("a", {"x": {"n": 1 / 3}, "y": {"n": 2}}, tmp_path)
    found = measuring.beside_kept("a", {"y": {"n": 3}}, tmp_path)
    assert found["x"]["n"] == 0.33333
    assert "processor" in found["x"]["machine"]
    assert found["y"] == {"n": 3}
    file = tmp_path / "page.md"
    file.write_text("before\n<!-- a -->\nold\n<!-- end of a -->\nafter\n")
    measuring.write_between(file, "a", measuring.table(("name", "n"), [("y", 3)]))
    middle = "| name | n |\n| --- | --: |\n| y | 3 |"
    assert file.read_text() == f"before\n<!-- a -->\n{middle}\n<!-- end of a -->\nafter\n"
    with pytest.raises(ValueError, match="no place for b"):
        measuring.write_between(file, "b", "")


def test_pages_are_those_of_the_kept_numbers(tmp_path: Path) -> None:
    here = tmp_path / "benchmarks"
    here.mkdir()
    shutil.copytree(measuring.RESULTS, here / "results")
    for name in command.PAGES:
        shutil.copy(measuring.HERE / name, here)
    command.write_pages(here)
    for name in command.PAGES:
        assert (here / name).read_text("utf-8") == (measuring.HERE / name).read_text("utf-8"), name


@pytest.mark.filterwarnings("default")  # peers have warnings of their own
@pytest.mark.parametrize("part", performance.PARTS)
def test_parts_agree_and_write_their_tables(part: str) -> None:
    """Each compares what its candidates compute before it times them."""
    found = performance.measured(True, (part,))
    text = performance.tables(found)
    assert text.startswith(f"## {performance.PARTS[part].heading}\n\n| ")
    assert NUMPY in text or part in ("vertices", "videos")
    page.targets(found)  # can be judged


@pytest.mark.filterwarnings("default")  # they have warnings of their own
@pytest.mark.parametrize(
    ("make", "packages"),
    [
        (candidates.by_differences, []),
        (candidates.in_jax, ["jax"]),
        (candidates.in_torch, ["torch", "smplx"]),
    ],
)
def test_peers_agree_with_the_workbench(
    make: Callable[[Case], Candidate], packages: list[str]
) -> None:
    if any(find_spec(package) is None for package in packages):
        pytest.skip(f"{' and '.join(packages)} needed: pip install '.[bench]'")
    case = case_of("40", random_body(40))
    x, y = case.people(2)
    candidates.check(make(case.seeing(x)), case.seeing(x), y)


def test_candidates_that_disagree_are_refused() -> None:
    case = case_of("40", random_body(40))
    (x,) = case.people(1)
    right = candidates.ours("wrong", case)
    wrong = replace(right, forward=lambda x: right.forward(x) + 1e-6)
    with pytest.raises(Disagreement, match="wrong on 40: its value is"):
        candidates.check(wrong, case, x)


def seconds(**each: float) -> dict[str, measuring.Timing]:
    return {name: {"least": t, "median": t} for name, t in each.items()}


def made_up() -> dict[str, Any]:
    """2 ms for ours, 20 for JAX, 1 s for 100,000 vertices."""
    one = seconds(**{NUMPY: 2e-3, JAX: 20e-3, FLOOR: 1e-3})
    methods = (performance.LM, performance.ALONE, performance.IPOPT)
    labels = [f"{NUMPY}: {m}" for m in (*methods, performance.SCIPY_LM, performance.SCIPY_TRF)]
    by_size = seconds(**{"6890": 2e-3, "100000": 1.0})
    return {
        "derivatives": {"6890": {"seconds": dict.fromkeys(performance.KINDS, one)}},
        "fits": {"6890": {"seconds": seconds(**dict.fromkeys(labels, 0.1))}},
        "scaling": {"seconds": {k: {NUMPY: by_size, FLOOR: by_size} for k in performance.KINDS}},
        "closest": {
            "seconds": {
                "near": seconds(**{COMPILED: 0.01, NUMPY: 0.4, performance_large.IGL: 0.02})
            }
        },
    }


def test_targets_are_ratios_of_least_times() -> None:
    judged = {one.name: one for one in page.targets(made_up())}
    assert judged["workbench: JAX / Jacobian"].measured == pytest.approx(10)
    assert judged["workbench: JAX / Jacobian"].holds
    assert judged["workbench: IPOPT / LM"].measured == pytest.approx(1)
    assert not judged["workbench: forward per vertex, 100,000 / 6,890"].holds
    assert judged["closest places, near: compiled / libigl"].holds
    assert not judged["closest places, near: NumPy / compiled"].holds
    assert "| at most 30 | 40.00 | **missed** |" in page.table_of_targets(made_up())


def test_figure_is_drawn_from_the_numbers(tmp_path: Path) -> None:
    page.draw({}, tmp_path / "none.svg")
    assert not (tmp_path / "none.svg").exists()
    page.draw(made_up(), tmp_path / "figure.svg")
    assert "Gauss-Newton step" in (tmp_path / "figure.svg").read_text()
