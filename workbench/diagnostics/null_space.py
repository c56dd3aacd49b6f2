"""The directions that no residual notices, each with the smallest set of entries it needs.

Singular vectors of a null space are an arbitrary basis of it: one joint's twist comes out
smeared over the whole body. So the null space is taken apart by support: first the single
entries that can change alone, then joints, then a joint and its child together, then whole
blocks; only what is left is given as it comes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workbench.blocks import Layout, Tree

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Direction:
    """A unit vector (n,) of free numbers, and how much the whitened residual changes along it."""

    name: str
    kind: str  # entry, twist, joint, block or mixed
    joints: tuple[str, ...]  # that it turns, as far as it is known
    vector: Array = field(repr=False)
    change: float  # |J d|


@dataclass(frozen=True)
class _Support:
    """A few entries that may make up a null direction by themselves."""

    kind: str
    name: str
    joints: tuple[str, ...]
    entries: tuple[int, ...]


def null_basis(J: Array, tolerance: float) -> Array:
    """(n, d) orthonormal: what J maps below `tolerance` times the length."""
    n = J.shape[1]
    if not n:
        return np.zeros((0, 0))
    R = scipy.linalg.qr(J, mode="r")[0][:n] if len(J) > n else J
    _, s, Vt = np.linalg.svd(R, full_matrices=True)
    return np.asarray(Vt[int(np.sum(s > tolerance)) :].T)


def null_directions(
    J: Array, free: Layout, trees: Sequence[Tree], tolerance: float
) -> tuple[Direction, ...]:
    """A basis of the null space of J (m, n), smallest supports first, each vector of length 1."""
    total = null_basis(J, tolerance).shape[1]
    found: list[Direction] = []
    known = np.zeros((J.shape[1], 0))  # orthonormal basis of what was found
    for support in _supports(free, trees):
        if len(found) == total:
            break
        entries = list(support.entries)
        local = null_basis(J[:, entries], tolerance)
        if not local.shape[1]:
            continue
        vectors = np.zeros((J.shape[1], local.shape[1]))
        vectors[entries] = local
        fresh, new = _beyond(known, vectors)
        for v in new.T:
            found.append(_direction(support, v, J, free))
        known = np.column_stack([known, fresh])
    if len(found) < total:
        whole = _Support("mixed", "", (), tuple(range(J.shape[1])))
        rest, _ = _beyond(known, null_basis(J, tolerance))
        found += [_direction(whole, v, J, free) for v in rest.T[: total - len(found)]]
    return tuple(found)


def _beyond(known: Array, vectors: Array) -> tuple[Array, Array]:
    """An orthonormal basis of what `vectors` span beyond `known`, and the combinations of
    `vectors` (so within their support) that lead furthest there.
    """
    rest = vectors - known @ (known.T @ vectors)
    rest -= known @ (known.T @ rest)
    U, s, Vt = np.linalg.svd(rest, full_matrices=False)
    return U[:, s > 1e-6], np.asarray(vectors @ Vt[s > 1e-6].T)


def _supports(free: Layout, trees: Sequence[Tree]) -> Iterator[_Support]:
    for i in range(free.size):
        yield _Support("entry", free.label(i), _joints_of(free, trees, i), (i,))
    moving = [tree for tree in trees if tree.pose in free.names]
    for tree in moving:
        for k, name in enumerate(tree.names):
            where = f"of {tree.pose}[{name}]"
            yield _Support("twist", f"a turn {where} alone", (name,), _joint(free, tree, k))
    for tree in moving:
        for k, parent in enumerate(tree.parents[1:], start=1):
            names = tree.names[parent], tree.names[k]
            entries = _joint(free, tree, parent) + _joint(free, tree, k)
            name = f"a turn of {tree.pose}[{names[0]}], undone at {names[1]}"
            yield _Support("twist", name, names, entries)
    for name, part in free.slices.items():
        if part.stop - part.start > 1:
            yield _Support("block", f"within {name}", (), tuple(range(part.start, part.stop)))


def _joint(free: Layout, tree: Tree, k: int) -> tuple[int, ...]:
    start = free.slices[tree.pose].start + 3 * k
    return tuple(range(start, start + 3))


def _joints_of(free: Layout, trees: Sequence[Tree], i: int) -> tuple[str, ...]:
    block, entry = free.block_of(i)
    return tuple(tree.names[entry // 3] for tree in trees if tree.pose == block.name)


def _direction(support: _Support, v: Array, J: Array, free: Layout) -> Direction:
    v = v / np.linalg.norm(v)
    v = v * np.sign(v[np.argmax(abs(v))])
    name = support.name
    if support.kind in ("block", "mixed"):
        name = f"{name + ': ' if name else ''}{dominant(v, free)}"
    return Direction(name, support.kind, support.joints, v, float(np.linalg.norm(J @ v)))


def dominant(v: Array, free: Layout, most: int = 4) -> str:
    """The largest entries of a direction: `0.71 betas[3] - 0.70 trans[z] + ...`."""
    order = [int(i) for i in np.argsort(-abs(v)) if abs(v[i]) > 0.05 * abs(v).max()]
    terms = [f"{'-' if v[i] < 0 else '+'} {abs(v[i]):.2f} {free.label(i)}" for i in order[:most]]
    return " ".join(terms).removeprefix("+ ") + (" + ..." if len(order) > most else "")
