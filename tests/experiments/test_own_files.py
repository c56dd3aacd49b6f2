"""Experiments in a Python file of one's own, and what can be wrong in it."""

import json
import pickle
import sys
from pathlib import Path

import pytest

from workbench.errors import BadFile
from workbench.experiments import find, run
from workbench.experiments.experiment import run_file

LINE = '''"""A line through three points."""
import numpy as np
import workbench as wb
from workbench.experiments import Experiment, Setup
from workbench.fitting import Measure
a = wb.Block("a", (2,)).symbol
x, y = wb.Block("x", (3,)).symbol, wb.Block("y", (3,)).symbol
problem = wb.Problem([wb.Residual("line", a[0] + a[1] * x - y, sigma=0.1)], ["a"])
start = {"a": np.zeros(2), "x": np.arange(3.0), "y": np.array([1.0, 3.0, 5.5])}
'''
NEXT = LINE.count("\n") + 1


def written(folder: Path, more: str) -> str:
    (folder / "line.py").write_text(LINE + more)
    return str(folder / "line.py")


POINTS = """body = wb.load_body('small')
p = body.joint_points(*(block.symbol for block in body.blocks()))
q = wb.Block('q', (24, 3), 'm')
"""


@pytest.mark.parametrize(
    "more",
    [
        "compared = 'gauss-newton'",
        "setup = Setup(problem, start, 'q', compared='gauss-newton')",
        "def setup(): return Setup(problem, start, 'q', compared=['gauss-newton'])",
        "experiment = Experiment('mine', lambda: Setup(problem, start, 'q',"
        " compared=('gauss-newton',)), '')",
    ],
)
def test_files_define_experiments_in_four_ways(tmp_path: Path, more: str) -> None:
    experiment = find(written(tmp_path, more))
    assert experiment.source == str((tmp_path / "line.py").resolve())
    outcome = run(experiment)
    assert outcome.solution.converged
    assert outcome.source == experiment.source
    assert set(outcome.compared) == {"gauss-newton", "trust-region"}


WRONG: list[tuple[str, str]] = [
    ("def f(:", f"line.py line {NEXT}: SyntaxError"),
    ("import sys\nsys.exit(3)", rf"line.py line {NEXT + 1}: it ends the program \(sys.exit\(3"),
    ("problem = 3", "line.py: `problem` of a setup must be a Problem, not 3"),
    ("del start['y']", "block 'y' .* was given no value"),
    ("priors = 'pose'", "line.py: no residual is called 'pose'; there are line"),
    ("compared = ('foo',)", "line.py: no solver is called 'foo'; there are .*gauss-newton"),
    ("setup = Setup(problem, start, 'q', body=3)", "`body` of a setup must be a SkinnedBody"),
    ("def setup():\n  raise ValueError('no')", f"line.py line {NEXT + 1}: ValueError: no"),
    ("def setup():\n  return 3", "must return a Setup, not 3"),
    (
        "setup = Setup(problem, start, 'q', measures=lambda v: 1 / 0)",
        f"line.py line {NEXT}: ZeroDivisionError",
    ),
    ("experiment = Experiment('../up', lambda: 3, '')", "name is that of a folder"),
    ("del problem", "it defines `start`, but no `problem`; it needs"),
    ("a.no_such_thing", f"line.py line {NEXT}: AttributeError"),
    (
        f"{POINTS}p.symbol - q.symbol.T",
        f"line {NEXT + 3}: Dimension mismatch.*3x24.*24x3.*points are columns",
    ),
    (
        f"{POINTS}p - q.symbol",
        "points of a body are no expression to compute with; take their `.symbol`",
    ),
    (f"{POINTS}p.symbol - q", "a Block is no number: take its .symbol"),
]


def test_wrong_files_are_refused_before_solving(tmp_path: Path) -> None:
    for more, said in WRONG:
        solved: list[object] = []
        with pytest.raises(BadFile, match=said):
            run(find(written(tmp_path, more)), callback=solved.append)
        assert not solved


def test_arguments_of_own_functions_are_checked(tmp_path: Path) -> None:
    path = written(tmp_path, "def setup(n: int = 1):\n  return Setup(problem, start, str(1 / n))")
    assert find(path, {"n": "2"}).setup().question == "0.5"
    with pytest.raises(BadFile, match=f"line.py line {NEXT + 1}: ZeroDivisionError"):
        find(path, {"n": "0"}).setup()


HELD = """
hold = wb.Residual("hold", a, sigma=10)
problem = wb.Problem([*problem.residuals, hold], ["a"])
"""


@pytest.mark.parametrize("given", ["('hold',)", "[hold]"])
def test_priors_beside_a_problem_are_read(tmp_path: Path, given: str) -> None:
    """By their names, or as the residuals themselves."""
    experiment = find(written(tmp_path, f"{HELD}priors = {given}"))
    setup = experiment.setup()
    assert setup.priors == ("hold",)
    outcome = run(experiment)
    assert outcome.data_alone is not None
    assert outcome.data_alone.shape == (3, 2)
    assert outcome.diagnosis.shape == (5, 2)
    assert 0 < outcome.prior_share < 1


def test_files_of_one_name_keep_their_own_classes(tmp_path: Path) -> None:
    """Also of the name of a library's module: pickle and dataclasses look classes up by it."""
    for name in ("mine.py", "mine.py", "json.py"):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        (folder / name).write_text("class Mine:\n    pass\n")
        module, _ = run_file(folder / name, "nothing")
        assert type(pickle.loads(pickle.dumps(module.Mine()))) is module.Mine
    assert json.loads("3") == 3
    assert sys.modules["json"] is json
