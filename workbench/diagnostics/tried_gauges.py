"""Gauges that are tried out: at a point far along the motion the residuals are the same.

At points nearby nothing undoes these motions, or not in the same combination, so that a motion of
finite length has to tell a gauge from a coincidence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.number_gauges import blocks_whole, combinations_of, named_combination
from workbench.diagnostics.things import LENGTHS
from workbench.diagnostics.undoing import (
    SAME,
    Found,
    Unseen,
    at_the_point,
    only,
    places,
    places_of,
    undone,
)
from workbench.problem import Problem

STEEPEST = 4.0  # powers of a factor that are tried


def size_gauges(
    problem: Problem, values: Values, unseen: Unseen, units: Array
) -> Iterator[NamedSubspace]:
    """A factor of points whose origin is not the camera: s (p + trans) + t, seen in proportion.

    At twice the factor the residuals are the same with trans + t / (2 s), where t / s is how fast
    trans undoes a relative change of s. This is tried out, for a number without a unit need not be
    a factor.
    """
    free, x = problem.free, unseen.x
    fixed = problem.split(values)[1]
    others = places(free, [b for b in free.blocks if b.size == 3 and b.unit in LENGTHS[1:]])
    for block in [b for b in free.blocks if b.size == 1 and b.unit == "1"]:
        at = places_of(free, block)
        if not others.size or not x[at[0]]:
            continue
        for v, _ in undone(only(at, free.size, lambda s: s[:, None]), others, at_the_point(unseen)):
            if not v[at[0]]:
                continue
            v = v * (x[at[0]] / v[at[0]])
            twice = x + v * np.where(np.arange(free.size) == at[0], 1.0, 0.5)
            if _alike(problem, fixed, x * units, twice * units):
                yield named_gauge("scale", "a scale", v, free, [block], least=unseen.same)


def homogeneous_gauges(
    problem: Problem,
    values: Values,
    blocks: Sequence[Block],
    islands: Sequence[Index],
    unseen: Unseen,
    found: Found,
    units: Array,
) -> Iterator[NamedSubspace]:
    """A factor of blocks in equations that are zero, and stay so: x'F x = 0 holds for any F / s.

    Elsewhere the factor scales what is left of the equations.
    """
    free, x = problem.free, unseen.x
    fixed = problem.split(values)[1]
    groups = [g for g in blocks_whole(free, blocks, islands) if g.factor]
    for one in combinations_of(groups, at_the_point(unseen), found, units):
        least = min(abs(c) for _, c in one.parts)
        powers = np.zeros(len(x))
        for group, c in one.parts:
            powers[group.places] = c / least
        if abs(powers).max() > STEEPEST:
            continue
        if _alike(problem, fixed, x * units, x * 2.0**powers * units):
            for motion in named_combination(free, one, unseen):
                yield replace(motion, name=f"{motion.name}, for what it scales is zero")


def _alike(problem: Problem, fixed: Array, x: Array, y: Array) -> bool:
    """Whether the residuals are the same at two points of the free numbers."""
    before, after = problem.residual(x, fixed), problem.residual(y, fixed)
    return bool(np.linalg.norm(after - before) <= SAME * (1.0 + float(np.linalg.norm(before))))
