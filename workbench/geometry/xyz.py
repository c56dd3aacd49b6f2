"""Text with a point in each line: x y z, perhaps a normal nx ny nz, and whatever else follows."""

from collections.abc import Iterator
from itertools import chain, islice

import numpy as np

from workbench.arrays import Array
from workbench.errors import cut, shown
from workbench.geometry.polygons import text_lines

MOST_HEAD = 20  # lines before the first point: titles of columns, or how many points there are
MOST_COLUMNS = 6  # that are read; what follows, colours and intensities, is left in the file
COMMENTS = ("#", "//")
SEPARATORS = (",", ";")  # otherwise blanks


def parse_xyz(content: bytes) -> tuple[Array, int]:
    """The first columns (N, 3) to (N, 6) of all lines, and how many columns the first line has.

    Lines before the first point that hold no three numbers are passed over, at most 20. Raises
    ValueError with what is wrong.
    """
    lines = (line for line in text_lines(content) if line.strip())
    head = list(islice(lines, MOST_HEAD + 1))
    start = next((i for i, line in enumerate(head) if len(_numbers(line)) >= 3), None)
    if start is None:
        first = shown(head[0].strip()) if head else "nothing"
        raise ValueError(f"its first lines hold no x, y and z; the first is {first}")
    columns = len(_numbers(head[start]))
    separator = _separator(head[start])
    total = len(_words(head[start]))
    try:
        numbers = np.loadtxt(
            _rows(chain(head[start:], lines)),
            delimiter=separator,
            usecols=range(min(columns, MOST_COLUMNS)),
            ndmin=2,
            comments=None,
        )
    except ValueError as error:
        raise ValueError(f"after line {start + 1}: {cut(error)}") from error
    return np.asarray(numbers, dtype=np.float64), total


def _rows(lines: Iterator[str]) -> Iterator[str]:
    return (line for line in lines if not line.lstrip().startswith(COMMENTS))


def _separator(line: str) -> str | None:
    return next((one for one in SEPARATORS if one in line), None)


def _words(line: str) -> list[str]:
    words = line.split(_separator(line))
    return words if words and words[-1].strip() else words[:-1]


def _numbers(line: str) -> list[float]:
    """The numbers with which a line begins; nothing if it is a comment."""
    found: list[float] = []
    for word in _words(line):
        try:
            found.append(float(word))
        except ValueError:
            break
    return found
