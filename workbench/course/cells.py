"""The cells of a lecture's script: running them, and which of them draw."""

import ast
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.errors import BadFile


@dataclass(frozen=True)
class Cell:
    """A cell of a script.

    Attributes:
        prose: whether it is prose, and not code.
        text: its text; of prose without the comment signs.
        line: the line of the script at which it begins.
    """

    prose: bool
    text: str
    line: int


def cells(path: Path) -> list[Cell]:
    """The cells of a percent script. Raises BadFile if it has none."""
    found: list[Cell] = []
    lines = path.read_text(encoding="utf-8").splitlines()
    marks = [i for i, line in enumerate(lines) if re.match(r"# %%", line)]
    for begin, end in zip(marks, [*marks[1:], len(lines)], strict=True):
        prose = "[markdown]" in lines[begin]
        body = lines[begin + 1 : end]
        if prose:
            body = [re.sub(r"^# ?", "", line) for line in body]
        text = "\n".join(body).strip("\n")
        if text:
            found.append(Cell(prose, text, begin + 2))
    if not found:
        raise BadFile(f"{path} has no cells; begin them with `# %%` or `# %% [markdown]`")
    return found


def carried_out(
    path: Path,
    before: Callable[[Cell], None] = lambda cell: None,
    names: dict[str, Any] | None = None,
) -> Iterator[tuple[Cell, Any]]:
    """Run the cells one by one; yields each with the value of its last line, None for prose.

    `before` is called with each cell before it is run. What the cells define is put into `names`.
    """
    names = {} if names is None else names
    names |= {"__name__": "lecture", "__file__": str(path)}
    for cell in cells(path):
        before(cell)
        yield cell, None if cell.prose else _value(cell, names, path)


def _value(cell: Cell, names: dict[str, Any], path: Path) -> Any:
    """Run a cell. Returns the value of its last line, if that is an expression, else None."""
    tree = ast.parse("\n" * (cell.line - 1) + cell.text, str(path))
    last = tree.body[-1] if tree.body else None
    if not isinstance(last, ast.Expr):
        exec(compile(tree, str(path), "exec"), names)
        return None
    exec(compile(ast.Module(tree.body[:-1], []), str(path), "exec"), names)
    return eval(compile(ast.Expression(last.value), str(path), "eval"), names)


DRAWS = "with house_style():"
FOLDED = {"tags": ["hide-input"], "jupyter": {"source_hidden": True}}  # MyST-NB; JupyterLab


def apart(code: str) -> tuple[str, str]:
    """The code of a cell up to where it begins to draw, and from there on; either may be empty.

    A lecture draws from the first statement `with house_style():` to the end of the cell.
    """
    lines = code.splitlines()
    for statement in ast.parse(code).body:
        if isinstance(statement, ast.With) and lines[statement.lineno - 1].startswith(DRAWS):
            first = statement.lineno - 1
            while first > 0 and lines[first - 1].startswith("#"):  # its comment goes with it
                first -= 1
            return "\n".join(lines[:first]).rstrip(), "\n".join(lines[first:])
    return code, ""


def only_imports(code: str) -> bool:
    """Whether a cell does nothing but import names."""
    return all(isinstance(one, ast.Import | ast.ImportFrom) for one in ast.parse(code).body)
