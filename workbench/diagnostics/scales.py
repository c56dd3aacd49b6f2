"""Characteristic scales: how large a change of an unknown matters, whatever its unit.

1. the scale that the caller says, `diagnose(..., scales={"radius": 7e6})`;
2. a radian for an angle, one standard deviation for a coefficient of shape, and a metre for a
   length, whatever multiple of these is the block's unit (deg, mm, ...). A metre serves where the
   problem is about as large as a person: with points of a body, or if the root mean square of all
   its lengths is between 0.1 and 10 m. In others, such as an orbit, a length is compared with the
   size of its block, or with that root mean square if the block is zero;
3. the standard deviation that the priors give it, where there is one;
4. the size of its block at this point, the root mean square of its entries;
5. a block that is zero with the size of all values in its unit, and if these are zero too, or
   if it has no unit, with 1, as the words of the scale say.

One size serves all entries of a block. Suggested priors are as wide as the scales.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout
from workbench.blocks.checks import mapping, reals
from workbench.errors import BadArgument, UnknownName, joined

METRES = {"m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "km": 1e3}
NATURAL = {  # how many of the unit make one scale, and its name
    "rad": (1.0, "a radian"),
    "deg": (180 / np.pi, "a radian"),
    "sd": (1.0, "a standard deviation of shape"),
}
NO_LENGTH = 1e-12  # metres, less than any atom: such lengths are zeros that were computed
LIKE_PEOPLE = (0.1, 10.0)  # metres: sizes of problems in which lengths are compared with a metre


@dataclass(frozen=True, eq=False)
class Scales:
    """A characteristic scale for each free entry, in the entry's unit, and in words by block.

    Attributes:
        sizes: (n,) the scale of each entry, above zero.
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


def scales(
    free: Layout,
    read: Iterable[Block],
    at: Mapping[str, ArrayLike],
    prior_sigma: Array,
    chosen: Mapping[str, ArrayLike],
    *,
    of_people: bool = False,
) -> Scales:
    """The scales of the entries of `free` here; `read` are all blocks that have values.

    `prior_sigma` (n,) is infinite where the priors say nothing, `chosen` are the scales by block
    that a caller says, and `of_people` says that there are points of bodies.
    """
    sizes, words, read = np.ones(free.size), {}, list(read)
    metres = _root_mean_square(
        [METRES[b.unit] * np.asarray(at[b.name]) for b in read if b.unit in METRES]
    )
    with_metre = of_people or metres < NO_LENGTH or LIKE_PEOPLE[0] <= metres <= LIKE_PEOPLE[1]
    for block in free.blocks:
        part, unit = free.slices[block.name], block.unit
        if block.name in chosen:
            whole = np.broadcast_to(chosen[block.name], block.base.shape)
            sizes[part] = block.taken(whole).ravel()
            few = [f"{size:.4g}" for size in np.unique(sizes[part])[:4]]
            span = few[0] if len(few) == 1 else f"{few[0]} to {sizes[part].max():.4g}"
            words[block.name] = f"{span}{'' if unit == '1' else f' {unit}'}, as given"
        elif unit in NATURAL:
            sizes[part], words[block.name] = NATURAL[unit]
        elif unit in METRES and with_metre:
            sizes[part], words[block.name] = 1 / METRES[unit], "a metre"
        else:
            size, words[block.name] = _size(block, read, at, metres)
            prior = prior_sigma[part]
            known = np.isfinite(prior)
            sizes[part] = np.where(known, prior, size)
            if known.any():
                rest = "" if known.all() else f", or {words[block.name]}, where it has no prior"
                words[block.name] = f"the standard deviation of its prior{rest}"
    return Scales(sizes, words)


def checked(chosen: Mapping[str, ArrayLike] | None, free: Layout) -> dict[str, Array]:
    """Scales that a caller says, by block; raises UnknownName and BadArgument."""
    by_block = {}
    for name, value in mapping("scales", chosen or {}).items():
        if name not in free.slices:
            raise UnknownName("free block", name, free.names)
        size, shape = reals(f"the scale of {name!r}", value), free[name].base.shape
        if not np.isfinite(size).all() or not (size > 0).all() or size.shape not in ((), shape):
            raise BadArgument(
                f"the scale of {name!r} must be above zero and finite, with shape () or {shape}"
            )
        by_block[name] = size
    return by_block


def _size(
    block: Block, read: Iterable[Block], at: Mapping[str, ArrayLike], metres: float
) -> tuple[float, str]:
    if size := _root_mean_square([at[block.name]]):
        return size, f"{with_unit(size, block.unit)}, its size here"
    if block.unit in METRES:
        size = metres / METRES[block.unit]
        return size, f"{with_unit(size, block.unit)}, the size of all lengths"
    if block.unit != "1":
        alike = [at[other.name] for other in read if other.unit == block.unit]
        if size := _root_mean_square(alike):
            return size, f"{with_unit(size, block.unit)}, the size of all values in its unit"
    return 1.0, f"{with_unit(1.0, block.unit)}, since it is zero here and has no prior"


def _root_mean_square(values: Iterable[ArrayLike]) -> float:
    flat = np.concatenate([np.zeros(0), *(np.ravel(np.asarray(v, dtype=float)) for v in values)])
    return float(np.sqrt(np.mean(flat**2))) if flat.size else 0.0


def with_unit(size: float, unit: str) -> str:
    """A number with its unit, which the number 1 as a unit is not."""
    return f"{size:.4g}" if unit == "1" else f"{size:.4g} {unit}"
