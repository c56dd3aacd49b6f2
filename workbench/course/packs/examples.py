"""What students try: their answers against the examples beside their file, and nothing hidden."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from workbench.course.checks import Missed, Raised, outcome
from workbench.course.packs.handed_in import ENDINGS, read_sheet
from workbench.course.packs.handing_out import EXAMPLES
from workbench.course.packs.keys import ExerciseKey, value
from workbench.course.packs.marking import ExerciseMark, Limits, compare, mark_sheet, marks_of
from workbench.errors import BadFile


def read_examples(folder: Path) -> dict[str, Any]:
    """The examples in a student's folder. Raises BadFile."""
    path = folder / EXAMPLES
    if not path.is_file():
        raise BadFile(
            f"there is no {path}; it came with the exercises, and has to stand beside them"
        )
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["exercises"]
    except (ValueError, KeyError, TypeError) as error:
        raise BadFile(f"{path} is damaged: {error}; take it from what you were given") from error
    return found


def try_file(path: Path, limits: Limits) -> list[ExerciseMark]:
    """Try a file or a notebook on its examples, in the process in which it will be marked.

    Of a notebook the cells that try answers are left out, as when it is marked. Each exercise
    counts one point for all its examples. Raises BadFile.
    """
    if not path.is_file():
        raise BadFile(f"there is no file {path}; give the file with your answers")
    if path.suffix.lower() not in ENDINGS:
        raise BadFile(f"{path} is neither a file of Python (.py) nor a notebook (.ipynb)")
    keys, found = [], read_examples(path.parent)
    exercises: dict[str, list[str]] = {}
    for name in found:
        exercises.setdefault(name.partition(".")[0], []).append(name.partition(".")[2])
    read = read_sheet(path, exercises)
    for name, one in found.items():
        sheet, _, exercise = name.partition(".")
        if sheet == read.name:
            keys.append(
                ExerciseKey(
                    one["number"], sheet, exercise, one["parameters"], 1, 1, one["within"],
                    one["numbers"], one["examples"], [], [], [],
                )
            )  # fmt: skip
    if not keys:
        raise BadFile(f"{path.parent / EXAMPLES} says nothing about {path.name}; keep its name")
    if path.suffix.lower() == ".py" and not read.trouble:
        return marks_of(path, keys, limits)  # where it stands, beside its helpers
    helpers = [one for one in path.parent.glob("*.py") if not read_sheet(one, exercises).name]
    return mark_sheet(replace(read, helpers=tuple(helpers)), keys, limits)


def try_here(sheet: str, answer: Callable[..., Any], folder: str | Path = ".") -> None:
    """Try a function on its examples, in a notebook, and print what came of it."""
    name = getattr(answer, "__name__", "")
    found = read_examples(Path(folder)).get(f"{sheet}.{name}")
    if found is None:
        raise BadFile(f"there are no examples of {name} in {sheet}; keep the name of the function")
    for k, (arguments, expected) in enumerate(found["examples"], 1):
        came = outcome(answer, tuple(value(arguments)))
        try:
            compare(came, value(expected), name, found["within"])
        except Missed as missed:
            print(f"example {k}: not yet. Expected {missed.expected}, came {missed.came}")
        else:
            print(f"example {k}: right")
    if isinstance(came, Raised):
        print(f"the last error: {came.kind}: {came.message}")
