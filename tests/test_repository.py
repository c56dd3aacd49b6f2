"""The five rules of the architecture; what else ARCHITECTURE.md says is a matter of judgement."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import FunctionType

import pytest

import workbench
from workbench import residuals

ROOT = Path(workbench.__file__).parent
LAYERS = (  # from the ground up: a package imports from its own layer and from those below
    "arrays blocks compiling environment errors geometry identity interrupts processes reading "
    "threads writing",
    "bodies motions problem residuals",
    "diagnostics priors sampling solvers",
    "conversion fitting registration synthetic training",
    "comparison experiments plots reports",
    "cli course lectures __main__",
)
LAYER = {package: height for height, names in enumerate(LAYERS) for package in names.split()}
EXCEPTIONS: set[tuple[str, str]] = set()  # (module, what it imports from above); only shrinks
DRAWING = ("plots",)  # packages that draw figures
LOADING = {"np.load", "np.lib.format.read_array", "np.lib.format.open_memmap", "pickle.load"}
LOADING |= {"pickle.loads", "eval", "exec", "yaml.load"}
OWN_MESSAGES = {  # between processes of one run, and the code of a user, a lecture or an answer
    "workbench.experiments.experiment",
    "workbench.comparison.worker",
    "workbench.comparison.workers",
    "workbench.course.cells",
}


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


MODULES = {name_of(path): path for path in sorted(ROOT.rglob("*.py"))}


def imports(tree: ast.AST, package: tuple[str, ...], inside: bool = True) -> Iterator[str]:
    """Every module that may be imported by a tree at run time, by its full name.

    Of `from x import y` both x and x.y are named, as y may be a module. Imports for types alone
    are left out, and with `inside=False` those in functions, which run only when they are called.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join((*up, *([node.module] if node.module else [])))
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        elif inside or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from imports(node, package, inside)


@cache
def imports_of(module: str, inside: bool = True) -> set[str]:
    path = MODULES[module]
    return set(imports(tree_of(path), path.parent.relative_to(ROOT.parent).parts, inside))


def package_of(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if parts[0] == "workbench" and len(parts) > 1 else None


def test_imports_go_down_the_layers() -> None:
    upwards = set()
    for module in MODULES:
        here = package_of(module)
        if here is None:  # the package itself hands out names of all layers
            continue
        assert here in LAYER, f"{here} is in no layer of tests/test_repository.py"
        for other in imports_of(module) & MODULES.keys():
            there = package_of(other)
            if there is not None and LAYER[there] > LAYER[here]:
                upwards.add((module, other))
    assert upwards - EXCEPTIONS == set()
    assert EXCEPTIONS - upwards == set(), "these exceptions are no longer needed"


def test_modules_and_packages_have_no_import_cycles() -> None:
    at_import = {m: (imports_of(m, inside=False) & MODULES.keys()) - {m} for m in MODULES}
    at_import = {
        m: {o for o in others if not m.startswith(f"{o}.")} for m, others in at_import.items()
    }
    packages: dict[str, set[str]] = {}
    for module in MODULES:
        if (here := package_of(module)) is not None:
            others = {package_of(other) for other in imports_of(module)}
            packages.setdefault(here, set()).update(p for p in others if p in LAYER and p != here)
    for graph in (at_import, packages):
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            pytest.fail(" is imported by ".join(error.args[1]))


def test_only_reading_loads_what_could_run_code() -> None:
    loading = set()
    for module, path in MODULES.items():
        calls = (node for node in ast.walk(tree_of(path)) if isinstance(node, ast.Call))
        loading |= {module for call in calls if ast.unparse(call.func) in LOADING}
    assert loading == OWN_MESSAGES


def test_only_packages_that_draw_import_matplotlib() -> None:
    for module, path in MODULES.items():
        libraries = {name.split(".")[0] for name in imports_of(module)}
        assert not libraries & {"matplotlib", "mpl_toolkits"} or package_of(module) in DRAWING, (
            module
        )
        assert "plt.show(" not in path.read_text(encoding="utf-8"), module


def test_public_names_resolve_and_have_docstrings() -> None:
    for module in (workbench, residuals):
        for name in module.__all__:
            public = getattr(module, name)
            if isinstance(public, type | FunctionType):
                assert len(public.__doc__ or "") > 20, name
    with pytest.raises(AttributeError, match="no attribute 'smaple'"):
        _ = workbench.smaple  # type: ignore[attr-defined]


def test_importing_workbench_loads_neither_samplers_nor_figures() -> None:
    code = (
        "import sys, workbench as wb; wb.Problem;"
        "print({'emcee', 'matplotlib', 'scipy.stats'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
