"""The rooms of the workbench, and which may look into which."""

import ast
import re
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType

import casadi as cs
import numpy as np
import pytest

import workbench
from workbench.blocks import Block
from workbench.problem import Problem
from workbench.residuals import Residual

ROOT = Path(__file__).parents[1] / "workbench"

FLOORS = (  # from the ground up; a room imports from lower floors and from itself
    ("errors", "arrays"),
    ("writing", "reading", "installation", "homes", "browser"),
    ("compiling", "threads", "interrupts", "processes"),
    ("blocks",),
    ("geometry",),  # half a floor up: a camera is made of blocks
    ("bodies", "residuals"),
    ("problem", "motions"),
    ("diagnostics",),
    ("solvers", "sampling"),
    ("priors",),
    ("fitting",),
    ("training",),
    ("synthetic", "registration", "conversion"),
    ("experiments",),
    ("comparison",),
    ("plots",),
    ("replay",),
    ("reports",),
    ("studies",),  # each draws its own figures and writes its own page
    ("course",),
    ("site", "scaffolds"),
    ("lectures",),  # the package; `course` finds the lectures themselves by name
    ("cli",),
    ("__main__",),
)
FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
FORBIDDEN = {"utils", "util", "common", "helpers", "helper", "misc", "base"}
FARTHEST = 10  # files that a reader opens from a public function to its numbers
LONGEST = 300  # lines, of a module that is read in one sitting
MODULES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")
EACH_MODULE = pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(source: str, package: tuple[str, ...]) -> set[str]:
    """Every module that a module imports, by full name, wherever the import stands.

    `package` is where the module lives, for relative imports; of `from x import y` both x and
    x.y are given, as y may be a module too.
    """
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join((*up, *([node.module] if node.module else [])))
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return found


def imports_of(path: Path) -> set[str]:
    return imported(path.read_text(), path.parent.relative_to(ROOT.parent).parts)


def rooms(modules: set[str]) -> set[str]:
    parts = [module.split(".") for module in modules]
    return {p[1] for p in parts if p[0] == "workbench" and len(p) > 1}


def test_no_kind_of_import_is_overlooked() -> None:
    package = ("workbench", "solvers")
    for source in (
        "import workbench.plots.figure",
        "import workbench.plots as p",
        "from workbench import plots",
        "from workbench.plots import figure",
        "from workbench.plots.figure import draw",
        "from ..plots import figure",
        "from .. import plots",
        "def f():\n    from workbench import plots",
        "if TYPE_CHECKING:\n    from workbench.plots import figure",
    ):
        assert rooms(imported(source, package)) == {"plots"}, source
    assert rooms(imported("from . import run", package)) == {"solvers"}
    assert rooms(imported("from .run import Run", package)) == {"solvers"}
    assert rooms(imported("import numpy.linalg, workbenches.plots", package)) == set()


def test_every_room_has_its_floor() -> None:
    there = {room_of(path) for path in MODULES}
    assert there <= FLOOR.keys(), f"{there - FLOOR.keys()} stand on no floor"


@EACH_MODULE
def test_rooms_look_only_downstairs(path: Path) -> None:
    here = room_of(path)
    seen = rooms(imports_of(path)) - {here}
    unknown = seen - FLOOR.keys()
    assert not unknown, f"{here} imports {unknown} from the front door; name the room it is in"
    upstairs = {room for room in seen if FLOOR[room] >= FLOOR[here]}
    assert not upstairs, f"{here} looks into {upstairs}"


def modules_of(room: str) -> dict[str, set[str]]:
    """Every module of a room, and which others of them it imports, for types alone included."""
    paths = {
        ".".join(path.relative_to(ROOT.parent).with_suffix("").parts): path
        for path in MODULES
        if room_of(path) == room and path.name != "__init__.py"
    }
    return {name: imports_of(path) & paths.keys() - {name} for name, path in paths.items()}


def a_circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules of which each imports the next, and the last the first; none if there are none."""
    left = {name: set(others) for name, others in imports.items()}
    while done := [name for name, others in left.items() if not others & left.keys()]:
        for name in done:
            del left[name]
    if not left:
        return []
    way = [min(left)]
    while way[-1] not in way[:-1]:
        way.append(min(left[way[-1]] & left.keys()))
    return way[way.index(way[-1]) :]


def test_a_circle_is_found() -> None:
    assert a_circle({"a": {"b"}, "b": set(), "c": {"a", "b"}}) == []
    assert a_circle({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == ["b", "c", "b"]


@pytest.mark.parametrize("room", sorted(FLOOR))
def test_modules_of_a_room_do_not_import_each_other_in_circles(room: str) -> None:
    """Arrays and protocols below, what is made of them above; imports for types alone count."""
    circle = a_circle(modules_of(room))
    assert not circle, " imports ".join(circle)


@EACH_MODULE
def test_arrays_of_files_are_read_with_every_doubt(path: Path) -> None:
    """`np.load` believes a file what it says of itself; `workbench.reading` does not."""
    tree = ast.walk(ast.parse(path.read_text()))
    calls = {ast.unparse(node.func) for node in tree if isinstance(node, ast.Call)}
    assert calls.isdisjoint({"np.load", "np.lib.format.read_array", "np.lib.format.open_memmap"})


@EACH_MODULE
def test_a_module_is_read_in_one_sitting(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= LONGEST


@EACH_MODULE
def test_a_module_is_named_after_what_it_holds(path: Path) -> None:
    assert FORBIDDEN.isdisjoint(path.relative_to(ROOT).with_suffix("").parts)


@EACH_MODULE
def test_only_plots_draw_and_nothing_is_shown(path: Path) -> None:
    drawing = {module.split(".")[0] for module in imports_of(path)} & {"matplotlib", "mpl_toolkits"}
    of_a_study = room_of(path) == "studies" and path.stem == "figures"
    assert not drawing or room_of(path) == "plots" or of_a_study
    calls = [
        node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)
    ]
    assert not any(isinstance(f, ast.Attribute) and ast.unparse(f) == "plt.show" for f in calls)


# The picture of three walks in ARCHITECTURE.md.


def walks() -> dict[str, list[tuple[int, str]]]:
    """Of each public function in the picture: its files in order, and how far right each stands."""
    text = (ROOT.parent / "ARCHITECTURE.md").read_text()
    (picture,) = re.findall(r"^```\n(solve\(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    found = {}
    for walk in picture.strip().split("\n\n"):
        first, *lines = walk.split("\n")
        files = [(len(line) - len(line.lstrip()), line.split()[0]) for line in lines]
        found[first.partition("(")[0]] = files
    return found


WALKS = walks()
EACH_WALK = pytest.mark.parametrize("walk", WALKS)


def module_of(file: str) -> str:
    parts = ("workbench", *Path(file).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sees(file: str, other: str) -> bool:
    """Whether a file imports another, or a name of it from the front door of its room."""
    seen, module = imports_of(ROOT / file), module_of(other)
    room = module.rpartition(".")[0]
    door = imports_of(ROOT / Path(other).parent / "__init__.py")
    names = [name.rpartition(".")[2] for name in seen if name.rpartition(".")[0] == room]
    return module in seen or any(f"{module}.{name}" in door for name in names)


def test_an_import_by_a_front_door_is_seen() -> None:
    assert sees("solvers/run.py", "problem/problem.py")  # from workbench.problem import Problem
    assert sees("solvers/run.py", "solvers/ending.py")
    assert not sees("solvers/run.py", "problem/batch.py")
    assert not sees("problem/chain.py", "problem/problem.py")


def test_the_picture_has_three_walks() -> None:
    assert list(WALKS) == ["solve", "diagnose", "sample"]


@EACH_WALK
def test_a_walk_is_short_and_begins_at_a_public_function(walk: str) -> None:
    files = [file for _, file in WALKS[walk]]
    assert len(set(files)) == len(files) <= FARTHEST
    assert all((ROOT / file).is_file() for file in files)
    assert getattr(workbench, walk).__module__ == module_of(files[0])


@EACH_WALK
def test_a_walk_goes_down(walk: str) -> None:
    """The nearest file above that stands further to the left imports it; none imports one above."""
    files = WALKS[walk]
    for i, (right, file) in enumerate(files[1:], start=1):
        above = next(other for left, other in reversed(files[:i]) if left < right)
        assert sees(above, file), f"{above} does not import {file}"
        back = [other for _, other in files[:i] if sees(file, other)]
        assert not back, f"{file} turns back to {back}"


def small_problem() -> tuple[Problem, dict[str, np.ndarray]]:
    """Two of three unknowns are seen, neither of them in a straight line."""
    x = Block("x", (3,))
    seen = cs.vertcat(cs.exp(x.symbol[0]) - 1.2, x.symbol[0] + x.symbol[1] ** 2 - 0.3)
    problem = Problem([Residual("data", seen, sigma=0.1)], ["x"], blocks=[x])
    return problem, {"x": np.array([0.1, 0.4, 0.0])}


def solved() -> None:
    problem, start = small_problem()
    workbench.solve(problem, start)


def diagnosed() -> None:
    diagnosis = workbench.diagnose(*small_problem())
    assert (diagnosis.rank, len(diagnosis.null_directions)) == (2, 1)


def sampled() -> None:
    problem, at = small_problem()
    posterior = workbench.sample(problem, at, ["x[0]", "x[1]"], steps=40, walkers=8, ensembles=2)
    assert posterior.verdict


RUNS: dict[str, Callable[[], None]] = {"solve": solved, "diagnose": diagnosed, "sample": sampled}


def calls(run: Callable[[], None]) -> set[tuple[str, str, CodeType]]:
    """Which files of the package call which: the caller's, that of what is called, and what."""
    found: set[tuple[str, str, CodeType]] = set()
    before = sys.getprofile()

    def noted(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_back is not None:
            caller, called = frame.f_back.f_code, frame.f_code
            found.add((caller.co_filename, called.co_filename, called))

    sys.setprofile(noted)
    try:
        run()
    finally:
        sys.setprofile(before)
    return found


def questions(file: str) -> Iterator[CodeType]:
    """The properties of a file's classes: whoever has an object may ask it for its numbers."""
    for kind in vars(import_module(module_of(file))).values():
        for value in vars(kind).values() if isinstance(kind, type) else ():
            if isinstance(value, property) and value.fget is not None:
                yield value.fget.__code__


@EACH_WALK
def test_a_walk_is_the_way_of_the_calls(walk: str) -> None:
    """Every file of a walk is at work when its function runs, and none calls one above it."""
    files = [file for _, file in WALKS[walk]]
    modules = [import_module(module_of(file)) for file in files]  # at once: an import is no call
    height = {str(module.__file__): i for i, module in enumerate(modules)}
    made = calls(RUNS[walk])
    idle = set(height).difference(called for _, called, _ in made)
    assert not idle, f"{sorted(idle)} are not at work"
    asked = {code for file in files for code in questions(file)}
    back = {
        f"{files[height[caller]]} calls {what.co_name} of {files[height[called]]}"
        for caller, called, what in made
        if caller in height and called in height and what not in asked
        if height[called] < height[caller]
    }
    assert not back
