"""Entries of blocks by name: whole blocks, rows, runs of rows, single numbers.

betas              a block
pose[left_elbow]   a row, by its label or its number
betas[0:3]         rows one after the other, from the first to the one before the last
pose[pelvis, x]    one number

In a sequence the frame comes first: pose[12], pose[0:50], pose[:, pelvis], pose[12, pelvis, x].
"""

import re
from collections.abc import Collection, Iterable

import numpy as np

from workbench.arrays import Index
from workbench.blocks.block import Block
from workbench.blocks.layout import Layout
from workbench.errors import BadArgument, UnknownName, check_known

ROWS = re.compile(r"(\d+)|(\d*):(\d*)")  # a number, or a run of them


def entries(layout: Layout, names: str | Iterable[str], kind: str = "free block") -> Index:
    """The places of the named entries in the flat vector of a layout, rising.

    Raises UnknownName, which lists what exists, or BadArgument if nothing is named.
    """
    found: set[int] = set()
    for name in (names,) if isinstance(names, str) else names:
        found |= set(places_named(layout, name, kind))
    if not found:
        raise BadArgument(
            f"no free number is named; name blocks ({', '.join(layout.names)}) or entries such as "
            f"{layout.label(0) if layout.size else 'betas[0]'}"
        )
    return np.array(sorted(found), dtype=np.int64)


def block_of(name: str, known: Collection[str]) -> str:
    """The name of the block in the name of an entry: `pose` for `pose[head, x]`."""
    if name in known:
        return name
    begun = [block for block in known if name.startswith(f"{block}[")]
    return max(begun, key=len) if begun else name.partition("[")[0]


def places_named(layout: Layout, name: str, kind: str = "free block") -> list[int]:
    """The places in the flat vector of the entries that one name means. Raises UnknownName."""
    block = block_of(name, layout.names)
    check_known(kind, block, layout.names)
    at = layout.slices[block]
    if block == name:
        return list(range(at.start, at.stop))
    if name in layout.single_labels:
        return [layout.single_labels[name]]
    labels = {i: layout.label(i) for i in range(at.start, at.stop)}
    row = name.removesuffix("]")
    found = [i for i, label in labels.items() if label == name or label.startswith(row + ", ")]
    if not found and name.endswith("]"):
        found = _by_number(layout, block, row[len(block) + 1 :], labels)
    if not found:
        known = list(dict.fromkeys(label.rsplit(", ", 1)[0] for label in labels.values()))
        some = [label if label.endswith("]") else label + "]" for label in known]
        own, more = _of_one_frame(layout[block], some)
        raise UnknownName("entry", name, own, more=more)
    return found


def _of_one_frame(block: Block, known: list[str]) -> tuple[list[str], str]:
    """The names in one frame of a sequence, and that the others have them too."""
    if not block.base.framed:
        return known, ""
    first = known[0].removesuffix("]").partition(", ")[0]
    own = [name for name in known if name.startswith((f"{first},", f"{first}]"))]
    return own, f"and the same in the others of {block.base.shape[0]} frames"


def _by_number(layout: Layout, name: str, numbers: str, labels: dict[int, str]) -> list[int]:
    """Entries whose rows are numbers of the whole block's: `0:3`, `4`, `4, x`."""
    rows, _, last = numbers.partition(", ")
    matched = ROWS.fullmatch(rows)
    block = layout[name]
    if matched is None or not block.base.shape:
        return []
    one, first, end = matched.groups()
    count = block.base.shape[0]
    chosen = slice(int(one), int(one) + 1) if one else slice(int(first or 0), int(end or count))
    if chosen.stop > count:
        return []  # more rows than there are: an entry that does not exist
    wide = block.base.size // count if count else 1
    start = layout.slices[name].start

    def is_named(label: str) -> bool:
        if not block.base.framed:
            return label.endswith(f", {last}]")
        within = label.removesuffix("]").partition(", ")[2] + ", "
        return within.startswith(f"{last}, ")

    return [
        start + i
        for i, entry in enumerate(block.places)
        if chosen.start <= entry // wide < chosen.stop and (not last or is_named(labels[start + i]))
    ]
