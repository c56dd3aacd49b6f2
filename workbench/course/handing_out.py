"""Handing out exercises: a copy of them for a student."""

from contextlib import suppress
from pathlib import Path

from workbench.course.outline import Lecture
from workbench.errors import BadFile


def hand_out(lecture: Lecture, folder: str | Path) -> Path:
    """Write a copy of the exercises, named after the lecture, to a folder, which is made.

    Returns the file. Raises BadFile if it exists: answers are never overwritten.
    """
    folder = Path(folder)
    path = folder / f"{lecture.folder_name}.py"
    text = (lecture.folder / "exercises.py").read_text(encoding="utf-8")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise BadFile(
            f"{error.filename or path} is there already and was left as it is; "
            "give another folder, or move it away"
        ) from error
    except OSError as error:
        with suppress(OSError):
            path.unlink(missing_ok=True)  # it is new, and half of it is of no use
        raise BadFile(f"cannot write {path}: {error.strerror or error}") from error
    return path
