"""Which free numbers are meant: blocks, rows of blocks, single entries, by name."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Layout, Tree
from workbench.errors import BadArgument, UnknownName

Indices = NDArray[np.int64]


def entries(layout: Layout, names: str | Iterable[str]) -> Indices:
    """Places in the flat vector, rising: `betas`, `pose[left_elbow]`, `pose[left_elbow, x]`.

    Raises UnknownName, or BadArgument if nothing is named.
    """
    found: set[int] = set()
    for name in (names,) if isinstance(names, str) else names:
        found |= set(_meant(layout, name))
    if not found:
        raise BadArgument(
            f"no free number is named; name blocks ({', '.join(layout.names)}) or entries such as "
            f"{layout.label(0) if layout.size else 'betas[0]'}"
        )
    return np.array(sorted(found), dtype=np.int64)


def _meant(layout: Layout, name: str) -> list[int]:
    if name in layout.names:
        at = layout.slices[name]
        return list(range(at.start, at.stop))
    block = name.partition("[")[0]
    if block not in layout.names:
        raise UnknownName("free block", block, layout.names)
    at = layout.slices[block]
    labels = {i: layout.label(i) for i in range(at.start, at.stop)}
    row = name.removesuffix("]")
    meant = [i for i, label in labels.items() if label == name or label.startswith(row + ", ")]
    if not meant:
        known = list(dict.fromkeys(label.rsplit(", ", 1)[0] for label in labels.values()))
        some = [label if label.endswith("]") else label + "]" for label in known]
        raise UnknownName("entry", name, some)
    return meant


def blocks_of(layout: Layout, trees: Iterable[Tree], most: int = 21) -> dict[str, tuple[str, ...]]:
    """Parts of the unknowns small enough to be sampled each by itself, by what they are.

    All of them, if they are few; else `shape and place` (all that is no pose, and the root's
    rotation) and the limbs: joints in a row between two that branch.
    """
    if layout.size <= most:
        return {"all": layout.names}
    parts: dict[str, tuple[str, ...]] = {}
    trees = tuple(trees)
    poses = {tree.pose for tree in trees if tree.pose in layout.names}
    others = [b.name for b in layout.blocks if b.name not in poses and b.size <= most]
    roots = [f"{tree.pose}[{tree.names[0]}]" for tree in trees if tree.pose in poses]
    chosen: list[str] = []
    for name in (*others, *roots):
        if sum(len(_meant(layout, n)) for n in (*chosen, name)) <= most:
            chosen.append(name)
    if chosen:
        parts["shape and place" if poses else "the small blocks"] = tuple(chosen)
    for tree in trees:
        if tree.pose in poses:
            for limb in limbs(tree):
                names = [tree.names[k] for k in limb][: most // 3]
                parts[f"{names[0]} to {names[-1]}" if len(names) > 1 else names[0]] = tuple(
                    f"{tree.pose}[{name}]" for name in names
                )
    return parts


def limbs(tree: Tree) -> list[list[int]]:
    """Joints in a row, each the only child of the one before; the root is in none."""
    rows: list[list[int]] = []
    for k, parent in enumerate(tree.parents):
        if parent < 0:
            continue
        if parent > 0 and len(tree.children(parent)) == 1:
            next(row for row in rows if row[-1] == parent).append(k)
        else:
            rows.append([k])
    return rows
