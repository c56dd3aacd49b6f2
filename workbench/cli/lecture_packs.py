"""`workbench lecture pack`, `try` and `mark`: exercises for a class, and their marks."""

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli import interrupts_say
from workbench.cli.console import at_least_one, print_page, say, waiting
from workbench.course.packs.handing_out import read_students, write_pack
from workbench.course.packs.keys import KEYS, QUESTIONS, read_keys
from workbench.course.packs.marking import (
    StudentMark,
    answers_of_class,
    mark_class,
    remarks,
    try_file,
)
from workbench.course.packs.submissions import NOT_REPORTED, Submissions, collect
from workbench.course.process import ProcessLimits
from workbench.diagnostics.words import counted
from workbench.errors import BadArgument, BadFile
from workbench.reading.facts import json_in
from workbench.writing import write_file

LIMITS = ProcessLimits()
EXIT_NOT_RIGHT = 1  # the exit code of `try`

Seconds = Annotated[
    float, typer.Option(help="Seconds that each exercise, and loading the file, may take.")
]
Memory = Annotated[float, typer.Option(help="GiB of memory that the process of a file may take.")]


def pack(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT...",
            help="Lectures (4), exercises (4.2), or a FILE.py with exercises of yours.",
        ),
    ],
    group: Annotated[str, typer.Option("--for", metavar="CLASS", help="The name of the class.")],
    to: Annotated[Path, typer.Option(help="New folder, with a folder in it for each student.")],
    students: Annotated[
        str, typer.Option(help="FILE.csv of a learning platform, or names: ada,ben.")
    ] = "everybody",
    column: Annotated[
        str | None,
        typer.Option(metavar="TITLE", help="The column of FILE.csv that holds the names."),
    ] = None,
    keys: Annotated[
        Path | None, typer.Option(help="New folder for the answers, else TO-keys.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all numbers; else one that nobody can guess.")
    ] = None,
) -> None:
    """Write exercises for a class, each student's with own numbers.

    The keys are kept apart.
    """
    console = Console()
    keys_folder = keys or to.with_name(f"{to.name}-keys")
    listed = read_students(students, column)
    names = listed.names
    if listed.columns:
        say(console, f"students are named by {escape(' and '.join(listed.columns))}")
    with Console(stderr=True).status("drawing numbers and computing answers") as status:
        written = write_pack(
            what, group, names, to, keys_folder, seed, lambda name: status.update(f"writing {name}")
        )
    exercises = written.exercises
    points = sum(exercise.points for exercise in exercises)
    minutes = sum(exercise.minutes for exercise in exercises)
    for exercise in exercises:
        worth = f"{counted(exercise.points, 'point')}, about {exercise.minutes} minutes"
        say(console, f"[bold]{exercise.number} {exercise.exercise}[/] [dim]({worth})[/]")
    say(
        console,
        f"{counted(len(exercises), 'exercise')}, {points} points, about {minutes} minutes as "
        f"estimated, for {counted(len(names), 'student')}",
    )
    print_page(console, "to hand out, a folder for each student", to)
    print_page(console, "keys, which are yours alone", keys_folder)
    print_page(console, "mark them", f"workbench lecture mark HANDED_IN --keys {keys_folder}")
    command = [*what, "--for", group, "--students", students, "--seed", str(written.seed)]
    if column:
        command += ["--column", column]
    say(
        console,
        f"the seed, {written.seed}, is also in the keys; keep it to write the same pack again: "
        f"workbench lecture pack {escape(shlex.join(command))} --to NEW_FOLDER",
    )


def attempt(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Files or notebooks with your answers.")
    ],
    seconds: Seconds = LIMITS.seconds,
    memory: Memory = LIMITS.memory,
) -> None:
    """Try answers to a pack on the examples that came with it.

    They run as they will when they are marked; then other arguments are tried, too. Exits with 1
    unless all are right.
    """
    console, wrong = Console(), 0
    for path in files:
        with waiting(f"trying {escape(str(path))}, which takes some seconds"):
            results = try_file(path, ProcessLimits(seconds, memory))
        for result in results:
            right = result.points == result.of
            wrong += not right
            state = "[green]right on the examples[/]" if right else "[bold red]not yet[/]"
            say(console, f"[bold]{result.number} {result.exercise}[/]  {state}")
            for remark in result.remarks:
                say(console, f"    {escape(remark)}")
    if wrong:
        raise typer.Exit(EXIT_NOT_RIGHT)


def mark(
    folder: Annotated[
        Path, typer.Argument(help="A folder for each student, or files such as ada_NAME.py.")
    ],
    keys: Annotated[Path, typer.Option(help="The folder of keys that `pack` wrote.")],
    table: Annotated[
        Path, typer.Option("--csv", metavar="FILE.csv", help="File for the marks.")
    ] = Path("marks.csv"),
    seconds: Seconds = LIMITS.seconds,
    memory: Memory = LIMITS.memory,
    workers: Annotated[
        int, typer.Option(callback=at_least_one, help="Files that run at once.")
    ] = 1,
    only_answers: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Write what the files answer, and mark nothing."),
    ] = None,
    answers: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Mark what --only-answers wrote.")
    ] = None,
) -> None:
    """Mark submissions of a class, and write the marks as CSV.

    Each file answers in a process of its own. After an interrupt the same command continues.
    """
    if table.suffix.lower() != ".csv":
        raise BadArgument(f"--csv takes the name of a file .csv, not {table}")
    console, limits = Console(), ProcessLimits(seconds, memory)
    key = read_keys(keys, KEYS if only_answers is None else QUESTIONS)
    submissions = collect(folder, key)
    if only_answers is not None:
        with waiting("asking for answers, which takes some seconds for each file"):
            class_answers = answers_of_class(submissions, key, limits, workers)
        write_file(only_answers, json.dumps(class_answers))
        print_page(console, "answers, to be marked beside the keys", only_answers)
        return
    known_answers = None if answers is None else _read_answers(answers)
    of, done = sum(exercise.points for exercise in key.exercises), 0

    def tell(student: str, mark: StudentMark, again: bool) -> None:
        nonlocal done
        done += 1
        kept = " [dim](marked before)[/]" if again else ""
        name = escape(key.students[student])
        say(
            console,
            f"[dim]{done} of {len(key.students)}[/] [bold]{name}[/]  {mark.points} of {of}{kept}",
        )
        for remark in remarks(mark):
            say(console, f"    {escape(remark)}")

    def interruption() -> str:
        return (
            f"interrupted; {done} of {len(key.students)} students are marked, and {table} says "
            "which. The same command continues"
        )

    with (
        interrupts_say(interruption),
        Console(stderr=True).status("marking, which takes some seconds for each file"),
    ):
        mark_class(submissions, key, keys, table, limits, tell, workers, known_answers)
    _say_unused(console, submissions)
    print_page(console, "marks", table)


def _read_answers(path: Path) -> dict[str, Any]:
    """What --only-answers wrote; only its form at the top is looked at here. Raises BadFile."""
    answers = json_in(path)
    if not isinstance(answers, dict) or not all(
        isinstance(listed, list) and all(isinstance(answer, dict) for answer in listed)
        for listed in answers.values()
    ):
        raise BadFile(f"{path} is not what `workbench lecture mark --only-answers` wrote")
    return answers


def _say_unused(console: Console, submissions: Submissions) -> None:
    """Every file that is not marked, with the reason, but for what is to be expected."""
    for file in submissions.unused:
        if file.why not in NOT_REPORTED:
            path, why = escape(str(file.path)), escape(file.why)
            say(console, f"[yellow]not marked:[/] {path}: {why}")


COMMANDS: dict[str, Callable[..., None]] = {"pack": pack, "try": attempt, "mark": mark}
