"""How large a change of an unknown matters, so that "hardly noticed" does not depend on units.

A sigma of 5 says nothing by itself. It is compared with a yardstick, so that no judgement depends
on the unit that a block is measured in:

1. an angle is compared with a radian, a length with a metre and a coefficient of shape with one
   standard deviation, whatever multiple of these is the block's unit (deg, mm, ...);
2. any other unknown with the standard deviation that the priors give it, where there is one;
3. otherwise with the size of its block at this point, the root mean square of its entries:
   a focal length of 1000 px with 1000 px;
4. a block that is zero with the size of all values in its unit, and if these are zero too, or
   if it has no unit, with 1, as the words of the yardstick say.

A block has one unit, so one size serves all of its entries; parameters of different sizes belong
into blocks of their own.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout
from workbench.errors import joined

NATURAL = {  # how many of the unit make one yardstick, and its name
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
    """A yardstick for each entry of the free vector, in the entry's unit, and in words by block.

    Attributes:
        sizes: (n,) the yardstick of each entry, above zero.
        words: by block, such as `a radian` or `1000 px, its size here`.
    """

    sizes: Array
    words: Mapping[str, str]

    def __str__(self) -> str:
        """`for pose: a radian; for focal: 1000 px, its size here`."""
        blocks: dict[str, list[str]] = {}
        for block, words in self.words.items():
            blocks.setdefault(words, []).append(block)
        return "; ".join(f"for {joined(names)}: {words}" for words, names in blocks.items())


def yardsticks(
    free: Layout, read: Iterable[Block], at: Mapping[str, ArrayLike], prior_sigma: Array
) -> Yardsticks:
    """The yardsticks of the entries of `free` here; `read` are all blocks that have values.

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
        known = np.isfinite(prior)
        sizes[part] = np.where(known, prior, size)
        if known.any():
            rest = "" if known.all() else f", or {words[block.name]}, where it has no prior"
            words[block.name] = f"the standard deviation of its prior{rest}"
    return Yardsticks(sizes, words)


def _size(block: Block, read: Iterable[Block], at: Mapping[str, ArrayLike]) -> tuple[float, str]:
    size = _root_mean_square([at[block.name]])
    if size:
        return size, f"{with_unit(size, block.unit)}, its size here"
    if block.unit != "1":
        alike = [at[other.name] for other in read if other.unit == block.unit]
        if size := _root_mean_square(alike):
            return size, f"{with_unit(size, block.unit)}, the size of all values in its unit"
    return 1.0, f"{with_unit(1.0, block.unit)}, since it is zero here and has no prior"


def _root_mean_square(values: list[ArrayLike]) -> float:
    flat = np.concatenate([np.ravel(np.asarray(value, dtype=float)) for value in values])
    return float(np.sqrt(np.mean(flat**2))) if flat.size else 0.0


def with_unit(size: float, unit: str) -> str:
    """A number with its unit, which the number 1 as a unit is not."""
    return f"{size:.4g}" if unit == "1" else f"{size:.4g} {unit}"
