"""Solutions are written whole, read back equal, and nothing else is taken for one."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.solvers.problems import body_fit, root_of_minus_one
from workbench import Block, Problem, Solution, Status, residuals, solve
from workbench.errors import BadFile


def some_solution() -> Solution:
    return solve(*body_fit())


def assert_same_values(a: dict[str, Any], b: dict[str, Any]) -> None:
    assert a.keys() == b.keys()
    for name, value in a.items():
        np.testing.assert_array_equal(value, b[name])
        assert np.shape(value) == np.shape(b[name])


def assert_same(a: Solution, b: Solution) -> None:
    fields = a.__dataclass_fields__.keys() - {"values", "trace", "lower", "hypotheses"}
    for field in fields:
        np.testing.assert_equal(getattr(a, field), getattr(b, field))
    assert_same_values(a.values, b.values)
    assert (a.lower is None) == (b.lower is None)
    assert_same_values(a.lower or {}, b.lower or {})
    for i, j in zip(a.trace, b.trace, strict=True):
        for field in i.__dataclass_fields__.keys() - {"values"}:
            np.testing.assert_equal(getattr(i, field), getattr(j, field))
        assert_same_values(i.values, j.values)


def of_a_slashed_name() -> Solution:
    block = Block("scan 3/pose: left", (2, 3))
    problem = Problem((residuals.gaussian(block.symbol, mean=1.0),), (block.name,))
    return solve(problem, {block.name: np.zeros((2, 3))})


def of_x(residual: Callable[[Any], Any], start: float) -> Solution:
    return solve(Problem((residuals.gaussian(residual(Block("x").symbol)),), ("x",)), {"x": start})


SOLUTIONS: dict[str, tuple[Callable[[], Solution], Status]] = {
    "body": (some_solution, Status.CONVERGED),
    "name with slashes and spaces": (of_a_slashed_name, Status.CONVERGED),
    "without a finite cost": (lambda: solve(*root_of_minus_one()), Status.NOT_FINITE),
    "saddle": (lambda: of_x(lambda x: x**2 - 1, 0.0), Status.SADDLE),
    "no minimum": (lambda: of_x(lambda x: 1 / x, 1.0), Status.NO_FINITE_MINIMUM),
}


@pytest.mark.parametrize(("made", "status"), SOLUTIONS.values(), ids=list(SOLUTIONS))
def test_solutions_are_loaded_as_they_were_saved(
    made: Callable[[], Solution], status: Status, tmp_path: Path
) -> None:
    solution = replace(made(), violation=0.25)
    assert solution.status is status
    solution.save(tmp_path / "run.npz")
    assert_same(Solution.load(tmp_path / "run.npz"), solution)
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_missing_folders_and_files_are_told(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"cannot write .*run\.npz: No such file.*existing folder"):
        some_solution().save(tmp_path / "nowhere" / "run.npz")
    with pytest.raises(BadFile, match=r"there is no file .*run\.npz"):
        Solution.load(tmp_path / "run.npz")


def facts(**changes: object) -> dict[str, np.ndarray]:
    good = {
        "cost": 1.0,
        "optimality": 0.0,
        "status": "CONVERGED",
        "message": "",
        "solver": "s",
        "evaluations": asdict(some_solution().evaluations),
        "seconds": 0.0,
        "trace": [],
    }
    return {"solution": np.array(json.dumps(good | changes))}


JUNK = {
    "text": lambda path: path.write_text("no archive"),
    "torn archive": lambda path: path.write_bytes(b"PK\x03\x04 and no more"),
    "other arrays": lambda path: np.savez(path, x=np.zeros(3)),
    "no facts": lambda path: np.savez(path, solution=np.array("{}")),
    "facts of another kind": lambda path: np.savez(path, solution=np.array("[1, 2]")),
    "pickled": lambda path: np.savez(path, solution=np.array([{}], dtype=object)),
    "unknown status": lambda path: np.savez(path, **facts(status="GREAT")),
    "unknown count": lambda path: np.savez(path, **facts(evaluations={"guesses": 1})),
    "torn trace": lambda path: np.savez(path, **facts(trace=[[1.0, 2.0]])),
}


@pytest.mark.parametrize("write", JUNK.values(), ids=list(JUNK))
def test_other_files_are_no_solutions(write, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, **facts())
    assert Solution.load(path).converged  # so what is refused is refused for what is wrong in it
    write(path)
    with pytest.raises(BadFile, match=r"run\.npz is no solution that Solution\.save wrote"):
        Solution.load(path)


def test_older_files_are_read(tmp_path: Path) -> None:
    """They lack constraints, the linear algebra or the judgement, and have other names."""
    solution = some_solution()
    solution.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = dict(file)
    entries = json.loads(str(arrays["solution"]))
    for name in ("missed", "insensitive", "diverging", "judging", "stages"):
        del entries[name]
    del entries["evaluations"]["constraint"]
    entries["trace"] = [row[:6] for row in entries["trace"]]

    def read_with(more: dict[str, object]) -> Solution:
        changed = np.array(json.dumps(entries | more))
        np.savez(tmp_path / "old.npz", **{**arrays, "solution": changed})
        return Solution.load(tmp_path / "old.npz")

    old = read_with({})
    assert old.cost == solution.cost
    assert (old.violation, old.judging.total, old.trace[-1].linear_algebra) == (0, 0, "")
    assert (old.insensitive, old.diverging, old.stages) == ((), (), ())
    old = read_with({"status": "LOST", "lost": ["a"], "unnoticed": ["b"], "lost_since": [3]})
    assert (old.status, old.insensitive) == (Status.INSENSITIVE, ("a", "b"))
    old = read_with({"status": "VALLEY", "running": ["a"]})
    assert (old.status, old.diverging) == (Status.NO_FINITE_MINIMUM, ("a",))
