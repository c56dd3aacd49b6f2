"""How much memory a pickle may take; a file that names the same bytes again pays for them again."""

from collections.abc import Iterable
from math import prod
from typing import Any

import numpy as np

from workbench.errors import BadFile

MOST_RECORDS = 2000  # arrays, matrices and chumpy's values that are looked into; files have sixty
MOST_ENTRIES = 10_000  # of the dictionary that the file is; files have thirty
SPARE_BYTES = 2**26  # that the arrays of any file may take, however small it is
# Further bytes for each byte of the file. A number of one byte becomes a float64 of eight, so that
# arrays which share no bytes are never refused.
PER_BYTE = 8
NUMBER = 8  # bytes of a float64, which all numbers of a body become


class Allowance:
    """What may still be spent on a file of `size` bytes. Raises BadFile when it is spent."""

    def __init__(self, size: int) -> None:
        self.size, self.records = size, MOST_RECORDS
        self.bytes = SPARE_BYTES + PER_BYTE * size

    def pay_record(self) -> None:
        """For looking into one record."""
        self.records -= 1
        if self.records < 0:
            raise BadFile(
                f"it is made of more than {MOST_RECORDS:,} arrays and chumpy values, and a body of "
                "a few dozen; export it again with nothing but the arrays of the body"
            )

    def pay(self, sizes: Iterable[int], itemsize: int = NUMBER) -> None:
        """For an array of these sizes; a size of 0 counts as 1, for nothing else bounds the rest.

        Numbers count as float64, texts as what they take.
        """
        self.bytes -= prod(max(n, 1) for n in sizes) * max(itemsize, NUMBER)
        if self.bytes < 0:
            raise BadFile(
                f"its arrays would take more than {PER_BYTE} times its own {self.size:,} bytes and "
                f"{SPARE_BYTES // 2**20} MB, because they name the same bytes again and again or "
                "are much larger than what they hold; export it again with arrays of their own"
            )


def sizes_in(value: Any, what: str, most: int = 32) -> tuple[int, ...]:
    """A shape, or an order of axes: a few whole numbers of 32 bits. Raises ValueError."""
    if isinstance(value, np.ndarray) and value.size <= most:
        value = value.tolist()
    if not (isinstance(value, (tuple, list)) and len(value) <= most):
        raise ValueError(f"its {what} is no tuple of sizes")
    if not all(type(n) is int and -1 <= n < 2**31 for n in value):
        raise ValueError(f"its {what} is no tuple of sizes from 0 to {2**31 - 1:,}")
    return tuple(value)
