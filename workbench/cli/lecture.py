"""`workbench lecture`: the course."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markdown import Markdown
from rich.markup import escape
from rich.table import Table

from workbench import course
from workbench.cli import lecture_packs
from workbench.cli.console import print_page, say, waiting
from workbench.course.cells import Cell, run_cells
from workbench.course.formulas import in_letters
from workbench.course.grading import CheckResult, CheckState, Grade
from workbench.course.notebooks import notebook, write_notebook
from workbench.course.outline import course as outline
from workbench.course.outline import hand_out, lecture_named, own_lecture
from workbench.course.packs.variants import variants_of
from workbench.course.process import ProcessLimits, grade
from workbench.course.site import write_course_site
from workbench.course.slides import write_slides
from workbench.diagnostics.words import counted
from workbench.errors import BadFile
from workbench.reports.folder import make_folder
from workbench.writing import write_file

LIMITS = ProcessLimits()
EXIT_NOT_PASSED = 1  # the exit code of `check`

Folder = Annotated[
    Path, typer.Argument(help="Folder to write to; it is made if it does not exist.")
]
Number = Annotated[
    str, typer.Argument(help="The number of a lecture, or the folder of one of your own.")
]


def list_(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FOLDER", help="Folders of lectures of your own, listed as well."),
    ] = None,
) -> None:
    """List the lectures, and their exercises' points and minutes."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for title in ("", "lecture", "minutes", "points", "minutes of exercises"):
        table.add_column(title, justify="left" if title == "lecture" else "right")
    for lecture in (*outline(), *map(own_lecture, folders or ())):
        points = str(sum(check.points for check in lecture.checks))
        description = f"[bold]{escape(lecture.title)}[/]\n[dim]{escape(lecture.question)}[/]"
        effort = f"about {lecture.exercise_minutes}" if lecture.exercise_minutes else ""
        table.add_row(str(lecture.number), description, str(lecture.minutes), points, effort)
    console = Console()
    console.print(table, highlight=False)
    hint = "`workbench lecture show N` says which exercises a pack holds, with points of their own"
    say(console, f"\n[dim]{hint}[/]")


def show(number: Number) -> None:
    """Show a lecture's question, aims, exercises and file."""
    lecture, console = lecture_named(number), Console()
    console.print(f"[bold]{lecture.number} {escape(lecture.title)}[/]")
    console.print(f"{escape(lecture.question)}\n")
    for title, text in (
        ("assumes", lecture.assumes),
        ("teaches", lecture.teaches),
        ("minutes", str(lecture.minutes)),
        ("text", str(lecture.folder / "lecture.py")),
    ):
        say(console, f"[dim]{title:8}[/] {escape(text)}")
    exercises = lecture.module("exercises")
    variants = {own.variant.exercise: own.variant for own in variants_of(lecture)}
    for k, name in enumerate(lecture.exercises, 1):
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        task = (getattr(exercises, name).__doc__ or "").splitlines()[0]
        minutes = lecture.minutes_for(name)
        worth = counted(points, "point") + (f", about {minutes} minutes" if minutes else "")
        if name in variants:
            in_pack = variants[name]
            worth += "; in a pack, with other numbers for each student: "
            worth += f"{counted(in_pack.points, 'point')}, about {in_pack.minutes} minutes"
        say(console, f"[bold]{lecture.number}.{k} {name}[/]  {escape(task)} [dim]({worth})[/]")
    argument = escape(lecture.argument)
    say(console, f"\nworkbench lecture run {argument}, workbench lecture start {argument} FOLDER")


def run(
    number: Number,
    out: Annotated[Path, typer.Option(help="Folder that figures are written into.")] = Path("runs"),
    code: Annotated[bool, typer.Option("--code", help="Show the code of each cell too.")] = False,
) -> None:
    """Run a lecture: text and results here, figures as files."""
    lecture, console = lecture_named(number), Console()
    make_folder(out / lecture.folder_name)
    pictures = 0

    def before(cell: Cell) -> None:
        if code and not cell.prose:
            print(cell.text)

    for cell, value, _ in run_cells(lecture.folder / "lecture.py", before):
        if cell.prose:
            _show_prose(console, cell.text)
        elif isinstance(value, course.Picture):
            pictures += 1
            path = out / lecture.folder_name / f"figure-{pictures}.png"
            write_file(path, value.png)
            console.print(f"[bold]{escape(str(path))}[/]: {escape(value.caption)}\n")
            if value.page is not None:
                by_hand = value.page.save(path.with_suffix(".html"))
                console.print(f"[bold]{escape(str(by_hand))}[/]: {escape(value.page.caption)}\n")
        elif value is not None:
            say(console, escape(repr(value)) + "\n")
    shows = "" if code else "; --code shows it between the text"
    console.print(f"the code: {escape(str(lecture.folder / 'lecture.py'))}{shows}", soft_wrap=True)


def _show_prose(console: Console, text: str) -> None:
    """Prose with its formulas in letters; those that stand alone keep their lines."""
    console.print()
    for k, part in enumerate(re.split(r"^\$\$(.+?)\$\$[ ]*$", text, flags=re.S | re.M)):
        if k % 2:
            say(console, "\n".join(f"    {escape(line)}" for line in in_letters(part).splitlines()))
        elif part.strip():
            console.print(Markdown(_with_letters(part)))
        console.print()


def _with_letters(prose: str) -> str:
    """Formulas in letters; Markdown shall not take their stars and underscores for its own."""

    def shown(match: re.Match[str]) -> str:
        if not match[1]:
            return match[0]  # code
        letters = " ".join(in_letters(match[1]).split())
        return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", letters)

    return re.sub(r"`[^`]*`|\$([^$]+)\$", shown, prose)


def begin(
    number: Number,
    folder: Annotated[
        Path, typer.Argument(help="Folder for the file; it is made if it does not exist.")
    ],
) -> None:
    """Copy the exercises of a lecture into a folder of yours.

    No file there is overwritten.
    """
    lecture = lecture_named(number)
    path = hand_out(lecture, folder)
    console = Console()
    print_page(console, "exercises", path)
    console.print(
        f"check them: workbench lecture check {escape(lecture.argument)} {escape(str(path))}",
        soft_wrap=True,
    )


def check(
    number: Number,
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE", help="Files with answers, or their folders; else the one here."
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Seconds that each exercise, and loading the file, may take.")
    ] = LIMITS.seconds,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for a grade book.")] = False,
) -> None:
    """Check answers, and print points and hints.

    Each file runs in its own process. Exits with 1 unless every check passed.
    """
    limits, lecture, console = ProcessLimits(seconds), lecture_named(number), Console()
    paths = [
        path / f"{lecture.folder_name}.py" if path.is_dir() else path for path in files or [Path()]
    ]
    grades: list[Grade] = []
    for path in paths:
        with waiting(f"checking {escape(str(path))}, which takes some seconds"):
            graded = grade(lecture, path, limits)
        grades.append(graded)
        if not as_json:
            print_grade(console, graded)
    if as_json:
        data = [graded.data() for graded in grades]
        typer.echo(json.dumps(data if len(paths) > 1 else data[0], indent=2))
    if not all(graded.passed for graded in grades):
        raise typer.Exit(EXIT_NOT_PASSED)


def notebooks(folder: Folder) -> None:
    """Write all lectures as notebooks, with their results.

    No file there is overwritten.
    """
    console = Console()
    paths = {folder / f"{lecture.folder_name}.ipynb": lecture for lecture in outline()}
    for path in paths:
        if path.exists():
            raise BadFile(f"{path} exists already, perhaps with somebody's work; name a new folder")
    make_folder(folder)
    for path, lecture in paths.items():
        console.print(f"[dim]running lecture {lecture.number}, {escape(lecture.title)}[/]")
        write_notebook(notebook(lecture), path)
    print_page(console, "notebooks", folder)


def slides(number: Number, folder: Folder) -> None:
    """Write a lecture as slides for a browser.

    They need no network. Needs the extra `course`.
    """
    lecture, console = lecture_named(number), Console()
    with waiting(f"running lecture {lecture.number}"):
        page = write_slides(lecture, folder)
    print_page(console, "slides", page)


def site(folder: Folder) -> None:
    """Write the course as a static site, with every lecture run.

    Needs the extra `course`.
    """
    console = Console()
    page = write_course_site(folder, lambda line: console.print(f"[dim]{escape(line)}[/]"))
    print_page(console, "site", page)


COMMANDS: dict[str, Callable[..., None]] = {
    "list": list_,
    "show": show,
    "run": run,
    "start": begin,
    "check": check,
    "notebooks": notebooks,
    "slides": slides,
    "site": site,
    **lecture_packs.COMMANDS,
}
HELP = "The course: lectures that can be run, and exercises that are graded."


STATE_COLOUR = {
    CheckState.PASSED: "green",
    CheckState.FAILED: "bold red",
    CheckState.NOT_ATTEMPTED: "dim",
}


def print_grade(console: Console, graded: Grade) -> None:
    """Print the points of every exercise and check, and what was missed."""
    console.print(
        f"[bold]{graded.lecture.number} {escape(graded.lecture.title)}[/] "
        f"[dim]{escape(graded.file)}[/]",
        soft_wrap=True,
    )
    if graded.trouble:
        say(console, f"[bold red]the file could not be loaded:[/] {escape(graded.trouble)}")
        say(console, "nothing was graded")
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    table.add_column()
    table.add_column()
    table.add_column(justify="right")
    for k, (name, results) in enumerate(graded.exercises.items(), 1):
        earned, of = sum(m.points for m in results), sum(m.of for m in results)
        table.add_row(f"[bold]{graded.lecture.number}.{k} {name}[/]", "", f"[bold]{earned}/{of}[/]")
        last: list[str] = []
        for mark in [] if graded.trouble else results:
            table.add_row(_state(mark), escape(mark.check), f"[dim]{mark.points}/{mark.of}[/]")
            lines = _lines(mark)
            if lines:  # once, if all checks meet with the same
                again = "[dim]not checked: see above[/]"
                table.add_row("", again if lines == last else "\n".join(lines))
            last = lines
        if printed := graded.printed.get(name):
            table.add_row("[dim]  printed[/]", f"[dim]{escape(printed)}[/]")
    console.print(table, highlight=False)
    console.print(f"[bold]{graded.points} of {counted(graded.of, 'point')}[/]\n", highlight=False)


def _state(mark: CheckResult) -> str:
    return f"  [{STATE_COLOUR[mark.state]}]{mark.state.value}[/]"


def _lines(mark: CheckResult) -> list[str]:
    lines = []
    for title, text in mark.explanations:
        lead = f"{title:10}" if title else ""
        style = "yellow" if title == "perhaps" else "dim"
        lines.append(f"[{style}]{lead}[/]" + escape(text).replace("\n", "\n" + " " * len(lead)))
    return lines
