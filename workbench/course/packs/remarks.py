"""What a lecturer should look at: whose file it is, whose numbers, and answers that are alike."""

from collections.abc import Iterable
from contextlib import suppress

from workbench.course.checks import in_words
from workbench.course.packs.handed_in import EXPECTED, LONGEST_MINUTES, HandedIn, Sheet
from workbench.course.packs.handing_out import pack_name
from workbench.course.packs.keys import ClassKey, ExerciseKey
from workbench.course.packs.likeness import (
    compared,
    constants,
    distinctive,
    shapes,
    words_of,
)

MOST = 4  # names that are listed
SEVERAL = 3  # answers of one student that are like those of one other: hardly by chance
UNWATCHED = {"ctypes", "ctypeslib", "_ctypes", "cffi", "_cffi_backend", "h5py", "to_file"}


def remarks_of(found: HandedIn, key: ClassKey) -> dict[str, list[str]]:
    """Remarks on the files of each student. They are no verdicts, and cost no points."""
    said: dict[str, list[str]] = {student: [] for student in key.students}
    for student, sheets in found.sheets.items():
        for sheet in sheets:
            said[student] += [*_whose(sheet, student, key), *_numbers(sheet, student, key)]
            said[student] += [*_unwatched(sheet), *_minutes(sheet, key.keys[student])]
    for one in found.unused:
        if one.student is not None and one.why not in EXPECTED:
            said[one.student].append(f"{one.path.name} is not marked: {one.why}")
    return said


def _whose(sheet: Sheet, student: str, key: ClassKey) -> Iterable[str]:
    says = sheet.says.get("PACK")
    others = {pack_name(key, other): name for other, name in key.students.items()}
    if says is not None and says != pack_name(key, student):
        yield f"{sheet.path.name} was handed out to {others.get(str(says), 'somebody else')}"


def _numbers(sheet: Sheet, student: str, key: ClassKey) -> Iterable[str]:
    """Numbers of another student's which stand in this file, and in none of this student's."""
    written = constants(sheet.source)
    mine = _drawn(key.keys[student], sheet.name)
    for other, name in key.students.items():
        if other != student and (seen := (_drawn(key.keys[other], sheet.name) - mine) & written):
            listed = ", ".join(f"{number:g}" for number in sorted(seen)[:3])
            yield f"{sheet.path.name} has numbers of {name}: {listed}"


def _minutes(sheet: Sheet, mine: list[ExerciseKey]) -> Iterable[str]:
    """What stands in MINUTES and is no number of minutes."""
    told = sheet.says.get("MINUTES", {})
    if not isinstance(told, dict):
        yield f"{sheet.path.name}: MINUTES holds no minutes by exercise, and is left out"
        return
    for one in mine:
        said = told.get(one.exercise) if one.sheet == sheet.name else None
        if said is not None and sheet.minutes(one.exercise) is None:
            yield (
                f"{one.number}: the minutes are {in_words(said)}, which is no number above 0 and "
                f"up to {LONGEST_MINUTES:g}; they are left out"
            )


def _unwatched(sheet: Sheet) -> Iterable[str]:
    """Names of code that reaches files without Python, on which nothing else would be said."""
    texts = [sheet.source]
    for helper in sheet.helpers:
        with suppress(OSError):
            texts.append(helper.read_text(encoding="utf-8", errors="replace"))
    if seen := sorted(set().union(*map(words_of, texts)) & UNWATCHED):
        yield (
            f"{sheet.path.name} names {', '.join(seen)}, by which code can reach files without "
            "Python, which then refuses nothing: look at what it does"
        )


def _drawn(keys: list[ExerciseKey], sheet: str) -> set[float]:
    found: set[float] = set()
    for one in keys:
        if one.sheet == sheet:
            for number in one.numbers.values():
                parts = number if isinstance(number, list) else [number]
                found |= {float(x) for x in parts if isinstance(x, int | float)}
    return {number for number in found if distinctive(number)}


def alike(found: HandedIn, key: ClassKey, right: dict[str, set[str]]) -> dict[str, list[str]]:
    """What right answers are like: a published one, or that of another student.

    `right` has the numbers of the exercises that each student answered rightly. Other answers are
    not compared.
    """
    said: dict[str, list[str]] = {student: [] for student in key.students}
    same: dict[tuple[str, str], set[str]] = {}  # the exercises, by the student and whose they are
    read = {
        student: {sheet.name: shapes(sheet.source) for sheet in sheets}
        for student, sheets in found.sheets.items()
    }
    for one in key.exercises:
        answers = {
            student: shape
            for student, sheets in read.items()
            if one.number in right.get(student, ())
            and (shape := sheets.get(one.sheet, {}).get(one.exercise)) is not None
        }
        published = {
            what: shape
            for what, source in key.sources[one.number].items()
            for shape in list(shapes(source).values())[:1]
        }
        for student, shape in answers.items():
            for what, theirs in published.items():
                if how := compared(shape, theirs):
                    said[student].append(f"{one.number}: this answer and {what} are {how}")
                    same.setdefault((student, "published ones"), set()).add(one.number)
            like: dict[str, list[str]] = {}
            for other, theirs in answers.items():
                if other != student and (how := compared(shape, theirs)):
                    like.setdefault(how, []).append(key.students[other])
                    whose = f"those of {key.students[other]}"
                    same.setdefault((student, whose), set()).add(one.number)
            for how, names in like.items():
                more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
                whose = f"{', '.join(names[:MOST])}{more}"
                said[student].append(f"{one.number}: this answer and that of {whose} are {how}")
    for (student, whose), exercises in same.items():
        if len(exercises) >= SEVERAL:
            said[student].append(
                f"{len(exercises)} of {len(right[student])} right answers are like {whose}; each "
                "may be chance, all of them hardly"
            )
    return said
