"""A gauge in words: what moves, and what undoes that."""

import re
from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.similarities import similarity
from workbench.diagnostics.things import in_space, row_label, things
from workbench.errors import some_of

MOVES = 1e-6  # of the largest entry: less is not named
ROUNDING = 1e-15  # of the largest entry: less is none
LISTED = 3  # things that move, or that undo it, by name


def named_gauge(
    kind: str,
    said: str,
    v: Array,
    free: Layout,
    main: Sequence[Block],
    own: Index | None = None,
    same: tuple[Array, Array] | None = None,
    least: float = MOVES,
) -> NamedSubspace:
    """`a rotation about x of points, undone by cam0, cam1 and cam2`.

    `own` are the places in the block that move, and `same` tells which others move likewise. What
    moves by `least` of the largest number or less is not named.
    """
    whole, v = v, np.where(abs(v) > least * abs(v).max(), v, 0.0)
    alike = [b.name for b in main]
    if own is not None and len(own) < main[0].size:
        alike[0] = rows_of(main[0], own - free.slices[main[0].name].start)
    blocks = [b for b in free.blocks if b not in main and v[free.slices[b.name]].any()]
    if same is not None:
        x, coefficients = same
        d = main[0].shape[-1]
        for block in [b for b in blocks if in_space(b) and b.shape[-1] == d]:
            at = free.slices[block.name]
            like = similarity(x[at].reshape(-1, d)) @ coefficients
            if np.allclose(like, whole[at], rtol=10 * least, atol=least * abs(v).max()):
                alike.append(block.name)
                blocks.remove(block)
    return single_gauge(kind, f"{said} of {listed(alike)}{back_by(free, blocks)}", whole)


def back_by(free: Layout, blocks: Sequence[Block]) -> str:
    """`, undone by cam0, cam1 and cam2`; empty for no blocks."""
    back = things([b.name for b in free.blocks], [b.name for b in blocks])
    return f", undone by {listed(back)}" if back else ""


def listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `cam0_turn to cam4_turn`, or `a, b, c and 2 more`."""
    numbered: dict[str, list[str]] = {}
    for name in names:
        numbered.setdefault(re.sub(r"\d+", "#", name), []).append(name)
    short = [
        one
        for alike in numbered.values()
        for one in ([f"{alike[0]} to {alike[-1]}"] if len(alike) > 2 else alike)
    ]
    return " and ".join(short) if len(short) < 3 else some_of(short, LISTED)


def rows_of(block: Block, entries: Index) -> str:
    """Some rows of a block, by their entries: `points[4]`, `5 rows of points (0, 1, 2, ...)`."""
    wide = block.shape[-1] if in_space(block) else 1
    rows = np.unique(entries // wide)
    if rows.size == 1:
        return f"{block.name}[{row_label(block, int(rows[0]), wide)}]"
    first = ", ".join(row_label(block, int(row), wide) for row in rows[:3])
    return f"{rows.size} rows of {block.name} ({first}{', ...' if rows.size > 3 else ''})"


def single_gauge(kind: str, name: str, v: Array) -> NamedSubspace:
    """A motion v (n,) under its name."""
    entries = np.flatnonzero(abs(v) > ROUNDING * abs(v).max())
    return NamedSubspace(kind, name, (), entries, (v / np.linalg.norm(v))[entries, None])
