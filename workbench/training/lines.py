"""The progress of a training as lines of text."""

from collections.abc import Callable
from dataclasses import dataclass

from workbench.training.progress import Progress


@dataclass(frozen=True)
class BlockLines:
    """A report that calls a function with a line of text when a block has ended."""

    print_line: Callable[[str], object]

    def block(self, progress: Progress) -> None:
        """The block's number and name, the cost before and after it, and its seconds."""
        entry = progress.entry
        self.print_line(
            f"  {progress.number}/{progress.of} {entry.block} {sum(entry.before.values()):.6g} -> "
            f"{sum(entry.after.values()):.6g}, {entry.seconds:.0f} s"
        )

    def part(self, doing: str, done: int, of: int) -> None:
        """Do nothing, because only whole blocks are reported."""
