"""The rooms of the workbench, and which may look into which."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "workbench"

FLOORS = (  # from the ground up; a room imports from lower floors and from itself
    ("errors",),
    ("writing", "reading", "installation", "homes"),
    ("compiling", "threads", "interrupts", "orphans"),
    ("blocks",),
    ("geometry",),  # half a floor up: a camera is made of blocks
    ("bodies", "residuals"),
    ("problem",),
    ("diagnostics",),
    ("solvers", "sampling"),
    ("registration", "training", "experiments"),
    ("comparison",),
    ("plots",),
    ("reports",),
    ("course",),
    ("lectures",),  # the package; `course` finds the lectures themselves by name
    ("cli",),
    ("__main__",),
)
FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
FORBIDDEN = {"utils", "util", "common", "helpers", "helper", "misc", "base"}
GO_IN_CIRCLES = {"diagnostics"}  # the room that the rule waits for
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


@pytest.mark.parametrize("room", sorted(FLOOR.keys() - GO_IN_CIRCLES))
def test_modules_of_a_room_do_not_import_each_other_in_circles(room: str) -> None:
    """Arrays and protocols below, what is made of them above; imports for types alone count."""
    circle = a_circle(modules_of(room))
    assert not circle, " imports ".join(circle)


@pytest.mark.parametrize("room", sorted(GO_IN_CIRCLES))
def test_a_room_without_circles_is_held_to_it(room: str) -> None:
    assert a_circle(modules_of(room)), f"take {room} out of GO_IN_CIRCLES"


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
    assert not drawing or room_of(path) == "plots"
    calls = [
        node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)
    ]
    assert not any(isinstance(f, ast.Attribute) and ast.unparse(f) == "plt.show" for f in calls)
