"""The public names of the rooms, found in the source without importing any of it."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import workbench
from builder.site.docstrings import summary

FRONT_DOOR = "workbench"
ARRAYS = "workbench.arrays"  # the kinds of arrays need no page
SHORT = 60  # characters of a value that stands for a description
PACKAGE = Path(workbench.__file__).parent
Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef | ast.Assign | ast.AnnAssign


@dataclass(frozen=True, eq=False)
class Entry:
    """A public name and its definition.

    Attributes:
        name: the name itself.
        module: the full name of the module that defines it.
        definition: its statement in the source; None of a module.
        public: whether `workbench.__all__` has it.
        exported: the package that users import it from.
    """

    name: str
    module: str
    definition: Definition | None
    public: bool
    exported: str

    @property
    def room(self) -> str:
        """The room that it lives in: a folder or a module of the package."""
        return self.module.split(".")[1]

    @property
    def docstring(self) -> str:
        """The docstring, or the comment at the definition of a constant or a type alias."""
        if self.definition is None:
            return ast.get_docstring(tree(self.module)) or ""
        if isinstance(self.definition, ast.Assign | ast.AnnAssign):
            return _comment(self.module, self.definition)
        return ast.get_docstring(self.definition) or ""

    @property
    def summary(self) -> str:
        """The first sentence of the docstring; of a constant without one, its type or value."""
        node = self.definition
        if not self.docstring and isinstance(node, ast.AnnAssign):
            return f"`{ast.unparse(node.annotation)}`"
        if not self.docstring and isinstance(node, ast.Assign):
            value = ast.unparse(node.value)
            return f"`{value}`" if len(value) <= SHORT else ""
        return summary(self.docstring)


def inventory() -> list[Entry]:
    """All public names, by room and name.

    These are the names in the `__all__` of every package, all errors, and the types that the
    arguments and results of `workbench.__all__` are annotated with.
    """
    found: dict[tuple[str, str], Entry] = {}
    for package, name in _exported():
        module, definition = resolve(package, name)
        place = (module, name)
        foreign = definition is None and not module.endswith(f".{name}")
        if place in found or foreign:
            continue
        public = package == FRONT_DOOR
        found[place] = Entry(name, module, definition, public, package)
    for entry in [entry for entry in found.values() if entry.public]:
        for module, name, definition in annotated(entry):
            found.setdefault((module, name), Entry(name, module, definition, False, module))
    return sorted(found.values(), key=lambda e: (e.room, e.name.casefold(), e.name))


def annotated(entry: Entry) -> Iterator[tuple[str, str, Definition]]:
    """What of ours the arguments and results of a function or a class name, with its module."""
    node = entry.definition
    parts: list[ast.expr | None] = []
    results: list[ast.expr | None] = []
    if isinstance(node, ast.FunctionDef):
        parts = _annotations(node)
    elif isinstance(node, ast.ClassDef):
        parts = [each.annotation for each in node.body if isinstance(each, ast.AnnAssign)]
        for each in node.body:
            if isinstance(each, ast.FunctionDef) and each.name == "__init__":
                parts += _annotations(each)
            elif isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
                results += _annotations(each)
    for part in parts + results:
        for name in ast.walk(part) if part is not None else ():
            if not isinstance(name, ast.Name):
                continue
            module, found = resolve(entry.module, name.id)
            alias = isinstance(found, ast.Assign) and "TypeVar" not in ast.unparse(found.value)
            if found is None or module == ARRAYS:
                continue
            if isinstance(found, ast.ClassDef) or (alias and part in parts):
                yield module, name.id, found


def _annotations(node: ast.FunctionDef) -> list[ast.expr | None]:
    given = node.args
    every = (*given.posonlyargs, *given.args, *given.kwonlyargs)
    return [node.returns, *(argument.annotation for argument in every)]


def resolve(module: str, name: str) -> tuple[str, Definition | None]:
    """The module that defines a name, and its definition; None where it is none of ours."""
    for node in ast.walk(tree(module)):
        if not isinstance(node, ast.ImportFrom) or not _ours(node.module or ""):
            continue
        source = str(node.module)
        for alias in node.names:
            if (alias.asname or alias.name) == name:
                whole = f"{source}.{alias.name}"
                found = (source, None) if source == module else resolve(source, alias.name)
                return (whole, None) if found[1] is None and path_of(whole) else found
    last: Definition | None = None
    for node in tree(module).body:
        if name in _defined(node) and isinstance(node, Definition):
            last = node  # the last of several: the others are overloads
    return module, last


@cache
def tree(module: str) -> ast.Module:
    """The parsed source of a module."""
    path = path_of(module)
    assert path is not None, module
    return ast.parse(path.read_text(encoding="utf-8"))


def path_of(module: str) -> Path | None:
    """The file of a module of ours, or None where there is none."""
    folder = PACKAGE.joinpath(*module.split(".")[1:])
    for path in (folder / "__init__.py", folder.with_suffix(".py")):
        if path.is_file() and _ours(module):
            return path
    return None


def listed(module: str) -> list[str]:
    """The `__all__` of a module; empty where it has none."""
    for node in tree(module).body:
        if isinstance(node, ast.Assign) and "__all__" in _defined(node):
            names: list[str] = ast.literal_eval(node.value)
            return names
    return []


def _exported() -> Iterator[tuple[str, str]]:
    """Every package with each name that it exports; the front door first, then all errors."""
    packages = sorted(
        ".".join((FRONT_DOOR, *path.parent.relative_to(PACKAGE).parts))
        for path in PACKAGE.rglob("__init__.py")
    )
    for package in packages:
        for name in listed(package):
            yield package, name
    for node in tree("workbench.errors").body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield "workbench.errors", node.name


def _ours(module: str) -> bool:
    return module.split(".")[0] == FRONT_DOOR


def _defined(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        return {node.name}
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    return {each.id for each in targets if isinstance(each, ast.Name)}


def _comment(module: str, node: ast.stmt) -> str:
    """The comment above a statement, or at the end of its first line."""
    path = path_of(module)
    assert path is not None
    lines = path.read_text(encoding="utf-8").splitlines()
    above = []
    for line in reversed(lines[: node.lineno - 1]):
        if not line.startswith("#"):
            break
        above.append(line.lstrip("# "))
    text = " ".join(reversed(above)) or lines[node.lineno - 1].partition("  # ")[2]
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') or not text else '.'}"
