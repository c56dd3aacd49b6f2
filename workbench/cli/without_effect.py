"""What is said of an option that was given and changes nothing."""

from rich.console import Console
from rich.markup import escape


def changes_nothing(console: Console, option: str, because: str) -> None:
    """Say so in a sentence; the command goes on as if the option had not been given."""
    console.print(
        f"[bold yellow]{option} changes nothing:[/] {escape(because)}",
        highlight=False, soft_wrap=True,
    )  # fmt: skip
