"""The order in which blocks fill a flat vector."""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks.block import Block
from workbench.blocks.checks import mapping, reals, several
from workbench.errors import (
    BadArgument,
    BadBlock,
    MissingValue,
    NonFiniteValue,
    ShapeMismatch,
    UnknownName,
    check_known,
)

# Of each block, by its name: its numbers, in its unit and of its shape.
Values = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Layout:
    """Blocks one after another in one vector, each row by row: (N, 3) is x0 y0 z0 x1 y1 z1 ...

    Values are always those of whole blocks.

    Attributes:
        blocks: the blocks in order. Where only some entries of a block stand in the vector, this
            is the part (`Block.part`).
    """

    blocks: tuple[Block, ...]

    def __post_init__(self) -> None:
        self.__dict__["blocks"] = several("the blocks of a layout", self.blocks, Block, BadBlock)

    @property
    def names(self) -> tuple[str, ...]:
        """The blocks' names, in order."""
        return tuple(block.name for block in self.blocks)

    @cached_property
    def size(self) -> int:
        """The length of the flat vector."""
        return int(self._edges[-1])

    @cached_property
    def _edges(self) -> Index:
        return np.cumsum([0, *(block.size for block in self.blocks)])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """The places of each block in the flat vector."""
        return {
            b.name: slice(int(i), int(j))
            for b, (i, j) in zip(self.blocks, pairwise(self._edges), strict=True)
        }

    @cached_property
    def single_labels(self) -> dict[str, int]:
        """The place of each label that names exactly one entry, such as `pose[12, head, x]`."""
        places: dict[str, int] = {}
        ambiguous: set[str] = set()
        for i in range(self.size):
            label = self.label(i)
            ambiguous |= {label} if label in places else set()
            places[label] = i
            while ", " in label:
                label = label.rpartition(", ")[0]
                ambiguous.add(label + "]")
        return {label: i for label, i in places.items() if label not in ambiguous}

    def __getitem__(self, name: str) -> Block:
        for block in self.blocks:
            if block.name == name:
                return block
        raise UnknownName("block", name, self.names)

    def pack(self, values: Mapping[str, ArrayLike]) -> Array:
        """The named arrays as one vector (size,), after a check of every name, shape and number.

        Raises MissingValue, NotNumbers, ShapeMismatch, NonFiniteValue, or BadArgument if `values`
        is no dict.
        """
        mapping("values of blocks", values)
        flat = np.empty(self.size)
        for block in self.blocks:
            if block.name not in values:
                raise MissingValue(block.name, block.shape, values)
            value = reals(f"block {block.name!r}", values[block.name])
            part, block = block, block.base
            # a bare symbol cannot tell (3,) from (1, 3) or () from (1,): the same numbers
            if [n for n in value.shape if n != 1] != [n for n in block.shape if n != 1]:
                raise ShapeMismatch(block.name, expected=block.shape, got=value.shape)
            if not np.isfinite(value).all():
                bad = ~np.isfinite(value.ravel())
                raise NonFiniteValue(block.name, block.where(bad), float(value.ravel()[bad][0]))
            own = value if part.entries is None else part.taken(value)
            flat[self.slices[block.name]] = own.ravel()
        return flat

    def unpack(self, flat: Array, around: Mapping[str, ArrayLike] | None = None) -> Values:
        """The named arrays from a flat vector, the inverse of `pack`; they share one copy of it.

        If the layout has only part of a block, its other entries come from `around`, which holds
        the whole block. Raises MissingValue if it has none.
        """
        flat, values = np.array(flat, dtype=float), {}
        for block in self.blocks:
            numbers = flat[self.slices[block.name]]
            if block.whole is None:
                values[block.name] = numbers.reshape(block.shape)
                continue
            if around is None or block.name not in around:
                raise MissingValue(block.name, block.whole.shape, around or ())
            value = np.array(around[block.name], dtype=float).reshape(block.whole.shape)
            value.reshape(-1)[list(block.places)] = numbers
            values[block.name] = value
        return values

    @cached_property
    def parts(self) -> tuple[Block, ...]:
        """The blocks of which only some entries are in the vector."""
        return tuple(block for block in self.blocks if block.whole is not None)

    def spelled(self, without: Iterable[str] = ()) -> tuple[str, ...]:
        """Names that mean exactly these numbers, leaving out the blocks `without`."""
        omitted = set(without)
        return tuple(
            name for block in self.blocks if block.name not in omitted for name in _names(block)
        )

    def chosen(self, places: Iterable[int]) -> "Layout":
        """A layout of the numbers in some places only, in the order of the blocks."""
        entries: dict[str, list[int]] = {}
        for place in places:
            block, i = self.block_of(int(place))
            entries.setdefault(block.name, []).append(block.places[i])
        blocks = []
        for block in self.blocks:
            own = entries.get(block.name, [])
            if own:
                whole = len(set(own)) == block.base.size
                blocks.append(block.base if whole else Block.part(block.base, own))
        return Layout(tuple(blocks))

    def pieces(self, flat: cs.MX) -> list[cs.MX]:
        """A symbolic vector (size, 1) cut into one matrix per block, axes reversed."""
        parts = cs.vertsplit(flat, self._edges.tolist()) if self.blocks else []
        return [
            cs.reshape(part, *b.symbol_shape) for part, b in zip(parts, self.blocks, strict=True)
        ]

    def block_of(self, index: int) -> tuple[Block, int]:
        """The block that entry `index` of the vector belongs to, and the entry's place in it."""
        if not 0 <= index < self.size:
            raise IndexError(f"entry {index} of a vector of {self.size}")
        i = int(np.searchsorted(self._edges, index, side="right")) - 1
        return self.blocks[i], index - int(self._edges[i])

    def place(self, name: str, entry: int) -> int | None:
        """The place of a block's entry in the flat vector; None if it is not in it."""
        if name not in self.slices:
            return None
        if name in self._places_in_parts:
            return self._places_in_parts[name].get(entry)
        return int(self.slices[name].start) + entry

    @cached_property
    def _places_in_parts(self) -> dict[str, dict[int, int]]:
        """The place of each entry of the blocks of which only some entries are in the vector."""
        first = {name: part.start for name, part in self.slices.items()}
        return {b.name: {e: first[b.name] + i for i, e in enumerate(b.places)} for b in self.parts}

    def label(self, index: int) -> str:
        """The name of one entry of the vector: `pose[right_ankle, z]`."""
        block, entry = self.block_of(index)
        return block.name + block.entry(entry)

    def labels_of(self, places: Iterable[int]) -> list[str]:
        """The names of several entries of the vector."""
        return [self.label(int(place)) for place in places]

    def unit(self, index: int) -> str:
        """The unit of one entry of the vector."""
        return self.block_of(index)[0].unit


def all_values(free: Layout, x: Array, fixed: Layout, fixed_numbers: Array) -> Values:
    """The values of all blocks, from the free numbers x and the fixed ones.

    A block that is free in part is in both layouts; the fixed layout has the whole block.
    """
    around = fixed.unpack(fixed_numbers)
    return around | free.unpack(x, around)


def _names(block: Block) -> list[str]:
    if block.whole is None:
        return [block.name]
    if len(block.shape) == 2 and block.labels is not None:
        return [f"{block.name}[{label}]" for label in block.labels]
    return [block.name + block.entry(i) for i in range(block.size)]


ROWS = re.compile(r"(\d+)|(\d*):(\d*)")  # a number, or a run of them


def entries(layout: Layout, names: str | Iterable[str], kind: str = "free block") -> Index:
    """The places of the named entries in the flat vector of a layout, rising.

    Raises UnknownName, which lists what exists, or BadArgument if nothing is named.
    """
    places: set[int] = set()
    for name in (names,) if isinstance(names, str) else names:
        places |= set(places_named(layout, name, kind))
    if not places:
        raise BadArgument(
            f"no free number is named; name blocks ({', '.join(layout.names)}) or entries such as "
            f"{layout.label(0) if layout.size else 'betas[0]'}"
        )
    return np.array(sorted(places), dtype=np.int64)


def block_of(name: str, known: Collection[str]) -> str:
    """The name of the block in the name of an entry: `pose` for `pose[head, x]`."""
    if name in known:
        return name
    candidates = [block for block in known if name.startswith(f"{block}[")]
    return max(candidates, key=len) if candidates else name.partition("[")[0]


def places_named(layout: Layout, name: str, kind: str = "free block") -> list[int]:
    """The places in the flat vector of the entries that one name means. Raises UnknownName."""
    block = block_of(name, layout.names)
    check_known(kind, block, layout.names)
    part = layout.slices[block]
    if block == name:
        return list(range(part.start, part.stop))
    if name in layout.single_labels:
        return [layout.single_labels[name]]
    labels = {i: layout.label(i) for i in range(part.start, part.stop)}
    row = name.removesuffix("]")
    places = [i for i, label in labels.items() if label == name or label.startswith(row + ", ")]
    if not places and name.endswith("]"):
        places = _by_number(layout, block, row[len(block) + 1 :], labels)
    if not places:
        known = dict.fromkeys(
            label.rsplit(", ", 1)[0].removesuffix("]") for label in labels.values()
        )
        raise UnknownName("entry", name, [f"{label}]" for label in known])
    return places


def _by_number(layout: Layout, name: str, numbers: str, labels: dict[int, str]) -> list[int]:
    """Entries whose rows are numbers of the whole block's: `0:3`, `4`, `4, x`."""
    rows, _, last = numbers.partition(", ")
    matched = ROWS.fullmatch(rows)
    block = layout[name]
    if matched is None or not block.base.shape:
        return []
    single, first, stop = matched.groups()
    count = block.base.shape[0]
    chosen = slice(int(first or 0), int(stop or count))
    if single:
        chosen = slice(int(single), int(single) + 1)
    if chosen.stop > count:
        return []  # more rows than there are: an entry that does not exist
    width = block.base.size // count if count else 1
    start = layout.slices[name].start

    def is_named(label: str) -> bool:
        if not block.base.framed:
            return label.endswith(f", {last}]")
        within = label.removesuffix("]").partition(", ")[2] + ", "
        return within.startswith(f"{last}, ")

    return [
        start + i
        for i, entry in enumerate(block.places)
        if chosen.start <= entry // width < chosen.stop
        and (not last or is_named(labels[start + i]))
    ]


ALIKE = 1e-6  # entries of a direction that differ by less count as equal
ROUNDING = 1e-12  # of the largest: less is none
MOST_ENTRIES = 6  # of a direction in words; of the others their number and their size
MOST_BLOCKS = 3  # of which the others are counted one by one
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
    most: int = MOST_ENTRIES,
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
    others = {name: rest[(rest >= p.start) & (rest < p.stop)] for name, p in free.slices.items()}
    counted = sorted((name for name in others if others[name].size), key=lambda n: -others[n].size)
    for name in counted[:MOST_BLOCKS]:
        own, unit = others[name], free[name].unit
        parts.append(f"{own.size} more of {name} (up to {_number(abs(v[own]).max(), unit)})")
    if uncounted := counted[MOST_BLOCKS:]:
        count = sum(others[name].size for name in uncounted)
        blocks = "other block" if len(uncounted) == 1 else "other blocks"
        parts.append(f"{count} more of {len(uncounted)} {blocks}")
    return " with ".join([parts[0], ", ".join(parts[1:])]) if parts[1:] else parts[0]


def _number(value: float, unit: str, sign: str = "") -> str:
    return f"{value:{sign}.3g}" + ("" if unit == "1" else f" {unit}")
