"""What a user would call one thing: a camera of several blocks, or a row of points."""

from collections.abc import Sequence

from workbench.blocks import Block

LENGTHS = ("1", "m", "dm", "cm", "mm", "um", "km")


def in_space(block: Block) -> bool:
    """Whether the rows of a block may be points in two or three dimensions."""
    return len(block.shape) > 0 and block.shape[-1] in (2, 3) and block.unit in LENGTHS


def stem(name: str) -> str:
    """`cam0` of `cam0_turn` and of `cam0/turn`; empty where there is none."""
    cut = max(name.rfind(mark) for mark in "/_.")
    return name[:cut] if cut > 0 else ""


def families(names: Sequence[str]) -> dict[str, list[str]]:
    """The names of blocks by their stem, where several have the same one."""
    found: dict[str, list[str]] = {}
    for name in names:
        if stem(name):
            found.setdefault(stem(name), []).append(name)
    return {one: members for one, members in found.items() if len(members) > 1}


def things(names: Sequence[str], some: Sequence[str]) -> list[str]:
    """Some of the blocks, those of one family by their stem if the family is whole."""
    whole = {n: one for one, ns in families(names).items() if set(ns) <= set(some) for n in ns}
    return list(dict.fromkeys(whole.get(name, name) for name in some))


def row_label(block: Block, row: int, wide: int) -> str:
    """The name of a row of `wide` entries of a block: `left_hand`, or `3`."""
    entry = block.entry(row * wide)[1:-1]
    return entry.rpartition(", ")[0] if wide > 1 else entry
