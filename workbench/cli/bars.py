"""The progress of work that has many parts."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


class Bars:
    """Progress: bars where somebody watches, a line for each tenth elsewhere.

    Attributes:
        last: what is going on, and how much of it is done, for a sentence.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._tasks: dict[str, int] = {}
        self._tenths: dict[str, int] = {}
        self.last = "starting"

    def __enter__(self) -> "Bars":
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._bars.stop()

    def __call__(self, what: str, done: int, of: int) -> None:
        """Show that `done` of `of` parts are finished."""
        self.last = f"{what} ({done} of {of} done)"
        if self._console.is_terminal:
            if what not in self._tasks:
                self._tasks[what] = self._bars.add_task(what, total=of)
            self._bars.update(self._tasks[what], completed=done)  # type: ignore[arg-type]
        elif self._tenths.get(what) != 10 * done // max(1, of):
            self._tenths[what] = 10 * done // max(1, of)
            self._console.print(f"{what}: {done} of {of}", highlight=False)
