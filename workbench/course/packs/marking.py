"""Marking answers by the keys of a class, and trying them on the examples beside them.

A file runs in a process that gets arguments and sends answers; they are compared here.
"""

import csv
import hashlib
import json
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import numpy as np

from workbench.course.checks import NUMERIC, Missed, Raised, equal, formed, legible, same
from workbench.course.packs.handing_out import EXAMPLES
from workbench.course.packs.keys import ClassKey, ExerciseKey
from workbench.course.packs.submissions import (
    ENDINGS,
    Sheet,
    Submissions,
    attempted,
    read_sheet,
    remarks_of,
)
from workbench.course.plain import Malformed, decode, received
from workbench.course.process import NO_ANSWER, ProcessLimits, ask
from workbench.environment import VERSION
from workbench.errors import BadFile
from workbench.writing import replacing, write_file

MARKED = "marked"  # the folder in the keys that holds what is marked already
UNSOLVED = "not attempted"
NOT_IN_FILE = "its answers are not in the file of answers"
NOT_YET = "not marked yet: the same command continues"
MISSING, TWICE = "not handed in", "handed in more than once: the better answer counts"
T = TypeVar("T")


@dataclass(frozen=True)
class ExerciseMark:
    """What one answer earned."""

    number: str  # the number of the exercise
    exercise: str  # its name
    points: int  # how many points it earned
    of: int  # how many it could earn
    remarks: tuple[str, ...] = ()  # why points are missing, and what the file tried to do


Answers = dict[str, dict[str, Any] | str]  # of each exercise what was sent, or why nothing was


def answers_of(sheet: Sheet, keys: Sequence[ExerciseKey], limits: ProcessLimits) -> Answers:
    """The answers of a file, of which a copy runs in a folder that is removed afterwards.

    Whatever an answer does, the others are asked for all the same.
    """
    if sheet.trouble:
        return {key.number: sheet.trouble for key in keys}
    if not attempted(sheet.source, [key.exercise for key in keys]):
        return {key.number: UNSOLVED for key in keys}
    with TemporaryDirectory(prefix="workbench-answers-") as scratch:
        for helper in sheet.helpers:
            shutil.copy(helper, Path(scratch) / helper.name)
        path = Path(scratch) / f"{sheet.name}.py"
        path.write_text(sheet.source, encoding="utf-8")
        return answers_in(path, keys, limits)


def answers_in(path: Path, keys: Sequence[ExerciseKey], limits: ProcessLimits) -> Answers:
    """The answers of a file where it stands: to the arguments of the keys, which alone it gets."""
    questions = {
        key.exercise: {
            "parameters": key.parameters,
            "arguments": [arguments for arguments, _ in (*key.tries, *key.edges)],
        }
        for key in keys
    }
    sent = ask(path, {}, questions, limits).exercises
    return {key.number: sent[key.exercise] for key in keys}


def mark_of(key: ExerciseKey, sent: dict[str, Any] | str) -> ExerciseMark:
    """The mark of one exercise, from what its process sent."""
    if isinstance(sent, str):
        return _lost(key, sent)
    try:
        match sent:
            case {"unfit": [str() as what, str() as expected, str() as actual]}:
                return _lost(key, _sentence(Missed(*map(legible, (what, expected, actual)))))
            case {"answers": list() as encoded}:
                answers = [received(answer) for answer in encoded]
            case {"too large": True}:
                return _lost(key, "its answers are too large to be graded")
            case _:
                return _lost(key, NO_ANSWER)
    except (Malformed, RecursionError):
        return _lost(key, NO_ANSWER)
    if len(answers) != len(key.tries) + len(key.edges):
        return _lost(key, NO_ANSWER)
    tried, at_ends = answers[: len(key.tries)], answers[len(key.tries) :]
    if all(isinstance(answer, Raised) and answer.unsolved for answer in tried):
        return _lost(key, UNSOLVED)
    if wrong := _missed(key, key.tries, tried):
        remarks = [f"{len(wrong)} of {len(tried)} tries are wrong: {wrong[0]}"]
        remarks += [
            f"perhaps: {hint}"
            for hint, wrong_answers in key.mistakes
            if all(same(a, decode(b), 1e-6) for a, b in zip(tried, wrong_answers, strict=True))
        ][:1]
        return _lost(key, *remarks)
    wrong = _missed(key, key.edges, at_ends)
    if wrong:
        remark = f"wrong at an end of the range: {wrong[0]}"
        return ExerciseMark(key.number, key.exercise, key.points - 1, key.points, (remark,))
    return ExerciseMark(key.number, key.exercise, key.points, key.points)


def _lost(key: ExerciseKey, *why: str) -> ExerciseMark:
    return ExerciseMark(key.number, key.exercise, 0, key.points, why)


def _missed(key: ExerciseKey, pairs: Sequence[Any], answers: Sequence[Any]) -> list[str]:
    """A sentence for each wrong answer."""
    sentences = []
    for (_, expected), answer in zip(pairs, answers, strict=True):
        try:
            compare(answer, decode(expected), key.exercise, key.within)
        except Missed as missed:
            sentences.append(_sentence(missed))
    return sentences


def compare(answer: Any, expected: Any, what: str, within: float) -> None:
    """Compare an answer with the expected one, after it has got its form. Raises Missed."""
    if isinstance(answer, Raised):
        raise Missed(what, "an answer", answer.message)
    _agree(formed(answer, expected, what), expected, what, within)


def _agree(answer: Any, expected: Any, what: str, within: float) -> None:
    if isinstance(expected, tuple | list):
        if len(answer) != len(expected):
            raise Missed(what, f"{len(expected)} entries", f"{len(answer)} entries")
        for k, (a, b) in enumerate(zip(answer, expected, strict=True)):
            _agree(a, b, f"{what}[{k}]", within)
    elif isinstance(expected, dict):
        for name in expected:
            _agree(answer[name], expected[name], f"{what}[{name!r}]", within)
    elif isinstance(expected, NUMERIC):
        size = np.abs(np.asarray(expected, dtype=float)).max(initial=0.0)
        scale = size if 0 < size < 1 else 1.0  # small numbers have to be right, too
        try:
            equal(np.asarray(answer) / scale, np.asarray(expected) / scale, what, within)
        except Missed:
            equal(answer, expected, what, 0.0)  # the same, said in numbers that are not scaled
    elif answer != expected:
        raise Missed(what, repr(expected), repr(answer))


def _sentence(missed: Missed) -> str:
    parts = (("", missed.what), ("expected ", missed.expected), ("returned ", missed.came))
    return " ".join(", ".join(word + text for word, text in parts if text).split())


@dataclass(frozen=True)
class StudentMark:
    """All marks of a student."""

    student: str  # the name of the student's folder
    # one mark for each exercise; none if nothing has been marked yet
    exercises: tuple[ExerciseMark, ...]
    remarks: tuple[str, ...] = ()  # on the files as a whole

    @property
    def points(self) -> int:
        """The points of all exercises."""
        return sum(mark.points for mark in self.exercises)


def mark_class(
    submissions: Submissions,
    key: ClassKey,
    keys: Path,
    table: Path,
    limits: ProcessLimits,
    tell: Callable[[str, StudentMark, bool], None] = lambda student, mark, again: None,
    workers: int = 1,
    answers: Mapping[str, Sequence[Answers]] | None = None,
) -> list[StudentMark]:
    """Mark all students and write the table, after each of them.

    What is marked is kept in the folder of keys, and is not marked again unless a file, the key or
    a limit has changed; so the same command goes on where it was interrupted. `tell` is called
    after each student, with the mark, and whether it was kept from before. `workers` files run at
    once. `answers` of each student's files, as `answers_of_class` found them elsewhere, are marked
    without running anything. Raises BadFile.
    """
    remarks_on, marked = remarks_of(submissions, key), dict[str, StudentMark]()

    def mark(student: str) -> tuple[tuple[ExerciseMark, ...], bool]:
        student_answers = None if answers is None else answers.get(student, ())
        return _marked(student, submissions.sheets[student], key, keys, limits, student_answers)

    for student, (marks, again) in in_parallel(mark, key.students, workers):
        marked[student] = StudentMark(student, marks, tuple(remarks_on[student]))
        write_table(table, key, marked)
        tell(student, marked[student], again)
    return [marked[student] for student in key.students]


def answers_of_class(
    submissions: Submissions, key: ClassKey, limits: ProcessLimits, workers: int = 1
) -> dict[str, list[Answers]]:
    """The answers of each student's files, which `mark_class` compares with the keys elsewhere."""

    def ask_all(student: str) -> list[Answers]:
        return [
            answers_of(sheet, _keys_of(key, student, sheet), limits)
            for sheet in submissions.sheets[student]
        ]

    return dict(in_parallel(ask_all, key.students, workers))


def in_parallel(
    work: Callable[[str], T], students: Collection[str], workers: int
) -> Iterator[tuple[str, T]]:
    """The results of work on students, in order; each waits for a process of its own."""
    with ThreadPoolExecutor(workers) as pool:
        yield from zip(students, pool.map(work, students), strict=True)


def _keys_of(key: ClassKey, student: str, sheet: Sheet) -> list[ExerciseKey]:
    return [exercise for exercise in key.keys[student] if exercise.sheet == sheet.name]


def _marked(
    student: str,
    sheets: list[Sheet],
    key: ClassKey,
    keys: Path,
    limits: ProcessLimits,
    answers: Sequence[Answers] | None,
) -> tuple[tuple[ExerciseMark, ...], bool]:
    place = keys / MARKED / f"{student}.json"
    contents = [(sheet.name, sheet.source, sheet.trouble) for sheet in sheets]
    helpers = [path.read_bytes().hex() for sheet in sheets for path in sheet.helpers]
    own_keys = [asdict(exercise) for exercise in key.keys[student]]
    # all that marks depend on
    parts: Any = [VERSION, contents, helpers, own_keys, asdict(limits), answers]
    digest = hashlib.sha256(json.dumps(parts).encode()).hexdigest()
    try:
        data = json.loads(place.read_text(encoding="utf-8"))
        if data["digest"] == digest:
            kept = [{**mark, "remarks": tuple(mark["remarks"])} for mark in data["exercises"]]
            return tuple(ExerciseMark(**mark) for mark in kept), True
    except (OSError, ValueError, KeyError, TypeError):
        pass  # nothing kept, or nothing that can be read: it is marked again
    if answers is None:
        answers = [answers_of(sheet, _keys_of(key, student, sheet), limits) for sheet in sheets]
    marks: dict[str, ExerciseMark] = {}
    for sheet, sent in zip(sheets, [*answers, *({} for _ in sheets)], strict=False):
        for exercise in _keys_of(key, student, sheet):
            mark = mark_of(exercise, sent.get(exercise.number, NOT_IN_FILE))
            if mark.number in marks:
                better = max(marks[mark.number], mark, key=lambda mark: mark.points)
                mark = replace(better, remarks=(*better.remarks, TWICE))
            marks[mark.number] = mark
    all_marks = tuple(
        marks.get(exercise.number)
        or ExerciseMark(exercise.number, exercise.exercise, 0, exercise.points, (MISSING,))
        for exercise in key.keys[student]
    )
    try:
        place.parent.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        raise BadFile(f"cannot write {place.parent}: {error.strerror}") from error
    data = {"digest": digest, "exercises": [asdict(mark) for mark in all_marks]}
    write_file(place, json.dumps(data, indent=1, ensure_ascii=False))
    return all_marks, False


def write_table(path: Path, key: ClassKey, marked: dict[str, StudentMark]) -> None:
    """Write a CSV file: a line for each student, whether marked or not. Raises BadFile."""
    numbers = [exercise.number for exercise in key.exercises]
    of = sum(exercise.points for exercise in key.exercises)
    head = ["student", "folder", "points", "of", *numbers, "remarks"]
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8-sig", newline="") as file,
    ):
        lines = csv.writer(file)
        lines.writerow(head)
        for student, name in key.students.items():
            mark = marked.get(student)
            row: list[Any] = [name, student, "", of, *("" for _ in numbers), NOT_YET]
            if mark is not None:
                points = {exercise.number: exercise.points for exercise in mark.exercises}
                row[2], row[4:-1] = mark.points, [points[n] for n in numbers]
                row[-1] = "; ".join(remarks(mark))
            lines.writerow([plain_cell(cell) for cell in row])


def remarks(student: StudentMark) -> list[str]:
    """All remarks on a student: on the files as a whole, and by exercise."""
    each = [f"{mark.number}: {remark}" for mark in student.exercises for remark in mark.remarks]
    return [*student.remarks, *each]


def plain_cell(cell: Any) -> Any:
    """A cell that no spreadsheet takes for a formula: remarks quote what students wrote."""
    if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@", "\t", "\r"):
        return f"'{cell}"
    return cell


def read_examples(folder: Path) -> dict[str, Any]:
    """The examples in a student's folder. Raises BadFile."""
    path = folder / EXAMPLES
    if not path.is_file():
        raise BadFile(
            f"there is no {path}; it came with the exercises, and has to stand beside them"
        )
    try:
        examples: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["exercises"]
    except (ValueError, KeyError, TypeError) as error:
        raise BadFile(f"{path} is damaged: {error}; take it from what you were given") from error
    return examples


def try_file(path: Path, limits: ProcessLimits) -> list[ExerciseMark]:
    """Try a file or a notebook on its examples, in the process in which it will be marked.

    Of a notebook the cells that try answers are left out, as when it is marked. Each exercise
    counts one point for all its examples. Raises BadFile.
    """
    if not path.is_file():
        raise BadFile(f"there is no file {path}; give the file with your answers")
    if path.suffix.lower() not in ENDINGS:
        raise BadFile(f"{path} is neither a file of Python (.py) nor a notebook (.ipynb)")
    keys, examples = [], read_examples(path.parent)
    exercises: dict[str, list[str]] = {}
    for name in examples:
        exercises.setdefault(name.rpartition(".")[0], []).append(name.rpartition(".")[2])
    read = read_sheet(path, exercises)
    for name, example in examples.items():
        sheet, _, exercise = name.rpartition(".")
        if sheet == read.name:
            keys.append(
                ExerciseKey(
                    example["number"], sheet, exercise, example["parameters"], 1, 1,
                    example["within"], example["numbers"], example["examples"], [], [], [],
                )
            )  # fmt: skip
    if not keys:
        raise BadFile(f"{path.parent / EXAMPLES} says nothing about {path.name}; keep its name")
    if path.suffix.lower() == ".py" and not read.trouble:
        sent = answers_in(path, keys, limits)  # where it stands, beside its helpers
    else:
        helpers = [
            example
            for example in path.parent.glob("*.py")
            if not read_sheet(example, exercises).name
        ]
        sent = answers_of(replace(read, helpers=tuple(helpers)), keys, limits)
    return [mark_of(key, sent[key.number]) for key in keys]
