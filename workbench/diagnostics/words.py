"""Words of diagnoses: names of blocks, rows and entries gathered, counted things, and tables."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from workbench.arrays import Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.scales import METRES
from workbench.errors import some_of

LENGTHS = ("1", *METRES)
MOST_NAMED = 3  # things that move, or that undo it


def in_space(block: Block) -> bool:
    """Whether the rows of a block may be points in two or three dimensions."""
    return len(block.shape) > 0 and block.shape[-1] in (2, 3) and block.unit in LENGTHS


def stem(name: str) -> str:
    """`cam0` of `cam0_turn` and of `cam0/turn`; empty where there is none."""
    cut = max(name.rfind(mark) for mark in "/_.")
    return name[:cut] if cut > 0 else ""


def families(names: Sequence[str]) -> dict[str, list[str]]:
    """The names of blocks by their stem, where several have the same one."""
    by_stem: dict[str, list[str]] = {}
    for name in names:
        if stem(name):
            by_stem.setdefault(stem(name), []).append(name)
    return {common: members for common, members in by_stem.items() if len(members) > 1}


def things(names: Sequence[str], some: Sequence[str]) -> list[str]:
    """Some of the blocks, those of one family by their stem if the family is whole."""
    stems = {
        name: common
        for common, members in families(names).items()
        if set(members) <= set(some)
        for name in members
    }
    return list(dict.fromkeys(stems.get(name, name) for name in some))


def row_label(block: Block, row: int, wide: int) -> str:
    """The name of a row of `wide` entries of a block: `left_hand`, or `3`."""
    entry = block.entry(row * wide)[1:-1]
    return entry.rpartition(", ")[0] if wide > 1 else entry


def listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `cam0_turn to cam4_turn`, or `a, b, c and 2 more`."""
    numbered: dict[str, list[str]] = {}
    for name in names:
        numbered.setdefault(re.sub(r"\d+", "#", name), []).append(name)
    short = [
        name
        for alike in numbered.values()
        for name in ([f"{alike[0]} to {alike[-1]}"] if len(alike) > 2 else alike)
    ]
    return " and ".join(short) if len(short) < 3 else some_of(short, MOST_NAMED)


def rows_of(block: Block, entries: Index) -> str:
    """Some rows of a block, by their entries: `points[4]`, `5 rows of points (0, 1, 2, ...)`."""
    wide = block.shape[-1] if in_space(block) else 1
    rows = np.unique(entries // wide)
    if rows.size == 1:
        return f"{block.name}[{row_label(block, int(rows[0]), wide)}]"
    first = ", ".join(row_label(block, int(row), wide) for row in rows[:3])
    return f"{rows.size} rows of {block.name} ({first}{', ...' if rows.size > 3 else ''})"


def named_groups(layout: Layout, columns: Index) -> str:
    """Entries of a vector in few words: whole blocks by name, the entries of a row together."""
    names = []
    for name, part in layout.slices.items():
        inside = columns[(columns >= part.start) & (columns < part.stop)]
        if layout[name].whole is None and inside.size == part.stop - part.start:
            names.append(name if inside.size == 1 else f"all of {name}")
        elif inside.size:
            names.extend(gathered(layout.labels_of(inside)))
    return ", ".join(names)


def counted(number: int, noun: str) -> str:
    """A number with its noun: `1 row`, `2 rows`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def named_rows(rows: Mapping[str, slice], chosen: Index) -> str:
    """How many of the chosen rows belong to each residual, in words."""
    counts = {
        name: int(np.sum((chosen >= part.start) & (chosen < part.stop)))
        for name, part in rows.items()
    }
    return ", ".join(f"{count} of {name}" for name, count in counts.items() if count)


def gathered(entries: list[str]) -> list[str]:
    """`pose[head, x]`, `pose[head, y]` as `pose[head, x y]`."""
    rows: dict[str, list[str]] = {}
    for entry in entries:
        row, comma, last = entry.removesuffix("]").rpartition(", ")
        rows.setdefault(row + comma, []).append(last if comma else entry)
    return [row + " ".join(last) + "]" if row else ", ".join(last) for row, last in rows.items()]


def sections(parts: Iterable[tuple[str, Iterable[str]]]) -> str:
    """Titles in capitals, the lines of each indented; a section without lines is left out."""
    indented = [(title.upper(), [f"  {line}" for line in lines]) for title, lines in parts]
    return "\n\n".join("\n".join([title, *lines]) for title, lines in indented if lines)


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] | None = None
) -> list[str]:
    """Lines of a table, two spaces between its columns.

    The columns with the indices `numbers`, or else all but the first, are aligned right.
    """
    right = range(1, len(header)) if numbers is None else numbers
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    return [
        "  ".join(
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (header, *rows)
    ]
