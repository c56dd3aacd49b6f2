"""What students handed in: a folder for each, or files whose names begin with the student's."""

import ast
import json
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from workbench.course.packs.handing_out import EXAMPLES
from workbench.course.packs.keys import ClassKey
from workbench.course.packs.likeness import attempted, shapes
from workbench.course.packs.owners import owner, pack_owner
from workbench.errors import BadFile
from workbench.reading.facts import bounded

ENDINGS = (".py", ".ipynb")
ARCHIVES = (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar")
BY_PROGRAMS = (".ipynb_checkpoints", "__pycache__", "__MACOSX", ".DS_Store", ".git")
NOBODY = "belongs to nobody: its name begins with no student's, and it says no PACK of this class"
AS_GIVEN, MADE_BY_PROGRAMS = "it is as it was handed out", "a program made it"
EXPECTED = (AS_GIVEN, MADE_BY_PROGRAMS)  # reasons that nobody has to look at
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
            nodes = ast.parse(self.source).body
        except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
            return found
        for node in nodes:
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                name = node.targets[0].id
                with suppress(ValueError, TypeError, RecursionError, MemoryError, SyntaxError):
                    if name in ("PACK", "MINUTES"):
                        found[name] = ast.literal_eval(node.value)
        return found

    def minutes(self, exercise: str) -> float | None:
        """The minutes that the student needed for an exercise, if the file says so."""
        told = self.says.get("MINUTES")
        found = told.get(exercise) if isinstance(told, dict) else None
        if isinstance(found, bool) or not isinstance(found, int | float):
            return None
        return float(found) if 0 < found <= LONGEST_MINUTES else None


@dataclass(frozen=True)
class Unused:
    """A file that was found and is not marked.

    Attributes:
        path: the file.
        why: the reason, as a sentence without its end.
        student: the name of the folder of the student whose it is, or None.
    """

    path: Path
    why: str
    student: str | None = None


@dataclass(frozen=True)
class HandedIn:
    """All that was found in a folder.

    Attributes:
        sheets: the files of each student, by the name of the student's folder.
        unused: all other files, with the reason.
    """

    sheets: dict[str, list[Sheet]] = field(default_factory=dict)
    unused: tuple[Unused, ...] = ()


def collect(folder: Path, key: ClassKey) -> HandedIn:
    """The files of all students of a class. Raises BadFile if the folder does not exist."""
    if not folder.is_dir():
        raise BadFile(f"there is no folder {folder}; give the one that holds what was handed in")
    found: dict[str, list[Sheet]] = {student: [] for student in key.students}
    unused: list[Unused] = []
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        below = path.relative_to(folder)
        if any(part in BY_PROGRAMS for part in below.parts):
            unused.append(Unused(path, MADE_BY_PROGRAMS))
            continue
        student = owner(below, key)
        if path.suffix.lower() not in ENDINGS:
            unused.append(Unused(path, _no_answers(path), student))
            continue
        sheet = read_sheet(path, _exercises(key))
        student = student or pack_owner(sheet.says.get("PACK"), key)
        if student is None:
            unused.append(Unused(path, NOBODY))
        else:
            found[student].append(sheet)
    kept: dict[str, list[Sheet]] = {}
    for student, some in found.items():
        kept[student], left = _known(student, some, key)
        unused += left
    return HandedIn(kept, tuple(unused))


def _exercises(key: ClassKey) -> dict[str, list[str]]:
    """The names of the exercises of each file of a pack, by the file's name."""
    return {
        name: [one.exercise for one in key.exercises if one.sheet == name] for name in key.titles
    }


def _no_answers(path: Path) -> str:
    if path.name == EXAMPLES:
        return AS_GIVEN
    if path.suffix.lower() in ARCHIVES:
        return "it is an archive; unpack it, and give the command again"
    return "it is neither a file of Python (.py) nor a notebook (.ipynb)"


def _known(student: str, some: list[Sheet], key: ClassKey) -> tuple[list[Sheet], list[Unused]]:
    """A student's files of the pack, each with the others of Python beside it as helpers.

    A file that is as it was handed out is left out where there is another of its name: a student
    answers in the file or in the notebook. What is left out comes second.
    """
    exercises = _exercises(key)
    others = tuple(one.path for one in some if not one.name and one.path.suffix.lower() == ".py")
    found = [replace(one, helpers=others) for one in some if one.name]
    begun = {one.path for one in found if attempted(one.source, exercises[one.name])}
    names = {one.name for one in found if one.path in begun}
    kept: dict[tuple[str, str], Sheet] = {}
    left: list[Unused] = []
    for one in found:
        first = kept.get((one.name, one.source))
        if one.path not in begun and one.name in names:
            left.append(Unused(one.path, AS_GIVEN, student))
        elif first is not None:
            as_given = AS_GIVEN if one.path not in begun else f"it is the same as {first.path}"
            left.append(Unused(one.path, as_given, student))
        else:
            kept[one.name, one.source] = one
    wanted = " or ".join(f"{student}_{name}.py" for name in key.titles)
    why = f"neither its name nor its PACK tells that it is a file of the pack; call it {wanted}"
    left += [
        Unused(one.path, why, student)
        for one in some
        if not one.name and not (kept and one.path in others)
    ]
    return list(kept.values()), left


def read_sheet(path: Path, exercises: dict[str, list[str]]) -> Sheet:
    """A file of answers, recognised by its name, or else by PACK and the functions that it has.

    `exercises` are the names of the exercises of each file of the pack, by the file's name.
    """
    read = _read(path)
    stem = path.stem.lower()
    named = [name for name in exercises if name.lower() in stem]
    if not named and "PACK" in read.says:
        there = shapes(read.source)
        named = [name for name, some in exercises.items() if any(one in there for one in some)]
        named = named if len(named) == 1 else []
    return replace(read, name=max(named, key=len) if named else "")


def _read(path: Path) -> Sheet:
    try:
        text = bounded(path, LARGEST).decode("utf-8-sig")
        return Sheet("", path, _code(text) if path.suffix.lower() == ".ipynb" else text)
    except BadFile as error:
        return Sheet("", path, "", f"the file cannot be read: {error}")
    except UnicodeDecodeError:
        return Sheet("", path, "", "the file is no text in UTF-8")
    except OSError as error:
        return Sheet("", path, "", f"the file cannot be read: {error.strerror}")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Sheet("", path, "", "the file is no notebook")


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
