"""What students get of a pack: a file of Python, the same as a notebook, and examples."""

import json
import textwrap
from typing import Any

from workbench.course.packs.keys import ClassKey, ExerciseKey
from workbench.course.packs.variants import Variant

EXAMPLES = "examples.json"


def pack_name(key: ClassKey, student: str) -> str:
    """What the file of a student says about whose it is."""
    return f"{key.group} / {student}"


def _points(one: ExerciseKey) -> str:
    return f"{one.points} point{'s' * (one.points != 1)}, about {one.minutes} minutes"


def _introduction(key: ClassKey, sheet: str, student: str, mine: list[ExerciseKey]) -> str:
    minutes = sum(one.minutes for one in mine)
    return (
        f"Exercises on {key.titles[sheet]}, for {key.students[student]} ({key.group}).\n\n"
        "The functions wait for your answers. Keep their names, arguments and shapes. The numbers "
        "in capitals are yours: others have others, and answers are marked with yours. The "
        f"exercises take about {minutes} minutes in all, as was estimated; if you write into "
        "MINUTES how long you needed, later classes know better (this is voluntary).\n"
    )


def _head(key: ClassKey, student: str, mine: list[ExerciseKey]) -> str:
    waiting = ", ".join(f'"{one.exercise}": None' for one in mine)
    return (
        "import numpy as np\n\n"
        "from workbench.course import Unsolved\n\n"
        "Array = np.ndarray\n"
        f"PACK = {json.dumps(pack_name(key, student), ensure_ascii=False)}\n"
        f"MINUTES = {{{waiting}}}\n"
    )


def _numbers(one: ExerciseKey) -> str:
    return "".join(f"{name} = {number!r}\n" for name, number in one.numbers.items())


def _function(one: ExerciseKey, variant: Variant) -> str:
    head, *rest = variant.task.split("\n")
    doc = "\n".join([f'    """{head}', *(f"    {line}".rstrip() for line in rest)])
    end = '"""' if not rest else '\n    """'
    return f'{variant.signature}\n{doc}{end}\n    raise Unsolved("{one.exercise}")\n'


def script(key: ClassKey, sheet: str, student: str, variants: dict[str, Variant]) -> str:
    """The file of Python that a student gets."""
    mine = [one for one in key.keys[student] if one.sheet == sheet]
    told = "\n\n".join(
        textwrap.fill(part, 96, break_long_words=False)
        for part in _introduction(key, sheet, student, mine).split("\n\n")
    )
    parts = [
        f'"""{told.rstrip()}\n\n    workbench lecture try {sheet}.py\n\n'
        "compares your answers with the examples beside this file.\n"
        f'"""\n\n{_head(key, student, mine)}'
    ]
    for one in mine:
        parts.append(
            f"# {one.number} {one.exercise}: {_points(one)}\n\n{_numbers(one)}\n\n"
            + _function(one, variants[one.number])
        )
    return "\n\n".join(parts)


def notebook(key: ClassKey, sheet: str, student: str, variants: dict[str, Variant]) -> str:
    """The same as a notebook: a cell for each answer, and below it one that tries the examples."""
    mine = [one for one in key.keys[student] if one.sheet == sheet]
    cells = [
        _cell("markdown", f"# Exercises\n\n{_introduction(key, sheet, student, mine)}"),
        _cell("code", _head(key, student, mine)),
    ]
    for one in mine:
        cells += [
            _cell("markdown", f"## {one.number} `{one.exercise}`\n\n{_points(one)}"),
            _cell("code", f"{_numbers(one)}\n\n" + _function(one, variants[one.number]), "answer"),
            _cell(
                "code",
                "from workbench.course.packs.examples import try_here\n\n"
                f'try_here("{sheet}", {one.exercise})\n',
                "check",
            ),
        ]
    for k, cell in enumerate(cells):
        cell["id"] = f"cell-{k}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": cells,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def examples(key: ClassKey, student: str) -> str:
    """The examples of all exercises of a student, with their answers, as JSON."""
    shown = {
        f"{one.sheet}.{one.exercise}": {
            "number": one.number,
            "parameters": one.parameters,
            "within": one.within,
            "numbers": one.numbers,
            "examples": one.examples,
        }
        for one in key.keys[student]
    }
    whole = {"pack": pack_name(key, student), "exercises": shown}
    return json.dumps(whole, indent=1, ensure_ascii=False)


def _cell(kind: str, text: str, tag: str = "") -> dict[str, Any]:
    made: dict[str, Any] = {
        "cell_type": kind,
        "metadata": {"tags": [tag]} if tag else {},
        "source": text.rstrip("\n").splitlines(keepends=True),
    }
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})
