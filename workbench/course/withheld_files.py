"""Keeping solutions and checks of lectures from the file that is being graded.

This is for the process that answers, and lasts until that ends. Whatever opens one of these files
in Python is refused: an import under any name, importlib, runpy, open. That process has imported
none of them itself. This is no sandbox: another process that is started there can read the files.
"""

import os
import sys
from pathlib import Path
from typing import Any

from workbench.errors import WorkbenchError

WITHHELD = ("solutions", "checks", "variants")


class Withheld(WorkbenchError, PermissionError):
    """A file that is being graded asked for solutions or checks.

    It is an OSError, too, which code that only shows a line of source expects.
    """


def withhold(file: str) -> list[str]:
    """Keep the solutions and checks of all lectures from what this process runs from now on.

    `file` is the one that is graded, which may be read even if it is a lecture's own solutions.
    Returns a list to which the files are added that were refused.
    """
    graded = os.path.realpath(file)
    refused: list[str] = []

    def refuse(event: str, arguments: tuple[Any, ...]) -> None:
        if event != "open" or not isinstance(arguments[0], str | bytes):
            return
        path = Path(os.path.realpath(os.fsdecode(arguments[0])))
        if str(path) != graded and of_a_lecture(path):
            folder = path.parent.parent if path.parent.name == "__pycache__" else path.parent
            told = f"reading {folder.name}/{path.name.partition('.')[0]}.py"
            if told not in refused:
                refused.append(told)
            raise Withheld(
                f"{path.parent.name}/{path.name} cannot be read by a file that is being graded; "
                "write the answers in the file itself"
            )

    sys.addaudithook(refuse)
    return refused


def of_a_lecture(path: Path) -> bool:
    """Whether a file is a lecture's solutions or checks, as source or compiled.

    Lectures are recognised by the outline beside their folders, or in them, so that those of a
    checkout and those in folders of their own are found as well as those of the installed package.
    """
    if path.name.partition(".")[0] not in WITHHELD:
        return False
    folder = path.parent.parent if path.parent.name == "__pycache__" else path.parent
    outlines = (folder.parent / "outline.py", folder / "outline.py")
    return folder.name.startswith("lec") and any(path.is_file() for path in outlines)
