"""A direction among named numbers, in words and in units: `+1 s of t0 with +2 m of x0`."""

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks.layout import Layout

ALIKE = 1e-6  # entries of a direction that differ by less count as equal
ROUNDING = 1e-12  # of the largest: less is none
LISTED = 6  # entries that are said one by one; of the others their number and their size
BLOCKS = 3  # of which the others are counted one by one
OUTWEIGHS = 10.0  # times the entry of the largest effect, in scales: such an entry leads


def signed(v: Array) -> Array:
    """The vector scaled to length 1, the first of its largest entries positive."""
    v = v / np.linalg.norm(v)
    return np.asarray(v * np.sign(v[np.argmax(abs(v) > (1 - ALIKE) * abs(v).max())]))


def leading(v: Array, effects: Array | None = None, scales: Array | None = None) -> Index:
    """The places of the entries that are more than rounding, the one that matters most first.

    `effects` (n,) says by how much one unit of each unknown changes the residuals, |J_i|; an entry
    matters by |J_i v_i|, so that no unit counts. Without them, and among entries that change
    nothing, it matters by its size. An entry that the residuals hardly depend on leads if it is far
    larger than that of the largest effect, both in their characteristic `scales` (n,).
    """
    size = abs(v) if effects is None else abs(v) * effects
    size = size if size.any() else abs(v)
    rank = np.round(size / (size.max() * ALIKE))  # so that rounding does not shuffle equals
    moves = (size > ROUNDING * size.max()) | (abs(v) > ROUNDING * abs(v).max())
    if scales is not None:
        scaled = abs(v) / scales
        if scaled.max() >= OUTWEIGHS * scaled[np.argmax(rank)]:
            large = OUTWEIGHS * scaled >= scaled.max()
            rank = np.where(large, rank.max() + scaled / scaled.max(), rank)
    order = np.argsort(-rank, kind="stable")
    return np.asarray(order[moves[order]], dtype=np.int64)


def in_units(
    v: Array,
    free: Layout,
    effects: Array | None = None,
    most: int = LISTED,
    scales: Array | None = None,
) -> str:
    """A direction (n,) as a whole, in the units of its entries, the leading one being 1.

    Of more than `most` entries the others are counted by block, with the largest of each:
    `+1 px of focal with -0.004 m of points[3, z], 35 more of points (up to 0.0025 m)`.
    """
    order = leading(v, effects, scales)
    v = v / v[order[0]]
    shown, rest = order[:most], order[most:]
    parts = [f"{_number(v[i], free.unit(int(i)), '+')} of {free.label(int(i))}" for i in shown]
    others = {name: rest[(rest >= at.start) & (rest < at.stop)] for name, at in free.slices.items()}
    counted = sorted((name for name in others if others[name].size), key=lambda n: -others[n].size)
    for name in counted[:BLOCKS]:
        own, unit = others[name], free[name].unit
        parts.append(f"{own.size} more of {name} (up to {_number(abs(v[own]).max(), unit)})")
    if left := counted[BLOCKS:]:
        count = sum(others[name].size for name in left)
        parts.append(f"{count} more of {len(left)} other block{'s'[: len(left) > 1]}")
    return " with ".join([parts[0], ", ".join(parts[1:])]) if parts[1:] else parts[0]


def _number(value: float, unit: str, sign: str = "") -> str:
    return f"{value:{sign}.3g}" + ("" if unit == "1" else f" {unit}")
