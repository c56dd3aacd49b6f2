"""Grading a student's file where no other process can be started: it answers in this one.

This is for learning, in a browser. A file that counts is graded where there are processes.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from workbench.course.answer_process import Answerer, begun
from workbench.course.checks import legible, without_warnings
from workbench.course.grades import CheckResult, Grade, not_done
from workbench.course.grading import Ended, grade_exercise
from workbench.course.outline import Lecture

UNGUARDED = (
    "No other process can be started here, so the file ran in the one that grades it: there was no "
    "limit of time, and nothing kept it from reading the solutions or from changing its points. "
    "Use this for learning; a grade that counts needs a machine with processes."
)


def grade_here(lecture: Lecture, path: Path) -> Grade:
    """Grade a file of answers that runs in this process; the grade's note says what that means.

    An answer that does not end is not stopped, and one that ends the program without an exception
    (`os._exit`) ends everything.
    """
    _ = lecture.checks, lecture.mistakes, lecture.solutions  # loaded before the file is
    with _module_paths_restored():
        module, told = begun(str(path.resolve()), lecture.exercises)
        if module is None:
            failed = not_done(lecture, lecture.exercises, "the file could not be loaded")
            return Grade(
                lecture, str(path), tuple(failed), legible(told["trouble"]), note=UNGUARDED
            )
        answerer, results = Answerer(module), list[CheckResult]()
        printed = {"": legible(told["loaded"])}
        for name in lecture.exercises:
            try:
                with without_warnings():
                    results += grade_exercise(lecture, name, answerer)
            except Ended as ended:
                results += not_done(lecture, [name], str(ended))
            printed[name] = legible(answerer.printed()["printed"])
    printed = {name: text for name, text in printed.items() if text}
    return Grade(lecture, str(path), tuple(results), printed=printed, note=UNGUARDED)


@contextmanager
def _module_paths_restored() -> Iterator[None]:
    """Afterwards the student's module and its folder are forgotten, and no byte code is left."""
    paths, bytecode = list(sys.path), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.modules.pop("answers", None)
    try:
        yield
    finally:
        sys.path[:], sys.dont_write_bytecode = paths, bytecode
        sys.modules.pop("answers", None)
