"""Lectures as notebooks: the same script, its exercises at the end, carried out in a kernel."""

import inspect
import os
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.outline import Lecture
from workbench.course.student_process import environment
from workbench.errors import BadFile
from workbench.installation import pip_install
from workbench.writing import replacing

SECONDS = 120.0  # that a cell may take
NEEDED = ("jupytext", "nbformat", "nbclient", "ipykernel")


class CellFailed(BadFile):
    """A lecture that does not run as a notebook."""


def tool(name: str) -> ModuleType:
    """A library of the extra `course`. Raises BadFile where it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise BadFile(
            f"notebooks and the site are made by libraries of which {name} is not installed: "
            + pip_install("course")
        ) from error


def notebook(lecture: Lecture) -> Any:
    """The lecture and its exercises; no cell has been run yet."""
    jupytext, v4 = tool("jupytext"), tool("nbformat").v4
    script = (lecture.folder / "lecture.py").read_text(encoding="utf-8")
    made = jupytext.reads(script, fmt="py:percent")
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made.metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    made.cells += [v4.new_markdown_cell(text) for text in exercises(lecture)]
    for k, cell in enumerate(made.cells):
        cell["id"] = f"cell-{k}"  # else they are random, and no two builds alike
    return made


def exercises(lecture: Lecture) -> list[str]:
    """Their section, in Markdown, an exercise each after an introduction."""
    here = f"{lecture.folder_name}.py"
    texts = [
        "## Exercises\n\n"
        f"`workbench lecture start {lecture.number} .` puts the file `{here}` here, in which these "
        f"functions wait for an answer; `workbench lecture check {lecture.number} {here}` says how "
        "far you are, and what is likely to be wrong."
    ]
    given = lecture.module("exercises")
    for k, name in enumerate(lecture.exercises, 1):
        function = getattr(given, name)
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        arguments = ", ".join(inspect.signature(function).parameters)
        texts.append(
            f"### {lecture.number}.{k} `{name}({arguments})`\n\n{points} "
            f"point{'s' * (points != 1)}\n\n```text\n{inspect.getdoc(function)}\n```"
        )
    return texts


def executed(made: Any, lecture: Lecture, folder: Path) -> Any:
    """The same with the results of all cells. Raises CellFailed with the first error."""
    nbclient = tool("nbclient")
    tool("ipykernel")
    client = nbclient.NotebookClient(
        made,
        timeout=SECONDS,
        kernel_name="python3",
        extra_arguments=["--IPKernelApp.log_level=ERROR"],  # it warns of its own machine's network
        resources={"metadata": {"path": str(folder)}},
    )
    try:
        done = client.execute(env={**os.environ, **environment()})
    except nbclient.exceptions.CellExecutionError as error:
        told = f"{error.ename}: {error.evalue}"
        raise CellFailed(f"lecture {lecture.number} stops as a notebook: {told}") from error
    for cell in done.cells:
        cell.metadata.pop("execution", None)  # when it ran: no two builds would be alike
    return done


def write_notebook(made: Any, path: Path) -> None:
    """As `.ipynb`, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(tool("nbformat").writes(made), encoding="utf-8")
