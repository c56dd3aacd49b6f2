"""How large a change of an unknown is one that matters: what `hardly noticed` is relative to.

A sigma of 5 says nothing by itself. It is held against a yardstick, so that no judgement depends
on the unit that a block is measured in:

1. an angle against a radian, a length against a metre and a coefficient of shape against one
   standard deviation, whatever multiple of these is the block's unit (deg, mm, ...);
2. any other unknown against the standard deviation that the priors give it, where there is one;
3. otherwise against the size of its block at this point, the root mean square of its entries:
   a focal length of 1000 px against 1000 px;
4. a block that is zero against the size of all values in its unit, and if these are zero too, or
   if it has no unit, against 1, which is said.

A block has one unit, so one size serves all of its entries; parameters of different sizes belong
into blocks of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout

NATURAL = {  # how many of the unit are one of what is said
    "rad": (1.0, "a radian"),
    "deg": (180 / np.pi, "a radian"),
    "sd": (1.0, "a standard deviation of shape"),
    "m": (1.0, "a metre"),
    "dm": (1e1, "a metre"),
    "cm": (1e2, "a metre"),
    "mm": (1e3, "a metre"),
    "um": (1e6, "a metre"),
    "km": (1e-3, "a metre"),
}


@dataclass(frozen=True, eq=False)
class Yardsticks:
    """One per entry of the free vector, in the entry's unit, and in words by block.

    Attributes:
        sizes: (n,) the yardstick of each entry, above zero.
        words: by block, such as `a radian` or `1000 px (its size here)`.
    """

    sizes: Array
    words: Mapping[str, str]

    def __str__(self) -> str:
        """`a radian for pose; 1000 px (its size here) for focal`."""
        said: dict[str, list[str]] = {}
        for block, words in self.words.items():
            said.setdefault(words, []).append(block)
        return "; ".join(f"{words} for {' and '.join(names)}" for words, names in said.items())


def yardsticks(
    free: Layout, read: Layout, at: Mapping[str, ArrayLike], prior_sigma: Array
) -> Yardsticks:
    """The yardsticks of the entries of `free` here; `read` are all blocks, free and fixed.

    `prior_sigma` (n,) is infinite where the priors say nothing.
    """
    sizes, words = np.ones(free.size), {}
    for block in free.blocks:
        part = free.slices[block.name]
        if block.unit in NATURAL:
            sizes[part], words[block.name] = NATURAL[block.unit]
            continue
        size, words[block.name] = _size(block, read, at)
        prior = prior_sigma[part]
        told = np.isfinite(prior)
        sizes[part] = np.where(told, prior, size)
        if told.any():
            rest = "" if told.all() else f" (without one {words[block.name]})"
            words[block.name] = f"the standard deviation of its prior{rest}"
    return Yardsticks(sizes, words)


def _size(block: Block, read: Layout, at: Mapping[str, ArrayLike]) -> tuple[float, str]:
    size = _root_mean_square([at[block.name]])
    if size:
        return size, f"{_with_unit(size, block.unit)} (its size here)"
    if block.unit != "1":
        alike = [at[other.name] for other in read.blocks if other.unit == block.unit]
        if size := _root_mean_square(alike):
            return size, f"{_with_unit(size, block.unit)} (the size of all in its unit)"
    return 1.0, f"{_with_unit(1.0, block.unit)} (it is zero here and has no prior)"


def _root_mean_square(values: list[ArrayLike]) -> float:
    flat = np.concatenate([np.ravel(np.asarray(value, dtype=float)) for value in values])
    return float(np.sqrt(np.mean(flat**2))) if flat.size else 0.0


def _with_unit(size: float, unit: str) -> str:
    return f"{size:.4g}" if unit == "1" else f"{size:.4g} {unit}"
