"""What is said while something takes seconds and has no progress to show."""

from contextlib import AbstractContextManager, nullcontext

from rich.console import Console

from workbench.environment import in_browser


def waiting(text: str) -> AbstractContextManager[object]:
    """Show a line on stderr as long as the context lasts; in a browser, where no thread could move
    it, it is printed.
    """
    console = Console(stderr=True)
    if in_browser():
        console.print(text, style="dim")
        return nullcontext()
    return console.status(text)
