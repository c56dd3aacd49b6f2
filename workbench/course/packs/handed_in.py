"""What students handed in: a folder for each, or files whose names begin with the student's."""

import ast
import json
from dataclasses import dataclass, field, replace
from pathlib import Path

from workbench.course.packs.keys import ClassKey, ExerciseKey
from workbench.course.packs.likeness import attempted
from workbench.errors import BadFile

ENDINGS = (".py", ".ipynb")
LARGEST = 4 * 2**20  # bytes of a file that is read
LONGEST_MINUTES = 24 * 60.0


@dataclass(frozen=True)
class Sheet:
    """A file of answers.

    Attributes:
        name: its name, without its ending; empty if the file is none of the pack's.
        path: the file.
        source: its code, of notebooks that of all cells but the checks; empty if unreadable.
        trouble: why it is unreadable, if it is.
        helpers: other files of Python that were handed in beside it.
    """

    name: str
    path: Path
    source: str
    trouble: str = ""
    helpers: tuple[Path, ...] = ()

    @property
    def says(self) -> dict[str, object]:
        """The plain values that the file assigns to PACK and to MINUTES, without running it."""
        found: dict[str, object] = {}
        try:
            for node in ast.parse(self.source).body:
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    name = node.targets[0].id
                    if name in ("PACK", "MINUTES"):
                        found[name] = ast.literal_eval(node.value)
        except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
            pass
        return found

    def minutes(self, exercise: str) -> float | None:
        """The minutes that the student needed for an exercise, if the file says so."""
        told = self.says.get("MINUTES")
        found = told.get(exercise) if isinstance(told, dict) else None
        if isinstance(found, bool) or not isinstance(found, int | float):
            return None
        return float(found) if 0 < found <= LONGEST_MINUTES else None


@dataclass(frozen=True)
class HandedIn:
    """All that was found in a folder.

    Attributes:
        sheets: the files of each student, by the name of the student's folder.
        strange: files that belong to nobody.
    """

    sheets: dict[str, list[Sheet]] = field(default_factory=dict)
    strange: tuple[Path, ...] = ()


def collect(folder: Path, key: ClassKey) -> HandedIn:
    """The files of all students of a class. Raises BadFile if the folder does not exist."""
    if not folder.is_dir():
        raise BadFile(f"there is no folder {folder}; give the one that holds what was handed in")
    found: dict[str, list[Sheet]] = {student: [] for student in key.students}
    strange: list[Path] = []
    for path in sorted(folder.rglob("*")):
        if path.suffix not in ENDINGS or not path.is_file() or ".ipynb_checkpoints" in path.parts:
            continue
        student = _whose(path.relative_to(folder), key)
        if student is None:
            strange.append(path)
        else:
            found[student].append(_sheet(path, key))
    return HandedIn(
        {student: _known(some, key.keys[student]) for student, some in found.items()},
        tuple(strange),
    )


def _known(some: list[Sheet], keys: list[ExerciseKey]) -> list[Sheet]:
    """The pack's files, each with the others of Python beside it as helpers.

    A file that is as it was handed out is left out where there is another of its name: a student
    answers in the file or in the notebook.
    """
    others = tuple(one.path for one in some if not one.name and one.path.suffix == ".py")
    found = [replace(one, helpers=others) for one in some if one.name]
    begun = {
        one.path
        for one in found
        if attempted(one.source, [key.exercise for key in keys if key.sheet == one.name])
    }
    names = {one.name for one in found if one.path in begun}
    kept = [one for one in found if one.path in begun or one.name not in names]
    return list({(one.name, one.source): one for one in kept}.values())


def _whose(path: Path, key: ClassKey) -> str | None:
    """By the outermost folder, or by the beginning of the name; the longest name counts."""
    outer = path.parts[0].lower()
    names = {student.lower(): student for student in key.students}
    if len(path.parts) > 1 and outer in names:
        return names[outer]
    begun = [name for name in names if outer.startswith((f"{name}_", f"{name}-", f"{name}."))]
    return names[max(begun, key=len)] if begun else None


def _sheet(path: Path, key: ClassKey) -> Sheet:
    stem = path.stem.lower()
    named = [name for name in key.titles if name.lower() in stem]
    name = max(named, key=len) if named else ""
    try:
        if path.stat().st_size > LARGEST:
            return Sheet(name, path, "", f"the file has more than {LARGEST // 2**20} MB")
        text = path.read_text(encoding="utf-8-sig")
        return Sheet(name, path, _code(text) if path.suffix == ".ipynb" else text)
    except UnicodeDecodeError:
        return Sheet(name, path, "", "the file is no text in UTF-8")
    except OSError as error:
        return Sheet(name, path, "", f"the file cannot be read: {error.strerror}")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Sheet(name, path, "", "the file is no notebook")


def _code(text: str) -> str:
    """The code of a notebook: all cells but the checks, and without commands of the notebook's."""
    parts = []
    for cell in json.loads(text)["cells"]:
        if cell["cell_type"] != "code" or "check" in cell.get("metadata", {}).get("tags", []):
            continue
        source = cell["source"]
        lines = (source if isinstance(source, str) else "".join(source)).splitlines()
        if lines and lines[0].startswith("%%"):
            continue
        parts.append("\n".join("pass" if _magic(line) else line for line in lines))
    return "\n\n".join(parts) + "\n"


def _magic(line: str) -> bool:
    return line.lstrip().startswith(("%", "!")) and not line[:1].isspace()
