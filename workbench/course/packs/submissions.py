"""What students submitted: whose a file is, which of the pack's, and what to look at.

Submissions are a folder for each student, or files whose names begin with the student's.
"""

import ast
import json
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from workbench.course.packs.handing_out import EXAMPLES, pack_name, plain_name
from workbench.course.packs.keys import ClassKey
from workbench.errors import BadFile
from workbench.reading.facts import bounded

ENDINGS = (".py", ".ipynb")
ARCHIVES = (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar")
BY_PROGRAMS = (".ipynb_checkpoints", "__pycache__", "__MACOSX", ".DS_Store", ".git")
NOBODY = "belongs to nobody: its name begins with no student's, and it says no PACK of this class"
AS_GIVEN, MADE_BY_PROGRAMS = "it is as it was handed out", "a program made it"
DUPLICATE = "it is the same as another file of the student"
NOT_REPORTED = (AS_GIVEN, MADE_BY_PROGRAMS)  # reasons that nobody has to look at
LARGEST_FILE = 4 * 2**20  # bytes of a file that is read


@dataclass(frozen=True)
class Sheet:
    """A file of answers."""

    name: str  # its name, without its ending; empty if the file is none of the pack's
    path: Path  # the file
    source: str  # its code, of notebooks that of all cells but the checks; empty if unreadable
    trouble: str = ""  # why it is unreadable, if it is
    helpers: tuple[Path, ...] = ()  # other files of Python that were handed in beside it

    @property
    def pack(self) -> object:
        """The plain value that the file assigns to PACK, without running it, or None."""
        for node in parsed(self.source).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "PACK":
                with suppress(ValueError, TypeError, RecursionError, MemoryError, SyntaxError):
                    return ast.literal_eval(node.value)
        return None


@dataclass(frozen=True)
class Unused:
    """A file that was found and is not marked."""

    path: Path  # the file
    why: str  # the reason, as a sentence without its end
    student: str | None = None  # the name of the folder of the student whose it is, or None


@dataclass(frozen=True)
class Submissions:
    """All that was found in a folder."""

    # the files of each student, by the name of the student's folder
    sheets: dict[str, list[Sheet]] = field(default_factory=dict)
    unused: tuple[Unused, ...] = ()  # all other files, with the reason


def collect(folder: Path, key: ClassKey) -> Submissions:
    """The files of all students of a class. Raises BadFile if the folder does not exist."""
    if not folder.is_dir():
        raise BadFile(f"there is no folder {folder}; give the one that holds the submissions")
    exercises = {
        name: [exercise.exercise for exercise in key.exercises if exercise.sheet == name]
        for name in key.titles
    }
    sheets_of: dict[str, list[Sheet]] = {student: [] for student in key.students}
    unused: list[Unused] = []
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        below = path.relative_to(folder)
        if any(part in BY_PROGRAMS for part in below.parts):
            unused.append(Unused(path, MADE_BY_PROGRAMS))
            continue
        student, ending = owner(below, key), path.suffix.lower()
        if ending not in ENDINGS:
            why = "it is neither a file of Python (.py) nor a notebook (.ipynb)"
            if ending in ARCHIVES:
                why = "it is an archive; unpack it, and give the command again"
            unused.append(Unused(path, AS_GIVEN if path.name == EXAMPLES else why, student))
            continue
        sheet = read_sheet(path, exercises)
        if student is None:  # the one for whom it was made
            student = next((s for s in key.students if pack_name(key, s) == sheet.pack), None)
        if student is None:
            unused.append(Unused(path, NOBODY))
        else:
            sheets_of[student].append(sheet)
    kept: dict[str, list[Sheet]] = {}
    for student, sheets in sheets_of.items():
        kept[student], left = _pack_files(student, sheets, exercises)
        unused += left
    return Submissions(kept, tuple(unused))


def _pack_files(
    student: str, read: list[Sheet], exercises: Mapping[str, list[str]]
) -> tuple[list[Sheet], list[Unused]]:
    """A student's files of the pack, each with the others of Python beside it as helpers.

    A file that is as it was handed out is left out where there is another of its name: a student
    answers in the file or in the notebook. What is left out comes second.
    """
    others = tuple(
        sheet.path for sheet in read if not sheet.name and sheet.path.suffix.lower() == ".py"
    )
    of_pack = [sheet for sheet in read if sheet.name]
    begun = {sheet.path for sheet in of_pack if attempted(sheet.source, exercises[sheet.name])}
    kept: dict[tuple[str, str], Sheet] = {}
    for sheet in sorted(of_pack, key=lambda sheet: sheet.path not in begun):
        if sheet.path in begun or sheet.name not in {name for name, _ in kept}:
            kept.setdefault((sheet.name, sheet.source), replace(sheet, helpers=others))
    sheets = list(kept.values())
    kept_paths = {sheet.path for sheet in sheets}
    left = [
        Unused(sheet.path, DUPLICATE if sheet.path in begun else AS_GIVEN, student)
        for sheet in of_pack
        if sheet.path not in kept_paths
    ]
    names = " or ".join(f"{student}_{name}.py" for name in exercises)
    why = f"neither its name nor its PACK tells that it is a file of the pack; call it {names}"
    left += [
        Unused(sheet.path, why, student)
        for sheet in read
        if not sheet.name and not (sheets and sheet.path in others)
    ]
    return sheets, left


def read_sheet(path: Path, exercises: dict[str, list[str]]) -> Sheet:
    """A file of answers, recognised by its name, or else by PACK and the functions that it has.

    `exercises` are the names of the exercises of each file of the pack, by the file's name.
    """
    read, stem = _read(path), path.stem.lower()
    # whole: `exam` stands in `ada_exam`, and not in `example`
    named = [
        name
        for name in exercises
        if re.search(rf"(?<![^\W_]){re.escape(name.lower())}(?![^\W_])", stem)
    ]
    if not named and read.pack is not None:
        functions = functions_in(read.source).keys()
        named = [name for name in exercises if functions & set(exercises[name])]
        named = named if len(named) == 1 else []
    return replace(read, name=max(named, key=len) if named else "")


def _read(path: Path) -> Sheet:
    try:
        text = bounded(path, LARGEST_FILE).decode("utf-8-sig")
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
        parts.append("\n".join("pass" if line[:1] in ("%", "!") else line for line in lines))
    return "\n\n".join(parts) + "\n"


def owner(path: Path, key: ClassKey) -> str | None:
    """The student whose name the outermost folder, or the file, has or begins with.

    Names are compared without case, spaces and punctuation: `Ben O'Neil_20413_file_` is a folder of
    `ben-o-neil`. After the name has to come its end, or a character that is neither a letter nor a
    digit. The name as the pack wrote it counts first, then the longest. Raises BadFile if two
    students have the same name but for punctuation.
    """
    outer = path.parts[0]
    named = outer if len(path.parts) > 1 else Path(outer).stem
    for student in key.students:
        if named.lower() == student.lower():
            return student
    begins = f"{plain_name(named)}-"
    lengths = {
        student: len(plain)
        for student, name in key.students.items()
        for plain in (plain_name(student), plain_name(name))
        if plain and begins.startswith(f"{plain}-")
    }
    if not lengths:
        return None
    longest = [student for student, length in lengths.items() if length == max(lengths.values())]
    if len(longest) > 1:
        both = " and ".join(key.students[student] for student in longest)
        raise BadFile(
            f"{outer} may belong to {both}; name it as the pack named their folders: "
            f"{' or '.join(longest)}"
        )
    return longest[0]


def parsed(source: str) -> ast.Module:
    """The code of a file; empty if it is none."""
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        return ast.Module([], [])


def attempted(source: str, exercises: Iterable[str]) -> bool:
    """Whether a file holds more than these functions as they were handed out."""
    bodies = [text for name, text in functions_in(source).items() if name in exercises]
    stub = re.compile(r"raise Unsolved\([^\n]*\)")
    return not bodies or not all(stub.fullmatch(text) for text in bodies)


def functions_in(source: str) -> dict[str, str]:
    """The functions of a file, without docstrings and comments; none if it is no code."""
    return {
        node.name: ast.unparse(ast.Module(node.body[ast.get_docstring(node) is not None :], []))
        for node in parsed(source).body
        if isinstance(node, ast.FunctionDef)
    }


# What a lecturer should look at. Remarks are no verdicts, and cost no points.


def remarks_of(submissions: Submissions, key: ClassKey) -> dict[str, list[str]]:
    """Remarks on the files of each student: whose they are, and what they import."""
    remarks: dict[str, list[str]] = {student: [] for student in key.students}
    for student, sheets in submissions.sheets.items():
        for sheet in sheets:
            others = {pack_name(key, other): name for other, name in key.students.items()}
            if sheet.pack is not None and sheet.pack != pack_name(key, student):
                whom = others.get(str(sheet.pack), "somebody else")
                remarks[student].append(f"{sheet.path.name} was handed out to {whom}")
            if "workbench.lectures" in sheet.source:
                remarks[student].append(
                    f"{sheet.path.name} names workbench.lectures, where published answers are"
                )
    for file in submissions.unused:
        if file.student is not None and file.why not in NOT_REPORTED:
            remarks[file.student].append(f"{file.path.name} is not marked: {file.why}")
    return remarks
