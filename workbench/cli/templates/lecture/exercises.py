"""Exercises of lecture 0, NAME.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres. Then

    workbench lecture check lec00_NAME lec00_NAME.py
"""

from workbench.course import Unsolved


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
