"""The marks of a class: a file of answers after the other, kept on the way, and as a table."""

import csv
import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from workbench.course.packs.handed_in import HandedIn, Sheet
from workbench.course.packs.keeping import CHANGED, MARKED, kept
from workbench.course.packs.keys import ClassKey
from workbench.course.packs.marking import ExerciseMark, Limits, mark_sheet
from workbench.course.packs.remarks import alike, remarks_of
from workbench.environment import VERSION
from workbench.errors import BadFile
from workbench.writing import replacing, write_file

NOT_YET = "not marked yet: the same command goes on"
MISSING, TWICE = "not handed in", "handed in more than once: the better answer counts"


@dataclass(frozen=True)
class StudentMark:
    """All marks of a student.

    Attributes:
        student: the name of the student's folder.
        exercises: one mark for each exercise; none if nothing has been marked yet.
        minutes: what the student wrote about the time for each exercise, by number.
        remarks: on the files as a whole.
        alike: what right answers are like; known when all students are marked.
    """

    student: str
    exercises: tuple[ExerciseMark, ...]
    minutes: dict[str, float]
    remarks: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()

    @property
    def points(self) -> int:
        """The points of all exercises."""
        return sum(one.points for one in self.exercises)


def mark_class(
    found: HandedIn,
    key: ClassKey,
    keys: Path,
    table: Path,
    limits: Limits,
    tell: Callable[[str, StudentMark, bool], None] = lambda student, mark, again: None,
) -> list[StudentMark]:
    """Mark all students and write the table, after each of them.

    What is marked is kept in the folder of keys, and is not marked again unless a file, the key or
    a limit has changed; so the same command goes on where it was interrupted. `tell` is called
    after each student, with the mark, and whether it was kept from before. What answers are like is
    found when all are marked. Raises BadFile.
    """
    said = remarks_of(found, key)
    marked: dict[str, StudentMark] = {}
    for student in key.students:
        mark, again = _marked(student, found.sheets[student], key, keys, limits)
        marked[student] = StudentMark(
            student, mark, _minutes(student, found.sheets[student], key), tuple(said[student])
        )
        write_table(table, key, marked)
        tell(student, marked[student], again)
    right = {
        student: {mark.number for mark in one.exercises if mark.points}
        for student, one in marked.items()
    }
    for student, told in alike(found, key, right).items():
        marked[student] = replace(marked[student], alike=tuple(told))
    write_table(table, key, marked)
    return list(marked.values())


def _marked(
    student: str, sheets: list[Sheet], key: ClassKey, keys: Path, limits: Limits
) -> tuple[tuple[ExerciseMark, ...], bool]:
    place = keys / MARKED / f"{student}.json"
    digest = _digest(student, sheets, key, limits)
    try:
        data = json.loads(place.read_text(encoding="utf-8"))
        if data["digest"] == digest:
            read = [{**one, "remarks": tuple(one["remarks"])} for one in data["exercises"]]
            return tuple(ExerciseMark(**one) for one in read), True
    except (OSError, ValueError, KeyError, TypeError):
        pass  # nothing kept, or nothing that can be read: it is marked again
    marks: dict[str, ExerciseMark] = {}
    for sheet in sheets:
        mine = [one for one in key.keys[student] if one.sheet == sheet.name]
        with kept(keys) as held:
            each = mark_sheet(sheet, mine, limits)
        if held.changed:
            each = [replace(one, points=0, remarks=(CHANGED, *one.remarks)) for one in each]
        for one in each:
            before = marks.get(one.number)
            if before is not None:
                better = max(before, one, key=lambda mark: mark.points)
                one = replace(better, remarks=(*better.remarks, TWICE))
            marks[one.number] = one
    found = tuple(
        marks.get(one.number) or ExerciseMark(one.number, one.exercise, 0, one.points, (MISSING,))
        for one in key.keys[student]
    )
    try:
        place.parent.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        raise BadFile(f"cannot write {place.parent}: {error.strerror}") from error
    data = {"digest": digest, "exercises": [asdict(one) for one in found]}
    write_file(place, json.dumps(data, indent=1, ensure_ascii=False))
    return found, False


def _digest(student: str, sheets: list[Sheet], key: ClassKey, limits: Limits) -> str:
    """Of everything on which the marks of a student depend."""
    read = [(one.name, one.source, one.trouble) for one in sheets]
    helpers = [path.read_bytes().hex() for one in sheets for path in one.helpers]
    parts: Any = [VERSION, read, helpers, [asdict(one) for one in key.keys[student]]]
    return hashlib.sha256(json.dumps([parts, asdict(limits)]).encode()).hexdigest()


def _minutes(student: str, sheets: list[Sheet], key: ClassKey) -> dict[str, float]:
    return {
        one.number: minutes
        for one in key.keys[student]
        for sheet in sheets
        if sheet.name == one.sheet and (minutes := sheet.minutes(one.exercise)) is not None
    }


def median_minutes(marks: list[StudentMark]) -> dict[str, tuple[float, int]]:
    """By exercise: the median of the minutes that students told, and how many they were."""
    told: dict[str, list[float]] = {}
    for one in marks:
        for number, minutes in one.minutes.items():
            told.setdefault(number, []).append(minutes)
    return {number: (median(some), len(some)) for number, some in told.items()}


def write_table(path: Path, key: ClassKey, marked: dict[str, StudentMark]) -> None:
    """Write a CSV file: a line for each student, whether marked or not. Raises BadFile."""
    numbers = [one.number for one in key.exercises]
    of = sum(one.points for one in key.exercises)
    each = [*numbers, *(f"minutes {number}" for number in numbers)]
    head = ["student", "folder", "points", "of", *each, "minutes", "remarks"]
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8-sig", newline="") as file,
    ):
        lines = csv.writer(file)
        lines.writerow(head)
        for student, name in key.students.items():
            one = marked.get(student)
            if one is None:
                empty = ["" for _ in each]
                row: list[Any] = [name, student, "", of, *empty, "", NOT_YET]
            else:
                points = {mark.number: mark.points for mark in one.exercises}
                needed = [f"{one.minutes[n]:g}" if n in one.minutes else "" for n in numbers]
                minutes = f"{sum(one.minutes.values()):g}" if one.minutes else ""
                told = "; ".join(remarks(one))
                cells = [*(points[n] for n in numbers), *needed]
                row = [name, student, one.points, of, *cells, minutes, told]
            lines.writerow([plain_cell(cell) for cell in row])


def remarks(one: StudentMark) -> list[str]:
    """All remarks on a student: on the files as a whole, by exercise, and on likeness."""
    each = [f"{mark.number}: {said}" for mark in one.exercises for said in mark.remarks]
    return [*one.remarks, *each, *one.alike]


def plain_cell(cell: Any) -> Any:
    """A cell that no spreadsheet takes for a formula: remarks quote what students wrote."""
    if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@", "\t", "\r"):
        return f"'{cell}"
    return cell
