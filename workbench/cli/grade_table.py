"""The table of a grade: points, what was expected, and hints."""

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from workbench.cli.output import say
from workbench.course.grading import CheckResult, CheckState, Grade
from workbench.diagnostics.words import counted

COLOUR = {
    CheckState.PASSED: "green",
    CheckState.FAILED: "bold red",
    CheckState.NOT_ATTEMPTED: "dim",
}


def print_grade(console: Console, found: Grade) -> None:
    """Print the points of every exercise and check, and what was missed."""
    console.print(
        f"[bold]{found.lecture.number} {escape(found.lecture.title)}[/] "
        f"[dim]{escape(found.file)}[/]",
        soft_wrap=True,
    )
    if found.trouble:
        say(console, f"[bold red]the file could not be loaded:[/] {escape(found.trouble)}")
        say(console, "nothing was graded")
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    table.add_column()
    table.add_column()
    table.add_column(justify="right")
    for k, (name, results) in enumerate(found.exercises.items(), 1):
        reached, of = sum(m.points for m in results), sum(m.of for m in results)
        table.add_row(f"[bold]{found.lecture.number}.{k} {name}[/]", "", f"[bold]{reached}/{of}[/]")
        told: list[str] = []
        for mark in [] if found.trouble else results:
            table.add_row(_state(mark), escape(mark.check), f"[dim]{mark.points}/{mark.of}[/]")
            lines = _lines(mark)
            if lines:  # once, if all checks meet with the same
                again = "[dim]not checked: see above[/]"
                table.add_row("", again if lines == told else "\n".join(lines))
            told = lines
        if printed := found.printed.get(name):
            table.add_row("[dim]  printed[/]", f"[dim]{escape(printed)}[/]")
    console.print(table, highlight=False)
    console.print(f"[bold]{found.points} of {counted(found.of, 'point')}[/]\n", highlight=False)
    if found.note:
        say(console, found.note)


def _state(mark: CheckResult) -> str:
    return f"  [{COLOUR[mark.state]}]{mark.state.value}[/]"


def _lines(mark: CheckResult) -> list[str]:
    told = (("", mark.what), ("expected  ", mark.expected), ("returned  ", mark.came))
    lines = [
        f"[dim]{title}[/]" + escape(text).replace("\n", "\n" + " " * len(title))
        for title, text in told
        if text
    ]
    return lines + ([f"[yellow]perhaps[/]   {escape(mark.hint)}"] if mark.hint else [])
