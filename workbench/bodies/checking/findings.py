"""One sentence about a model file, and the words in which numbers are told."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Mask


@dataclass(frozen=True)
class FileFinding:
    """A sentence about a model file: what is there, what follows from it, and what to do.

    Attributes:
        part: the key of the file, or what the finding is about.
        text: the sentence.
        warning: True if the model would compute something wrong, False if it is only worth knowing.
    """

    part: str
    text: str
    warning: bool = True


def row_name(names: Sequence[str], k: int) -> str:
    """A joint by its number and its name: `joint 4 (left_knee)`."""
    return f"joint {k} ({names[k]})" if k < len(names) else f"joint {k}"


def of_all(wrong: Mask, what: str) -> str:
    """How many there are of all: `3 of 778 vertices`."""
    return f"{np.count_nonzero(wrong):,} of {wrong.size:,} {what}"


def counted(n: int, one: str, many: str) -> str:
    """`1 face is`, `7 faces are`: a number and the words that go with it."""
    return f"1 {one}" if n == 1 else f"{n:,} {many}"
