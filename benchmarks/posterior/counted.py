"""Intervals that hold a truth, counted; and how many there should be."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.stats

from benchmarks.posterior.held_out import LEVEL
from workbench.arrays import Array

Found = Mapping[str, Any]
UNLIKELY = 1e-3  # over all entries together


def held(found: Found, way: str, all_of: bool = False) -> Array:
    """In how many cases each entry is covered (16,), of those that are usable."""
    rows = [
        (np.array(case[way]["ends"][0]) < case["truth"])
        & (case["truth"] < np.array(case[way]["ends"][1]))
        for case in found["cases"]
        if all_of or case[way]["usable"]
    ]
    return np.sum(rows, axis=0)


def number(found: Found, way: str) -> int:
    """Of cases that are usable."""
    return sum(case[way]["usable"] for case in found["cases"])


def scores(found: Found, way: str) -> Array:
    """(truth - mean) / sd, (cases, 16)."""
    return np.array(
        [
            (np.array(case["truth"]) - case[way]["mean"]) / np.array(case[way]["sd"])
            for case in found["cases"]
        ]
    )


def band(count: int, entries: int) -> tuple[int, int]:
    """Between which counts all entries lie together, but for a chance of one in a thousand."""
    tail = UNLIKELY / entries / 2
    low, high = scipy.stats.binom(count, LEVEL).ppf([tail, 1 - tail])
    return int(low), int(high)
