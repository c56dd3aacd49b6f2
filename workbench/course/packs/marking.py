"""Marking one file by the key of its student: it answers in a process of its own, step by step."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from workbench.course.checks import NUMERIC, Missed, Raised, equal, formed, legible, same
from workbench.course.grading import Ended, received
from workbench.course.packs.confinement import MEMORY
from workbench.course.packs.handed_in import Sheet
from workbench.course.packs.keys import ExerciseKey, value
from workbench.course.packs.likeness import attempted
from workbench.course.packs.passed_on import passed_on
from workbench.course.student_process import StudentProcess
from workbench.errors import BadArgument

PROCESS = "workbench.course.packs.confined_process"
UNSOLVED = "not attempted"


@dataclass(frozen=True)
class Limits:
    """What the process of a file may take.

    Attributes:
        seconds: for all answers to an exercise, and for loading the file.
        memory: address space in GiB, where the system can limit it.
    """

    seconds: float = 10.0
    memory: float = 4.0

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise BadArgument(f"--seconds takes a number above 0, not {self.seconds}")
        if not self.memory >= 1:
            raise BadArgument(f"--memory takes GiB, 1 or more, not {self.memory}")


@dataclass(frozen=True)
class ExerciseMark:
    """What one answer earned.

    Attributes:
        number: the number of the exercise.
        exercise: its name.
        points: how many points it earned.
        of: how many it could earn.
        remarks: why points are missing, and what the file tried to do.
    """

    number: str
    exercise: str
    points: int
    of: int
    remarks: tuple[str, ...] = ()


def mark_sheet(sheet: Sheet, keys: Sequence[ExerciseKey], limits: Limits) -> list[ExerciseMark]:
    """Mark the answers of a file, of which a copy runs in a folder that is removed afterwards.

    Whatever an answer does, the others are marked all the same.
    """
    if sheet.trouble:
        return [_lost(key, sheet.trouble) for key in keys]
    if not attempted(sheet.source, [key.exercise for key in keys]):
        return [_lost(key, UNSOLVED) for key in keys]
    with TemporaryDirectory(prefix="workbench-answers-") as scratch:
        for helper in sheet.helpers:
            shutil.copy(helper, Path(scratch) / helper.name)
        path = Path(scratch) / f"{sheet.name}.py"
        path.write_text(sheet.source, encoding="utf-8")
        return marks_of(path, keys, limits)


def marks_of(path: Path, keys: Sequence[ExerciseKey], limits: Limits) -> list[ExerciseMark]:
    """The marks of a file where it stands, in the order of the keys."""
    found: dict[str, ExerciseMark] = {}
    while left := [key for key in keys if key.number not in found]:
        with StudentProcess(
            str(path.resolve()),
            [key.exercise for key in left],
            limits.seconds,
            module=PROCESS,
            variables={MEMORY: str(int(limits.memory * 2**30))},
            inherited=passed_on(),
        ) as answers:
            try:
                answers.loaded()
            except Ended as ended:
                again = " again" if found else ""
                sentence = f"the file could not be loaded{again}: {ended}"
                found |= {key.number: _lost(key, sentence) for key in left}
                break
            for key in left:
                try:
                    found[key.number] = _mark(key, answers)
                except Ended as ended:
                    found[key.number] = _lost(key, str(ended))
                    break
    return [found[key.number] for key in keys]


def _mark(key: ExerciseKey, answers: StudentProcess) -> ExerciseMark:
    """The mark of one exercise. Raises Ended if the process of the answers ends."""
    match answers.begin(key.exercise, key.parameters):
        case {"unfit": None}:
            pass
        case {"unfit": [str() as what, str() as expected, str() as came]}:
            return _lost(key, _sentence(Missed(legible(what), legible(expected), legible(came))))
        case _:
            raise Ended("its process sent what is no answer")
    given = [received(answers.answer(_arguments(arguments))) for arguments, _ in key.tries]
    if all(isinstance(one, Raised) and one.unsolved for one in given):
        return _lost(key, UNSOLVED)
    missed = [_missed(key, pair, came) for pair, came in zip(key.tries, given, strict=True)]
    wrong = [one for one in missed if one]
    for_edges = 1 if key.edges else 0
    points, remarks = (0 if wrong else key.points - for_edges), []
    if wrong:
        remarks.append(f"{len(wrong)} of {len(missed)} tries are wrong: {wrong[0]}")
        remarks += [f"perhaps: {hint}" for hint in _slips(key, given)[:1]]
    elif for_edges:
        ends = [
            _missed(key, pair, received(answers.answer(_arguments(pair[0])))) for pair in key.edges
        ]
        points += not any(ends)
        remarks += [f"wrong at an end of the range: {one}" for one in ends if one][:1]
    answers.printed()
    remarks += [f"tried {what}, which was refused" for what in answers.refused]
    return ExerciseMark(key.number, key.exercise, points, key.points, tuple(remarks))


def _lost(key: ExerciseKey, why: str) -> ExerciseMark:
    return ExerciseMark(key.number, key.exercise, 0, key.points, (why,))


def _arguments(data: Any) -> tuple[Any, ...]:
    return tuple(value(data))


def _slips(key: ExerciseKey, given: Sequence[Any]) -> list[str]:
    return [
        hint
        for hint, answers in key.slips
        if all(same(a, value(b), 1e-6) for a, b in zip(given, answers, strict=True))
    ]


def _missed(key: ExerciseKey, pair: Sequence[Any], came: Any) -> str:
    """What is wrong with an answer, as a sentence; nothing if it is right."""
    try:
        compare(came, value(pair[1]), key.exercise, key.within)
    except Missed as missed:
        return _sentence(missed)
    return ""


def compare(came: Any, expected: Any, what: str, within: float) -> None:
    """Compare an answer with the expected one, after it has got its form. Raises Missed."""
    if isinstance(came, Raised):
        raise Missed(what, "an answer", came.message)
    _agree(formed(came, expected, what), expected, what, within)


def _agree(came: Any, expected: Any, what: str, within: float) -> None:
    if isinstance(expected, tuple | list):
        if len(came) != len(expected):
            raise Missed(what, f"{len(expected)} entries", f"{len(came)} entries")
        for k, (a, b) in enumerate(zip(came, expected, strict=True)):
            _agree(a, b, f"{what}[{k}]", within)
    elif isinstance(expected, dict):
        for name in expected:
            _agree(came[name], expected[name], f"{what}[{name!r}]", within)
    elif isinstance(expected, NUMERIC):
        size = np.abs(np.asarray(expected, dtype=float)).max(initial=0.0)
        scale = size if 0 < size < 1 else 1.0  # small numbers have to be right, too
        try:
            equal(np.asarray(came) / scale, np.asarray(expected) / scale, what, within)
        except Missed:
            equal(came, expected, what, 0.0)  # the same in the numbers of the exercise
    elif came != expected:
        raise Missed(what, repr(expected), repr(came))


def _sentence(missed: Missed) -> str:
    parts = [missed.what]
    if missed.expected:
        parts.append(f"expected {missed.expected}")
    if missed.came:
        parts.append(f"came {missed.came}")
    return " ".join(", ".join(parts).split())
