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
from workbench.cli.console import print_page, say, waiting
from workbench.course.packs.handing_out import read_students, write_pack
from workbench.course.packs.keys import KEYS, QUESTIONS, read_keys
from workbench.course.packs.marking import (
    StudentMark,
    answers_of_class,
    mark_class,
    remarks,
    try_file,
)
from workbench.course.packs.submissions import EXPECTED, Submissions, collect
from workbench.course.process import ProcessLimits
from workbench.diagnostics.words import counted
from workbench.errors import BadArgument, BadFile
from workbench.reading.facts import json_in
from workbench.writing import write_file

LIMITS = ProcessLimits()
NOT_ALL_RIGHT = 1  # the exit code of `try`

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
        int | None, typer.Option(help="Draws all numbers; else one that nobody can guess.")
    ] = None,
) -> None:
    """Write exercises for a class, each student's with own numbers.

    The keys are kept apart.
    """
    console = Console()
    hidden = keys or to.with_name(f"{to.name}-keys")
    listed = read_students(students, column)
    named = listed.names
    if listed.columns:
        say(console, f"students are named by {escape(' and '.join(listed.columns))}")
    with Console(stderr=True).status("drawing numbers and computing answers") as status:
        made = write_pack(
            what, group, named, to, hidden, seed, lambda name: status.update(f"writing {name}")
        )
    points = sum(one.points for one in made.exercises)
    minutes = sum(one.minutes for one in made.exercises)
    for one in made.exercises:
        worth = f"{counted(one.points, 'point')}, about {one.minutes} minutes"
        say(console, f"[bold]{one.number} {one.exercise}[/] [dim]({worth})[/]")
    say(
        console,
        f"{counted(len(made.exercises), 'exercise')}, {points} points, about {minutes} minutes as "
        f"estimated, for {counted(len(named), 'student')}",
    )
    print_page(console, "to hand out, a folder for each student", to)
    print_page(console, "keys, which are yours alone", hidden)
    print_page(console, "mark them", f"workbench lecture mark HANDED_IN --keys {hidden}")
    chose = ["--column", column] if column else []
    again = [*what, "--for", group, "--students", students, *chose, "--seed", str(made.seed)]
    say(
        console,
        f"the seed is {made.seed}; it stands in the keys, too. The same pack again, for which it "
        f"has to be kept: workbench lecture pack {escape(shlex.join(again))} --to NEW_FOLDER",
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
            found = try_file(path, ProcessLimits(seconds, memory))
        for one in found:
            right = one.points == one.of
            wrong += not right
            state = "[green]right on the examples[/]" if right else "[bold red]not yet[/]"
            say(console, f"[bold]{one.number} {one.exercise}[/]  {state}")
            for said in one.remarks:
                say(console, f"    {escape(said)}")
    if wrong:
        raise typer.Exit(NOT_ALL_RIGHT)


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
    workers: Annotated[int, typer.Option(help="Files that run at once.")] = 1,
    only_answers: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Write what the files answer, and mark nothing."),
    ] = None,
    answers: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Mark what --only-answers wrote.")
    ] = None,
) -> None:
    """Mark submissions of a class, and write the marks as CSV.

    Each file answers in a process of its own. If it is interrupted, the same command goes on.
    """
    if table.suffix.lower() != ".csv":
        raise BadArgument(f"--csv takes the name of a file .csv, not {table}")
    if workers < 1:
        raise BadArgument(f"--workers takes a number of files, 1 or more, not {workers}")
    console, limits = Console(), ProcessLimits(seconds, memory)
    key = read_keys(keys, KEYS if only_answers is None else QUESTIONS)
    found = collect(folder, key)
    if only_answers is not None:
        with waiting("asking for answers, which takes some seconds for each file"):
            sent = answers_of_class(found, key, limits, workers)
        write_file(only_answers, json.dumps(sent))
        print_page(console, "answers, to be marked beside the keys", only_answers)
        return
    given = None if answers is None else _read_answers(answers)
    of, done = sum(one.points for one in key.exercises), 0

    def tell(student: str, mark: StudentMark, again: bool) -> None:
        nonlocal done
        done += 1
        kept = " [dim](marked before)[/]" if again else ""
        name = escape(key.students[student])
        say(
            console,
            f"[dim]{done} of {len(key.students)}[/] [bold]{name}[/]  {mark.points} of {of}{kept}",
        )
        for said in remarks(mark):
            say(console, f"    {escape(said)}")

    def left() -> str:
        return (
            f"interrupted; {done} of {len(key.students)} students are marked, and {table} says "
            "which. The same command goes on"
        )

    with (
        interrupts_say(left),
        Console(stderr=True).status("marking, which takes some seconds for each file"),
    ):
        mark_class(found, key, keys, table, limits, tell, workers, given)
    _say_unused(console, found)
    print_page(console, "marks", table)


def _read_answers(path: Path) -> dict[str, Any]:
    """What --only-answers wrote; only its form at the top is looked at here. Raises BadFile."""
    found = json_in(path)
    if not isinstance(found, dict) or not all(
        isinstance(some, list) and all(isinstance(one, dict) for one in some)
        for some in found.values()
    ):
        raise BadFile(f"{path} is not what `workbench lecture mark --only-answers` wrote")
    return found


def _say_unused(console: Console, found: Submissions) -> None:
    """Every file that is not marked, with the reason, but for what is to be expected."""
    for one in found.unused:
        if one.why not in EXPECTED:
            path, why = escape(str(one.path)), escape(one.why)
            say(console, f"[yellow]not marked:[/] {path}: {why}")


COMMANDS: dict[str, Callable[..., None]] = {"pack": pack, "try": attempt, "mark": mark}
