"""The files of each student: names, sheets, and the two folders of a pack."""

import csv
import json
import re
import secrets
import textwrap
import unicodedata
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from workbench.course.notebooks import as_notebook, code_cell, prose_cell
from workbench.course.packs.keys import ClassKey, ExerciseKey, make_keys, write_keys
from workbench.course.packs.variants import Variant, chosen_exercises
from workbench.diagnostics.words import counted
from workbench.errors import BadArgument, BadFile
from workbench.reading.facts import bounded


def write_pack(
    what: Sequence[str],
    group: str,
    students: dict[str, str],
    folder: Path,
    keys: Path,
    seed: int | None = None,
    tell: Callable[[str], None] = lambda said: None,
) -> ClassKey:
    """Write exercises for every student into `folder`, and the keys into `keys`.

    Both are made, and must not exist or be empty. Nothing is written if anything is wrong, and an
    interrupted run leaves neither. Without a seed, one is chosen that nobody can guess; the keys
    hold it. Raises BadArgument, BadFile, UnknownName.
    """
    if not group.strip():
        raise BadArgument("--for takes the name of the class, which has to have letters")
    exercises = chosen_exercises(what)
    for place in (folder, keys):
        if place.exists() and (not place.is_dir() or any(place.iterdir())):
            raise BadFile(f"{place} exists already, and is not written over; name a new folder")
    if keys.resolve() == folder.resolve() or folder.resolve() in keys.resolve().parents:
        raise BadArgument(f"the keys must not be inside of {folder}, which is handed out")
    key = make_keys(group, secrets.randbits(60) if seed is None else seed, students, exercises)
    variants = {exercise.number: exercise.variant for exercise in exercises}
    try:
        for place in (folder, keys):
            place.parent.mkdir(parents=True, exist_ok=True)
        with (
            TemporaryDirectory(prefix=".pack-", dir=folder.parent) as out,
            TemporaryDirectory(prefix=".keys-", dir=keys.parent) as hidden,
        ):
            for student in students:
                tell(student)
                own_folder = Path(out) / "pack" / student
                own_folder.mkdir(parents=True)
                for sheet in key.titles:
                    text = script(key, sheet, student, variants)
                    (own_folder / f"{sheet}.py").write_text(text, encoding="utf-8")
                    book = notebook(key, sheet, student, variants)
                    (own_folder / f"{sheet}.ipynb").write_text(book, encoding="utf-8")
                (own_folder / EXAMPLES).write_text(examples(key, student), encoding="utf-8")
            inner = Path(hidden) / "keys"
            inner.mkdir(mode=0o700)  # others on this machine do not read it
            write_keys(key, exercises, inner)
            for fresh, place in ((Path(out) / "pack", folder), (inner, keys)):
                if place.exists():
                    place.rmdir()
                fresh.replace(place)
    except OSError as error:
        raise BadFile(f"cannot write the pack: {error.strerror or error}") from error
    return key


COLUMNS = (  # titles of the columns that hold names, those of Moodle and others
    ("student",), ("name",), ("full name",), ("first name", "last name"),
    ("first name", "surname"), ("first name", "family name"), ("login",), ("username",), ("id",),
    ("id number",), ("email",), ("email address",),
)  # fmt: skip
LONGEST_FOLDER = 60  # characters of a folder's name


class Students(NamedTuple):
    """The students of a class."""

    names: dict[str, str]  # by the names of their folders
    columns: tuple[str, ...]  # the titles of those of the file that hold the names


def read_students(text: str, column: str | None = None) -> Students:
    """Students from a FILE.csv, or from names with commas between them.

    The first line of a file holds the titles of its columns. Names are read from `column`, or else
    from the first entry of COLUMNS that the file has. Raises BadArgument, BadFile.
    """
    is_file = text.lower().endswith(".csv")
    if column is not None and not is_file:
        raise BadArgument("--column chooses a column of --students FILE.csv, which is not given")
    names, columns = _read(Path(text), column) if is_file else (text.split(","), ())
    names = [" ".join(name.split()) for name in names]
    names = [name for name in names if name]
    if not names:
        raise BadArgument("there are no students; give --students FILE.csv, or names: ada,ben")
    students: dict[str, str] = {}
    for name in names:
        folder = folder_name(name)
        if folder in students:
            raise BadArgument(
                f"{students[folder]!r} and {name!r} would share the folder {folder}; tell them "
                "apart by another name or a number, or take another --column"
            )
        students[folder] = name
    return Students(students, columns)


def folder_name(name: str) -> str:
    """A name as that of a folder, in ASCII: small letters, digits, and `-` between words."""
    if not re.search(r"[^\W_]", name):
        raise BadArgument(f"{name!r} has no letters and no digits, so that it cannot name a folder")
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    folder = re.sub(r"[^\w]+", "-", plain).strip("-_")[:LONGEST_FOLDER]
    return folder or f"student-{sha256(name.encode()).hexdigest()[:6]}"


def plain_name(name: str) -> str:
    """A name to be compared with others: letters and digits alone, `-` between words."""
    return re.sub(r"[\W_]+", "-", unicodedata.normalize("NFKC", name).lower()).strip("-")


def _read(path: Path, column: str | None) -> tuple[list[str], tuple[str, ...]]:
    """The names in a file, and the titles of the columns that they come from."""
    try:
        text = bounded(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError, BadFile) as error:
        no_text = isinstance(error, UnicodeDecodeError)
        reason = "it is no text in UTF-8" if no_text else getattr(error, "strerror", None) or error
        raise BadFile(f"cannot read {path}: {reason}") from error
    between = max(",;\t", key=text.partition("\n")[0].count)
    rows = [row for row in csv.reader(text.splitlines(), delimiter=between) if any(row)]
    if len(rows) < 2:
        raise BadFile(f"{path} has no students: it needs a line of titles, and a line for each")
    titles = [title.strip() for title in rows[0]]
    places = _places(path, titles, column)
    names = [" ".join(row[k] for k in places if k < len(row)) for row in rows[1:]]
    return names, tuple(titles[k] for k in places)


def _places(path: Path, titles: Sequence[str], column: str | None) -> list[int]:
    """Which columns hold the names. Raises BadArgument, BadFile."""
    listed = ", ".join(repr(title) for title in titles if title)
    plain = [_title(title) for title in titles]
    if column is not None:
        if _title(column) not in plain:
            raise BadArgument(f"{path} has no column {column!r}; its columns are {listed}")
        return [plain.index(_title(column))]
    for known in COLUMNS:
        if set(known) <= set(plain):
            return [plain.index(title) for title in known]
    raise BadFile(
        f"none of the columns of {path} is known to hold names: its first line has {listed}. "
        "Choose one with --column, or call it student or name"
    )


def _title(text: str) -> str:
    """A title to be compared: `E-mail_Address` is `email address`."""
    return " ".join(text.lower().replace("e-mail", "email").replace("_", " ").split())


EXAMPLES = "examples.json"


def pack_name(key: ClassKey, student: str) -> str:
    """What the file of a student says about whose it is."""
    return f"{key.group} / {student}"


def _points(exercise: ExerciseKey) -> str:
    return f"{counted(exercise.points, 'point')}, about {exercise.minutes} minutes"


def _introduction(key: ClassKey, sheet: str, student: str, exercises: list[ExerciseKey]) -> str:
    minutes = sum(exercise.minutes for exercise in exercises)
    return (
        f"Exercises on {key.titles[sheet]}, for {key.students[student]} ({key.group}).\n\n"
        "The functions wait for your answers. Keep their names, arguments and shapes. The numbers "
        "in capitals are yours: others have others, and answers are marked with yours. The "
        f"exercises take about {minutes} minutes in all, as was estimated.\n"
    )


def _head(key: ClassKey, student: str) -> str:
    return (
        "import numpy as np\n\n"
        "from workbench.course import Unsolved\n\n"
        "Array = np.ndarray\n"
        f"PACK = {json.dumps(pack_name(key, student), ensure_ascii=False)}\n"
    )


def _numbers(exercise: ExerciseKey) -> str:
    return "".join(f"{name} = {number!r}\n" for name, number in exercise.numbers.items())


def _function(exercise: ExerciseKey, variant: Variant) -> str:
    head, *rest = variant.task.split("\n")
    doc = "\n".join([f'    """{head}', *(f"    {line}".rstrip() for line in rest)])
    end = '"""' if not rest else '\n    """'
    return f'{variant.signature}\n{doc}{end}\n    raise Unsolved("{exercise.exercise}")\n'


def script(key: ClassKey, sheet: str, student: str, variants: dict[str, Variant]) -> str:
    """The file of Python that a student gets."""
    exercises = [exercise for exercise in key.keys[student] if exercise.sheet == sheet]
    introduction = "\n\n".join(
        textwrap.fill(part, 96, break_long_words=False)
        for part in _introduction(key, sheet, student, exercises).split("\n\n")
    )
    parts = [
        f'"""{introduction.rstrip()}\n\n    workbench lecture try {sheet}.py\n\n'
        "compares your answers with the examples beside this file.\n"
        f'"""\n\n{_head(key, student)}'
    ]
    for exercise in exercises:
        heading = f"# {exercise.number} {exercise.exercise}: {_points(exercise)}"
        function = _function(exercise, variants[exercise.number])
        parts.append(f"{heading}\n\n{_numbers(exercise)}\n\n{function}")
    return "\n\n".join(parts)


def notebook(key: ClassKey, sheet: str, student: str, variants: dict[str, Variant]) -> str:
    """The same as a notebook, with a cell for each answer."""
    exercises = [exercise for exercise in key.keys[student] if exercise.sheet == sheet]
    cells = [
        prose_cell(f"# Exercises\n\n{_introduction(key, sheet, student, exercises)}"),
        code_cell(_head(key, student), {}),
    ]
    for exercise in exercises:
        stub = f"{_numbers(exercise)}\n\n" + _function(exercise, variants[exercise.number])
        cells += [
            prose_cell(f"## {exercise.number} `{exercise.exercise}`\n\n{_points(exercise)}"),
            code_cell(stub, {"tags": ["answer"]}),
        ]
    return json.dumps(as_notebook(cells), indent=1, ensure_ascii=False) + "\n"


def examples(key: ClassKey, student: str) -> str:
    """The examples of all exercises of a student, with their answers, as JSON."""
    shown = {
        f"{exercise.sheet}.{exercise.exercise}": {
            "number": exercise.number,
            "parameters": exercise.parameters,
            "within": exercise.within,
            "numbers": exercise.numbers,
            "examples": exercise.examples,
        }
        for exercise in key.keys[student]
    }
    whole = {"pack": pack_name(key, student), "exercises": shown}
    return json.dumps(whole, indent=1, ensure_ascii=False)
