"""Unknowns in parts that are small enough to be sampled each by itself."""

from collections.abc import Iterable

from workbench.blocks import Layout, Tree
from workbench.blocks.layout import places_named


def sampling_blocks(
    layout: Layout, trees: Iterable[Tree], most: int = 21
) -> dict[str, tuple[str, ...]]:
    """Parts of the unknowns by name, each small enough to be sampled.

    If there are few unknowns, all of them are one part. Otherwise the parts are `shape and place`,
    with everything but the pose, and with the root's rotation, and the limbs, which are chains of
    joints between two branchings.
    """
    if layout.size <= most:
        return {"all": layout.names}
    parts: dict[str, tuple[str, ...]] = {}
    trees = tuple(trees)
    poses = {name for tree in trees for name in tree.blocks if name in layout.names}
    others = [b.name for b in layout.blocks if b.name not in poses and b.size <= most]
    roots = [name for tree in trees for name in _of_joint(layout, tree, 0)]
    chosen: list[str] = []
    for name in (*others, *roots):
        if sum(len(places_named(layout, n)) for n in (*chosen, name)) <= most:
            chosen.append(name)
    if chosen:
        parts["shape and place" if poses else "the small blocks"] = tuple(chosen)
    for tree in trees:
        for limb in limbs(tree):
            joints = [k for k in limb if tree.entries(k, layout)][: most // 3]
            if joints:
                names = [tree.names[k] for k in joints]
                parts[f"{names[0]} to {names[-1]}" if len(names) > 1 else names[0]] = tuple(
                    name for k in joints for name in _of_joint(layout, tree, k)
                )
    return parts


def _of_joint(layout: Layout, tree: Tree, joint: int) -> list[str]:
    """The names of a joint's free numbers: of their row, or one by one."""
    at = tree.entries(joint, layout)
    labels = layout.labels_of(at)
    rows = {label.rpartition(", ")[0] for label in labels}
    return [f"{rows.pop()}]"] if len(at) == 3 and len(rows) == 1 and "" not in rows else labels


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
