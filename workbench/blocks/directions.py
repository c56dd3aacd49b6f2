"""A direction among named numbers, in words."""

import numpy as np

from workbench.arrays import Array
from workbench.blocks.layout import Layout

ALIKE = 1e-6  # entries of a direction that differ by less count as equal


def signed(v: Array) -> Array:
    """The vector scaled to length 1, the first of its largest entries positive."""
    v = v / np.linalg.norm(v)
    return np.asarray(v * np.sign(v[np.argmax(abs(v) > (1 - ALIKE) * abs(v).max())]))


def dominant(v: Array, free: Layout, most: int = 4) -> str:
    """The largest entries of a direction: `0.71 betas[3] - 0.70 trans[z] + ...`."""
    size = np.round(abs(v) / abs(v).max() / ALIKE)  # so that rounding does not shuffle equals
    order = [int(i) for i in np.argsort(-size, kind="stable") if size[i] * ALIKE > 0.05]
    terms = [f"{'-' if v[i] < 0 else '+'} {abs(v[i]):.2f} {free.label(i)}" for i in order[:most]]
    return " ".join(terms).removeprefix("+ ") + (" + ..." if len(order) > most else "")
