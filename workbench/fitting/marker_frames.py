"""Which frames of a recording determine a person's shape and the places of markers.

A choice is a function from markers (T, M, 3) m and a number of frames to the chosen frames. The
frames of one recording are alike, and those that are alike say the same twice.
"""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array, Index
from workbench.geometry.rigid import procrustes

Choice = Callable[[Array, int], Index]


def spread_frames(markers: Array, count: int) -> Index:
    """The frames that differ most, as far apart as a greedy search finds them, in order.

    The first is that which shows most markers. Each next one is the frame whose distance to the
    nearest of those chosen is largest (Gonzalez 1985); a distance is the root mean square of
    markers that both show, after a rigid motion, times the share of markers that the frame shows.
    """
    known = np.isfinite(markers).all(axis=2)
    chosen = [int(np.argmax(known.sum(axis=1)))]
    apart = np.full(len(markers), np.inf)
    share = known.mean(axis=1)
    while len(chosen) < min(count, len(markers)):
        last = chosen[-1]
        apart = np.minimum(apart, [_distance(markers[last], own) for own in markers])
        apart[last] = -1.0
        chosen.append(int(np.argmax(apart * share)))
    return np.array(sorted(chosen), dtype=np.int64)


def random_frames(seed: int) -> Choice:
    """A choice of frames at random, by a generator with this seed."""

    def choose(markers: Array, count: int) -> Index:
        rng = np.random.default_rng(seed)
        return np.sort(rng.choice(len(markers), min(count, len(markers)), replace=False))

    return choose


def _distance(one: Array, other: Array) -> float:
    """The root mean square distance of markers (M, 3) m that both show, after a rigid motion."""
    both = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    if both.sum() < 3:
        return 0.0
    motion = procrustes(one[both], other[both])
    moved = motion(one[both])
    return float(np.sqrt(np.mean(np.sum((moved - other[both]) ** 2, axis=1))))
