"""A lecture with its results as a notebook."""

import ast
import inspect
import os
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.cells import FOLDED, apart, only_imports
from workbench.course.outline import Lecture
from workbench.course.process import environment
from workbench.environment import DISTRIBUTION, pip_install
from workbench.errors import BadArgument, BadFile
from workbench.writing import write_file

SECONDS = 120.0  # s, for a cell
NEEDED = ("jupytext", "nbformat", "nbclient", "ipykernel")


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


def notebook(lecture: Lecture) -> Any:
    """The lecture and its exercises as a notebook whose cells have not been run."""
    jupytext, v4 = tool("jupytext"), tool("nbformat").v4
    script = (lecture.folder / "lecture.py").read_text(encoding="utf-8")
    made = jupytext.reads(script, fmt="py:percent")
    made.cells = [part for cell in made.cells for part in _parts(cell)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made.metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    introduction, *texts = exercises(lecture)
    made.cells.append(v4.new_markdown_cell(introduction))
    made.cells.append(v4.new_code_cell(_given(lecture)))
    for name, text in zip(lecture.exercises, texts, strict=True):
        made.cells.append(v4.new_markdown_cell(text))
        stub = inspect.getsource(getattr(lecture.module("exercises"), name)).rstrip()
        for tag, code in (("answer", stub), ("check", f"check_here({lecture.number}, {name})")):
            made.cells.append(v4.new_code_cell(code, metadata={"tags": [tag]}))
    for k, cell in enumerate(made.cells):
        cell["id"] = f"cell-{k}"  # otherwise random, so that no two builds are alike
    return made


def _parts(cell: Any) -> list[Any]:
    """A cell of code that ends in a figure as two: what it computes, and, folded, what it draws."""
    if cell.cell_type != "code":
        return [cell]
    computing, drawing = apart(cell.source)
    if only_imports(cell.source):
        cell.metadata.update(FOLDED)
    if not drawing:
        return [cell]
    new = tool("nbformat").v4.new_code_cell
    return [new(computing)] * bool(computing) + [new(drawing, metadata=FOLDED)]


def exercises(lecture: Lecture) -> list[str]:
    """The section of exercises, in Markdown: an introduction, then one text for each exercise."""
    here = f"{lecture.folder_name}.py"
    texts = [
        "## Exercises\n\n"
        "Write each answer into its cell, in place of the line that raises `Unsolved`; the cell "
        "below checks it, and says what is likely to be wrong. To hand in a file, "
        f"`workbench lecture start {lecture.number} .` puts `{here}` here, and "
        f"`workbench lecture check {lecture.number} {here}` grades it."
    ]
    given = lecture.module("exercises")
    for k, name in enumerate(lecture.exercises, 1):
        function = getattr(given, name)
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        arguments = ", ".join(inspect.signature(function).parameters)
        known = lecture.minutes_for(name)
        minutes = f", about {known} minutes" if known else ""
        texts.append(
            f"### {lecture.number}.{k} `{name}({arguments})`\n\n{points} "
            f"point{'s' * (points != 1)}{minutes}"
        )
    return texts


def _given(lecture: Lecture) -> str:
    """What stands above the exercises in their file: imports, and constants."""
    text = inspect.getsource(lecture.module("exercises"))
    body = ast.parse(text).body
    first = next(i for i, node in enumerate(body) if isinstance(node, ast.FunctionDef))
    lines = text.splitlines()
    kept = lines[(body[0].end_lineno or 0) : body[first - 1].end_lineno]
    return "\n".join(["from workbench.course.grading import check_here", *kept[1:]])


def executed(made: Any, lecture: Lecture, folder: Path) -> Any:
    """A notebook with the results of all cells. Raises CellFailed with the first error."""
    nbclient = tool("nbclient")
    tool("ipykernel")
    client = nbclient.NotebookClient(
        made,
        timeout=SECONDS,
        kernel_name="python3",
        extra_arguments=["--IPKernelApp.log_level=ERROR"],  # or it warns about the network
        resources={"metadata": {"path": str(folder)}},
    )
    try:
        done = client.execute(env={**os.environ, **environment()})
    except nbclient.exceptions.CellExecutionError as error:
        reason = f"{error.ename}: {error.evalue}"
        raise CellFailed(f"lecture {lecture.number} stops as a notebook: {reason}") from error
    for cell in done.cells:
        cell.metadata.pop("execution", None)  # the time, with which no two builds are alike
    return done


def write_notebook(made: Any, path: Path) -> None:
    """Write a notebook to a file `.ipynb`, whole or not at all."""
    write_file(path, tool("nbformat").writes(made))


def add_links(made: Any, repository: str, at: str, name: str) -> Any:
    """Put links and an installation at the top of a notebook that has been run.

    `repository` is `OWNER/NAME` on GitHub, and `at` the branch with the folder, if there is one, in
    which the notebook `name` will be: `main/notebooks`. Raises BadArgument.
    """
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repository):
        raise BadArgument(f"--repository takes OWNER/NAME, as on GitHub, not {repository!r}")
    branch, _, folder = at.strip("/").partition("/")
    if not branch:
        raise BadArgument("--at takes a branch, and the folder in it: main/notebooks")
    path = "/".join(filter(None, (folder, f"{name}.ipynb")))
    colab = f"https://colab.research.google.com/github/{repository}/blob/{branch}/{path}"
    binder = f"https://mybinder.org/v2/gh/{repository}/{branch}?labpath={path.replace('/', '%2F')}"
    v4 = tool("nbformat").v4
    links = v4.new_markdown_cell(f"[Open in Colab]({colab}) | [Open in Binder]({binder})")
    install = v4.new_code_cell(
        f'%pip install --quiet "{DISTRIBUTION}"', metadata={"tags": ["install"]}
    )
    links["id"], install["id"] = "links", "install"
    made.cells[1:1] = [links, install]
    return made


def requirements() -> str:
    """The text of the file `requirements.txt` from which Binder installs."""
    return f"{DISTRIBUTION}\njupyterlab\n"
