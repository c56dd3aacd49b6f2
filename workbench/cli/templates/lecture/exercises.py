"""Exercises of lecture 0, NAME.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres. Then

    workbench lecture check lec00_NAME lec00_NAME.py
"""

import numpy as np
from numpy.typing import NDArray

from workbench.course import Unsolved

Array = NDArray[np.float64]


def influence(count: int, off: float) -> float:
    """How far the mean of `count` readings moves if one of them moves by `off`.

    count from 1 on, off m -> m
    """
    raise Unsolved("influence")


def pull(r: float, k: float) -> float:
    """The derivative by r of Huber's cost: r^2 / 2 up to |r| = k, and k |r| - k^2 / 2 beyond.

    r, k > 0, both in standard deviations -> a number
    """
    raise Unsolved("pull")


def step(x: float, readings: Array, k: float) -> float:
    """The weighted mean of readings, each with the weight pull(r, k) / r of its r = x - reading.

    Where r is 0 the weight is 1. Repeated, this step leads to Huber's estimate.

    x, readings (N,), k > 0 in the same unit -> a number in that unit
    """
    raise Unsolved("step")
