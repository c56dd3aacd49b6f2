"""What a training reports while it runs."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from workbench.errors import WorkbenchError

ROUNDING = 1e-9  # of the cost: what a block may add by rounding


class NotLowered(WorkbenchError):
    """A block of training raised the cost, or did not solve what it claims to solve."""


@dataclass(frozen=True)
class LogEntry:
    """One block that has run.

    Attributes:
        block: its name in `BLOCKS`.
        before: the costs by term when it began.
        after: the costs by term when it ended.
        facts: what the block says about itself, such as how many products it took.
        seconds: how long it took.
    """

    block: str
    before: dict[str, float]
    after: dict[str, float]
    facts: dict[str, float]
    seconds: float

    def check_lowered(self) -> None:
        """Raise NotLowered if the block raised the cost by more than rounding does."""
        was, total = sum(self.before.values()), sum(self.after.values())
        if not total <= was + ROUNDING * (1 + was):
            raise NotLowered(f"block {self.block!r} raised the cost from {was:.9g} to {total:.9g}")


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a training is when a block has ended.

    Attributes:
        number: the number of this block, from 1.
        of: how many blocks the plan has.
        entry: what the block did.
        seconds_left: an estimate of the time until the last block ends.
    """

    number: int
    of: int
    entry: LogEntry
    seconds_left: float

    @staticmethod
    def since(began: float, already: int, number: int, of: int, entry: LogEntry) -> "Progress":
        """Where a run is that began after `already` blocks, `began` by `time.perf_counter`."""
        each = (time.perf_counter() - began) / (number - already)
        return Progress(number, of, entry, each * (of - number))


class Report(Protocol):
    """Follows the progress of a training."""

    def block(self, progress: Progress) -> None:
        """Called when a block has ended."""

    def part(self, doing: str, done: int, of: int) -> None:
        """Called within something long, when `done` of `of` parts are finished."""


class Silent:
    """A report that shows nothing."""

    def block(self, progress: Progress) -> None:
        """Take the end of a block, and show nothing of it."""

    def part(self, doing: str, done: int, of: int) -> None:
        """Take how far something long has come, and show nothing of it."""


SILENT = Silent()


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
