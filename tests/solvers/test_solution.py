"""Solutions are written whole, read back equal, and nothing else is taken for one."""

import json
from dataclasses import asdict, replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from tests.solvers.problems import body_fit, root_of_minus_one
from workbench import Block, Problem, Solution, Status, residuals, solve
from workbench.errors import BadFile


def some_solution() -> Solution:
    return solve(*body_fit())


def assert_same(a: Solution, b: Solution) -> None:
    for field in ("cost", "optimality", "seconds", "violation"):
        np.testing.assert_equal(getattr(a, field), getattr(b, field))
    for field in ("status", "message", "solver", "evaluations", "converged", "iterations"):
        assert getattr(a, field) == getattr(b, field)
    assert a.values.keys() == b.values.keys()
    for name, value in a.values.items():
        np.testing.assert_array_equal(value, b.values[name])
        assert value.shape == b.values[name].shape
    assert len(a.trace) == len(b.trace)
    for i, j in zip(a.trace, b.trace, strict=True):
        assert i.evaluations == j.evaluations
        assert i.linear_algebra == j.linear_algebra
        for field in ("cost", "optimality", "step_norm", "damping", "seconds"):
            np.testing.assert_equal(getattr(i, field), getattr(j, field))
        assert i.values.keys() == j.values.keys()
        for name, value in i.values.items():
            np.testing.assert_array_equal(value, j.values[name])


def test_what_was_saved_is_loaded(tmp_path: Path) -> None:
    solution = some_solution()
    solution = replace(solution, violation=0.25)
    assert set(solution.linear_algebra) <= {"cholesky", "qr", "svd"}
    solution.save(tmp_path / "run.npz")
    assert_same(Solution.load(tmp_path / "run.npz"), solution)
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_names_with_slashes_and_spaces_are_kept(tmp_path: Path) -> None:
    block = Block("scan 3/pose: left", (2, 3))
    problem = Problem((residuals.gaussian(block.symbol, mean=1.0),), (block.name,))
    solution = solve(problem, {block.name: np.zeros((2, 3))})
    solution.save(tmp_path / "run.npz")
    assert_same(Solution.load(tmp_path / "run.npz"), solution)


def test_a_run_without_finite_cost_is_saved(tmp_path: Path) -> None:
    solution = solve(*root_of_minus_one())
    assert solution.status is Status.NOT_FINITE
    assert solution.trace == ()
    solution.save(tmp_path / "run.npz")
    assert_same(Solution.load(tmp_path / "run.npz"), solution)


def test_a_file_is_replaced_whole_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, solution = tmp_path / "run.npz", some_solution()
    solution.save(path)
    before = path.read_bytes()

    def broken(file, array, **options) -> None:
        file.write(b"half of it")
        raise OSError("no space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", broken)
    with pytest.raises(BadFile, match="no space left"):
        replace(solution, cost=0.0).save(path)
    assert path.read_bytes() == before
    assert [found.name for found in tmp_path.iterdir()] == ["run.npz"]


def test_a_missing_folder_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"cannot write .*run\.npz: No such file.*existing folder"):
        some_solution().save(tmp_path / "nowhere" / "run.npz")


def facts(**changes: object) -> dict[str, np.ndarray]:
    solution = some_solution()
    good = {
        "cost": 1.0,
        "optimality": 0.0,
        "status": "CONVERGED",
        "message": "",
        "solver": "s",
        "evaluations": asdict(solution.evaluations),
        "seconds": 0.0,
        "trace": [],
    }
    return {"solution": np.array(json.dumps(good | changes))}


def one_array() -> bytes:
    file = BytesIO()
    np.save(file, np.zeros(3))
    return file.getvalue()


JUNK = {
    "text": lambda path: path.write_text("no archive"),
    "empty": lambda path: path.write_bytes(b""),
    "torn archive": lambda path: path.write_bytes(b"PK\x03\x04 and no more"),
    "one array": lambda path: path.write_bytes(one_array()),
    "other arrays": lambda path: np.savez(path, x=np.zeros(3)),
    "no facts": lambda path: np.savez(path, solution=np.array("{}")),
    "no json": lambda path: np.savez(path, solution=np.array("cost: 1")),
    "facts of another kind": lambda path: np.savez(path, solution=np.array("[1, 2]")),
    "pickled": lambda path: np.savez(path, solution=np.array([{}], dtype=object)),
    "unknown status": lambda path: np.savez(path, **facts(status="GREAT")),
    "unknown count": lambda path: np.savez(path, **facts(evaluations={"guesses": 1})),
    "torn trace": lambda path: np.savez(path, **facts(trace=[[1.0, 2.0]])),
}


def test_the_facts_alone_are_a_solution(tmp_path: Path) -> None:
    """So what is refused below is refused for what is wrong in it."""
    np.savez(tmp_path / "run.npz", **facts())
    assert Solution.load(tmp_path / "run.npz").converged


@pytest.mark.parametrize("write", JUNK.values(), ids=list(JUNK))
def test_other_files_are_no_solutions(write, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    write(path)
    with pytest.raises(BadFile, match=r"run\.npz is no solution that Solution\.save wrote"):
        Solution.load(path)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"there is no file .*run\.npz"):
        Solution.load(tmp_path / "run.npz")


def test_files_from_before_there_were_constraints_are_read(tmp_path: Path) -> None:
    solution = some_solution()
    solution.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = dict(file)
    facts = json.loads(str(arrays["solution"]))
    del facts["missed"]
    del facts["evaluations"]["constraint"]
    facts["trace"] = [row[:6] for row in facts["trace"]]
    arrays["solution"] = np.array(json.dumps(facts))
    np.savez(tmp_path / "old.npz", **arrays)
    old = Solution.load(tmp_path / "old.npz")
    assert old.cost == solution.cost
    assert old.violation == 0
    assert old.trace[-1].linear_algebra == ""


def test_saddles_and_valleys_are_saved(tmp_path: Path) -> None:
    x = Block("x").symbol
    saddle = solve(Problem((residuals.gaussian(x**2, mean=1.0),), ("x",)), {"x": 0.0})
    valley = solve(Problem((residuals.gaussian(1 / x),), ("x",)), {"x": 1.0})
    for found, status in ((saddle, Status.SADDLE), (valley, Status.NO_FINITE_MINIMUM)):
        assert found.status is status
        found.save(tmp_path / "run.npz")
        again = Solution.load(tmp_path / "run.npz")
        assert_same(again, found)
        assert (again.diverging, again.judging) == (found.diverging, found.judging)
        if found.lower is None:
            assert again.lower is None
        else:
            assert again.lower is not None
            np.testing.assert_array_equal(again.lower["x"], found.lower["x"])


def test_files_from_before_ends_were_judged_are_read(tmp_path: Path) -> None:
    solution = some_solution()
    solution.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        arrays = dict(archive)
    facts = json.loads(str(arrays["solution"]))
    for name in ("insensitive", "diverging", "judging"):
        del facts[name]

    def read_with(more: dict[str, object]) -> Solution:
        changed = np.array(json.dumps(facts | more))
        np.savez(tmp_path / "old.npz", **{**arrays, "solution": changed})
        return Solution.load(tmp_path / "old.npz")

    again = read_with({})
    assert_same(again, solution)
    assert (again.insensitive, again.diverging, again.judging.total) == ((), (), 0)
    again = read_with({"status": "LOST", "lost": ["a"], "unnoticed": ["b"], "lost_since": [3]})
    assert (again.status, again.insensitive) == (Status.INSENSITIVE, ("a", "b"))
    again = read_with({"status": "VALLEY", "running": ["a"]})
    assert (again.status, again.diverging) == (Status.NO_FINITE_MINIMUM, ("a",))
