"""Solvers and experiments by name, by value and from files; keys of what is stored."""

from dataclasses import replace
from pathlib import Path

import pytest

import workbench as wb
from tests.comparison.problems import LINE, SLIDE
from workbench.comparison import Budget
from workbench.comparison.design import chosen, design, named_solvers
from workbench.errors import BadFile, UnknownName
from workbench.identity import NOT_IN_RESULTS, digest, identity
from workbench.solvers import full_step

SOLVER = """
from dataclasses import dataclass
import workbench as wb
@dataclass(frozen=True)
class Mine:
    max_evaluations: int = 7
    def solve(self, problem, start, *, callback=None):
        return wb.GaussNewton().solve(problem, start, callback=callback)
"""


def test_solvers_go_by_given_names() -> None:
    assert [e.name for e in named_solvers("gauss-newton")] == ["gauss-newton"]
    assert named_solvers(wb.GaussNewton())[0].name == "gauss-newton"
    assert named_solvers(wb.GaussNewton(max_iterations=3))[0].name == "GaussNewton"
    assert [e.name for e in named_solvers({"a": wb.GaussNewton(), "b": wb.Ipopt()})] == ["a", "b"]
    assert all(e.is_own_code for e in named_solvers(list(wb.SOLVERS)))


def test_files_define_solvers(tmp_path: Path) -> None:
    one = tmp_path / "mine.py"
    one.write_text(SOLVER + "solver = Mine()\n")
    (named,) = named_solvers(str(one))
    assert (named.name, named.source) == ("mine", str(one.resolve()))
    assert not named.is_own_code
    assert type(named.sent()()).__name__ == "Mine"
    two = tmp_path / "ours.py"
    two.write_text(SOLVER + "slow, fast, _hidden = Mine(), Mine(3), Mine(4)\n")
    assert [e.name for e in named_solvers(str(two))] == ["ours:slow", "ours:fast"]
    assert Budget(max_evaluations=9).applied_to(named.solver) == replace(
        named.solver,
        max_evaluations=9,  # type: ignore[type-var]
    )


WRONG: list[tuple[str, str]] = [
    ("solver = Mine", "mine.py: `solver` is no solver: it needs solve.*not a class"),
    ("solver = 3", "mine.py: `solver` is no solver"),
    ("", "mine.py defines no solver"),
    ("solver = Mine(", "mine.py line 9: SyntaxError"),
    ("solver = wb.nothing", "mine.py line 9: AttributeError"),
]


def test_wrong_files_of_solvers_are_refused(tmp_path: Path) -> None:
    for more, said in WRONG:
        (tmp_path / "mine.py").write_text(SOLVER + more)
        with pytest.raises(BadFile, match=said):
            named_solvers(str(tmp_path / "mine.py"))
        with pytest.raises(BadFile, match=r"there is no file .*other.py"):
            named_solvers(str(tmp_path / "other.py"))


def test_seeds_number_starts_or_seeds() -> None:
    who = "gauss-newton"
    plan = design(("nist-misra1a", SLIDE, LINE), who, 2, Budget())
    assert [(i.name, i.number) for i in plan.instances] == [
        ("nist-misra1a, start 1", 1),
        ("nist-misra1a, start 2", 2),
        ("slide, start 0", 0),
        ("slide, start 1", 1),
        ("line, seed 0", 0),
        ("line, seed 1", 1),
    ]
    given = replace(LINE, arguments={"seed": 5})  # fixed: nothing left to number
    assert [i.name for i in design(given, who, 4, Budget()).instances] == ["line"]
    whole = design("nist", who, 1, Budget())
    assert len(whole.instances) > 5


def test_arguments_go_to_experiments_that_have_them() -> None:
    members = chosen(["registration", "nist-misra1a"], {"body": "small", "start": "2"})
    assert members[0].arguments == {"body": "small"}
    assert members[1].arguments == {"problem": "Misra1a", "start": 2}
    with pytest.raises(UnknownName, match="'bodi'"):
        chosen(["known-correspondences"], {"bodi": "small"})


def test_code_that_no_result_depends_on_is_there() -> None:
    """An edit of it makes no stored run count as new; under another name it would."""
    root = Path(wb.__file__).parent
    assert [name for name in NOT_IN_RESULTS if not (root / name).exists()] == []
    assert {"reports", "comparison/advice.py"} <= set(NOT_IN_RESULTS)


def test_keys_change_with_what_a_run_depends_on(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(SOLVER + "solver = Mine()\n")

    def key(experiment: object = LINE, solver: object = "gauss-newton", **budget: int) -> str:
        made = design(experiment, solver, 1, Budget(**budget))  # type: ignore[arg-type]
        return made.run_key(made.instances[0], made.named_solvers[0])

    keys = [
        key(),
        key(SLIDE),
        key(replace(LINE, arguments={"seed": 1})),
        key(solver="ipopt"),
        key(solver=wb.GaussNewton(line_search=full_step)),
        key(max_evaluations=9),
        key(solver=str(file)),
    ]
    assert key() == keys[0]
    assert key(solver=wb.GaussNewton()) == keys[0]
    file.write_text(SOLVER.replace("7", "8") + "solver = Mine()\n")
    keys.append(key(solver=str(file)))
    assert len(set(keys)) == len(keys)


def test_identities_hold_no_address() -> None:
    assert "0x" not in str([identity(e.solver) for e in named_solvers(list(wb.SOLVERS))])
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest(wb.GaussNewton()) != digest(wb.GaussNewton(max_iterations=7))
