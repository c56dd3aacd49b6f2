"""The cells of a lecture's script: running them, filling prose, and which cells draw.

Prose takes its numbers from the run: `{{ expression:format }}` in a Markdown cell is replaced by
the value of the expression at that place, with the format of an f-string. A field whose value is
true is shown as nothing, and one whose value is false stops the lecture, so that a sentence can be
held to what was computed: `SMPL is closer{{ off["SMPL"] < off["cubic"] }}.`

A cell `# %% slide [markdown]` is a slide. Its fields are filled too, but only slides show it.
"""

import ast
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

from workbench.errors import BadFile


@dataclass(frozen=True)
class Cell:
    """A cell of a script."""

    prose: bool  # whether it is prose, and not code
    text: str  # its text; of prose without the comment signs
    line: int  # the line of the script at which it begins
    slide: str = ""  # "moving" if its figure may move, "still" if not; empty if it is no slide


def cells(path: Path, slides: bool = False) -> list[Cell]:
    """The cells of a percent script, its slides only if wanted. Raises BadFile if it has none."""
    script_cells: list[Cell] = []
    lines = path.read_text(encoding="utf-8").splitlines()
    marks = [i for i, line in enumerate(lines) if re.match(r"# %%", line)]
    for begin, end in zip(marks, [*marks[1:], len(lines)], strict=True):
        prose = "[markdown]" in lines[begin]
        body = lines[begin + 1 : end]
        if prose:
            body = [re.sub(r"^# ?", "", line) for line in body]
        text = "\n".join(body).strip("\n")
        heading = re.match(r"# %% slide( still)? \[markdown\]", lines[begin])
        slide = "" if not heading else "still" if heading[1] else "moving"
        if text and (slides or not slide):
            script_cells.append(Cell(prose, text, begin + 2, slide))
    if not script_cells:
        raise BadFile(f"{path} has no cells; begin them with `# %%` or `# %% [markdown]`")
    return script_cells


def run_cells(
    path: Path,
    before: Callable[[Cell], None] = lambda cell: None,
    names: dict[str, Any] | None = None,
    slides: bool = False,
) -> Iterator[tuple[Cell, Any, str]]:
    """Run the cells one by one; yields each with the value of its last line and what it printed.

    Prose comes with its fields filled, slides only if wanted. What is printed is shown as well.
    `before` is called with each cell before it is run. What the cells define is put into `names`.
    Raises BadFile if a field has no value, or a false one.
    """
    names = {} if names is None else names
    output = _Output()
    names |= {"__name__": "lecture", "__file__": str(path)}
    for cell in cells(path, slides=True):
        before(cell)
        if cell.prose:
            fields = {**names, "printed": output.numbers}
            text = fill_fields(cell.text, fields, path, cell.line)
            if slides or not cell.slide:
                yield replace(cell, text=text), None, ""
        else:
            output.shown, printed = sys.stdout, len(output.getvalue())
            with redirect_stdout(output):
                value = run_cell(cell, names, path)
            yield cell, value, output.getvalue()[printed:]


def fill_fields(text: str, names: dict[str, Any], path: Path, line: int = 1) -> str:
    """Prose with the values of its fields. Raises BadFile, which names the field and its line."""

    newline = "\n"

    def value(field: re.Match[str]) -> str:
        place = f"{path}, line {line + text[: field.start()].count(newline)}"
        try:
            expression = re.sub(r"\s*\n\s*", " ", field[1].strip())
            shown = str(eval(f"f'''{{ {expression}}}'''", names))
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise BadFile(f"{place}: {field[0]} has no value: {reason}") from error
        if shown == "False":
            raise BadFile(f"{place}: what the prose says is not so in this run: {field[0]}")
        return "" if shown == "True" else shown

    return re.sub(r"\{\{(.+?)\}\}", value, text, flags=re.S)


class _Output(StringIO):
    """What a lecture has printed, which is kept, and passed on to where it is shown."""

    shown: Any = None

    def write(self, text: str) -> int:
        self.shown.write(text)
        return super().write(text)

    def flush(self) -> None:
        self.shown.flush()

    def numbers(self, *words: str) -> list[float]:
        """The numbers in the last printed line that holds all of these words."""
        lines = [line for line in self.getvalue().splitlines() if all(w in line for w in words)]
        if not lines:
            raise LookupError(f"no printed line holds {words}")
        return [float(number.replace(",", "")) for number in NUMBER.findall(lines[-1])]


NUMBER = re.compile(r"(?<![\w.^-])[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w^])")


def run_cell(cell: Cell, names: dict[str, Any], path: Path) -> Any:
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


def split_at_drawing(code: str) -> tuple[str, str]:
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
    return all(isinstance(node, ast.Import | ast.ImportFrom) for node in ast.parse(code).body)
