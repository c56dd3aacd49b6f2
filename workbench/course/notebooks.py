"""A lecture with its results as a notebook."""

import ast
import inspect
import json
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.cells import FOLDED, Cell, only_imports, run_cell, run_cells, split_at_drawing
from workbench.course.outline import Lecture
from workbench.diagnostics.words import counted
from workbench.environment import pip_install
from workbench.errors import BadFile
from workbench.writing import write_file

Notebook = dict[str, Any]  # as JSON, in the format 4.5 of Jupyter
NOTEBOOK = {
    "metadata": {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    },
    "nbformat": 4,
    "nbformat_minor": 5,
}


class CellFailed(BadFile):
    """A lecture that does not run as a notebook."""


def tool(name: str) -> ModuleType:
    """A library of the extra `course`. Raises BadFile if it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise BadFile(
            f"notebooks and the site need the library {name}, which is not installed: "
            + pip_install("course")
        ) from error


def notebook(lecture: Lecture) -> Notebook:
    """Run a lecture; its cells with their results, and its exercises, as a notebook.

    Raises CellFailed if the lecture stops with an error.
    """
    names: dict[str, Any] = {}
    cells: list[dict[str, Any]] = []
    try:
        with redirect_stdout(StringIO()):
            for cell, value, printed in run_cells(lecture.folder / "lecture.py", names=names):
                if cell.prose:
                    cells.append(prose_cell(cell.text))
                else:
                    cells += _parts(cell.text, value, printed)
            cells += _exercise_cells(lecture, names)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise CellFailed(f"lecture {lecture.number} stops: {reason}") from error
    return as_notebook(cells)


def as_notebook(cells: list[dict[str, Any]]) -> Notebook:
    """Cells as a notebook."""
    return NOTEBOOK | {"cells": [cell | {"id": f"cell-{k}"} for k, cell in enumerate(cells)]}


def prose_cell(text: str) -> dict[str, Any]:
    """A cell of Markdown."""
    return {"cell_type": "markdown", "metadata": {}, "source": text}


def code_cell(
    text: str, metadata: dict[str, Any], value: Any = None, printed: str = ""
) -> dict[str, Any]:
    """A cell of code, with what it printed and the value of its last line."""
    outputs: list[dict[str, Any]] = []
    if printed:
        outputs.append({"output_type": "stream", "name": "stdout", "text": printed})
    if value is not None:
        data = {"text/plain": repr(value)}
        for kind, method in (("html", "_repr_html_"), ("markdown", "_repr_markdown_")):
            if hasattr(value, method):
                data[f"text/{kind}"] = getattr(value, method)()
        outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
    return {
        "cell_type": "code",
        "execution_count": None,
        "metadata": metadata,
        "outputs": outputs,
        "source": text,
    }


def without_results(book: Notebook) -> Notebook:
    """The same, as if no cell had been run."""
    cells = [cell | ({"outputs": []} if "outputs" in cell else {}) for cell in book["cells"]]
    return book | {"cells": cells}


def _parts(code: str, value: Any, printed: str) -> list[dict[str, Any]]:
    """A cell of code; if it ends in a figure, what it computes and, folded, what it draws."""
    computing, drawing = split_at_drawing(code)
    if not drawing:
        return [code_cell(code, FOLDED if only_imports(code) else {}, value, printed)]
    drawn = code_cell(drawing, FOLDED, value, "" if computing else printed)
    return [code_cell(computing, {}, None, printed), drawn] if computing else [drawn]


def _exercise_cells(lecture: Lecture, names: dict[str, Any]) -> list[dict[str, Any]]:
    """The section of exercises: an introduction, then three cells for each of them."""
    file, exercises = f"{lecture.folder_name}.py", lecture.module("exercises")
    introduction = (
        "## Exercises\n\n"
        "Write each answer into its cell, in place of the line that raises `Unsolved`; the cell "
        "below checks it, and says what is likely to be wrong. To hand in a file, "
        f"`workbench lecture start {lecture.number} .` puts `{file}` here, and "
        f"`workbench lecture check {lecture.number} {file}` grades it."
    )
    cells = [prose_cell(introduction), _run_code(_file_head(lecture), [], names)]
    for k, name in enumerate(lecture.exercises, 1):
        function = getattr(exercises, name)
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        minutes = f", about {known} minutes" if (known := lecture.minutes_for(name)) else ""
        arguments = ", ".join(inspect.signature(function).parameters)
        title = f"### {lecture.number}.{k} `{name}({arguments})`"
        cells += [
            prose_cell(f"{title}\n\n{counted(points, 'point')}{minutes}"),
            _run_code(inspect.getsource(function).rstrip(), ["answer"], names),
            _run_code(f"check_here({lecture.number}, {name})", ["check"], names),
        ]
    return cells


def _run_code(code: str, tags: list[str], names: dict[str, Any]) -> dict[str, Any]:
    with redirect_stdout(StringIO()) as printed:
        run_cell(Cell(False, code, 1), names, Path("exercises.py"))
    return code_cell(code, {"tags": tags} if tags else {}, None, printed.getvalue())


def _file_head(lecture: Lecture) -> str:
    """What stands above the exercises in their file: imports, and constants."""
    text = inspect.getsource(lecture.module("exercises"))
    body = ast.parse(text).body
    first = next(i for i, node in enumerate(body) if isinstance(node, ast.FunctionDef))
    lines = text.splitlines()
    kept = lines[(body[0].end_lineno or 0) : body[first - 1].end_lineno]
    return "\n".join(["from workbench.course.grading import check_here", *kept[1:]])


def write_notebook(made: Notebook, path: Path) -> None:
    """Write a notebook to a file `.ipynb`, whole or not at all."""
    write_file(path, json.dumps(made, ensure_ascii=False, indent=1) + "\n")
