"""What trainings of the builder share: lines on their progress, and people who are held out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Index
from workbench.errors import BadArgument
from workbench.training.execution import Progress, Report

HELD_OUT = 5  # one subject in so many is held out, and at least one


@dataclass(frozen=True)
class BlockLines(Report):
    """A report that calls a function with a line of text when a block has ended."""

    print_line: Callable[[str], object]

    def block(self, progress: Progress) -> None:
        """The block's number and name, the cost before and after it, and its seconds."""
        entry = progress.entry
        self.print_line(
            f"  {progress.number}/{progress.of} {entry.block} {sum(entry.before.values()):.6g} -> "
            f"{sum(entry.after.values()):.6g}, {entry.seconds:.0f} s"
        )


def training_and_held_out(subject: Index) -> tuple[Index, Index]:
    """The rows of registrations (J,) to train on, and those to hold out.

    The last fifth of the subjects, and at least one, is held out. Where all registrations are of
    one subject, the last fifth of them is. Raises BadArgument for fewer than two registrations.
    """
    if len(subject) < 2:
        raise BadArgument("a registration cannot be held out of fewer than two; add some")
    who, group = np.unique(subject, return_inverse=True)
    if len(who) == 1:
        group = np.arange(len(subject))
    n = int(group.max()) + 1
    held_out = group >= n - max(1, n // HELD_OUT)
    return np.flatnonzero(~held_out), np.flatnonzero(held_out)
