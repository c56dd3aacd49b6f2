"""Exercises of lecture 17, sequences.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres. This command grades the file:

    workbench lecture check 17 lec17_sequences.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def smooth_residual(x: Array, sigma: float, order: int) -> Array:
    """The residual of smoothness between frames, in units of sigma.

    Of order 1 it is x[t + 1] - x[t], of order 2 x[t + 2] - 2 x[t + 1] + x[t], for all t for which these
    frames exist: all numbers of the first difference, then those of the second, and so on.

    x (T, n), a row for each frame; sigma in the unit of x; order 1 or 2 -> ((T - order) n,)
    """
    raise Unsolved("smooth_residual")


def worth(r: Array) -> float:
    """How many independent frames have a mean that is known as well as that of these T frames.

    r[k] is the correlation, about zero, of errors that are k frames apart; r[0] is 1.

    r (T,) -> a number, which may be larger than T
    """
    raise Unsolved("worth")


def worth_of_errors(errors: Array) -> float:
    """The same from errors themselves, one series in each column, by sums over all pairs of frames.

    A series says little by itself: first sum over all series, then divide. If the errors have correlations
    r and the sums are replaced by their expectations, this is `worth(r)`.

    errors (T, S), in the unit of their sigmas -> a number, which may be larger than T
    """
    raise Unsolved("worth_of_errors")


def arrow_solve(D: Array, B: Array, C: Array, f: Array, g: Array) -> tuple[Array, Array]:
    """The solution of D[t] x[t] + B[t] s = f[t] for all frames t, and sum of B[t]' x[t] + C s = g.

    Eliminate the frames one by one; no matrix should be larger than k by k or b by b. All D are symmetric and
    positive definite, and so is the whole matrix.

    D (T, k, k); B (T, k, b); C (b, b); f (T, k); g (b,) -> x (T, k), s (b,)
    """
    raise Unsolved("arrow_solve")


def carried(rest: Array, posed: Array, marker: Array) -> Array:
    """Where a marker is that is fixed to three vertices of the skin, when these have moved.

    As in MoSh, the vertices a, b, c define a frame of axes of length 1: its origin is a, the first axis points
    from a to b, the third one is at right angles to the triangle, along (b - a) x (c - a), and the second is the
    third x the first. The marker keeps its coordinates in this frame, in metres, also if the skin stretches.

    rest, posed (3, 3) m, a row for each vertex; marker (3,) m, at rest -> (3,) m
    """
    raise Unsolved("carried")


def filled(y: Array, sigma: float, tau: float) -> Array:
    """The smoothest path through noisy measurements with gaps.

    It has the least sum of ((x[t] - y[t]) / sigma)^2, over the frames that were measured, and of
    ((x[t + 2] - 2 x[t + 1] + x[t]) / tau)^2, over all t. y is NaN where nothing was measured; at least two
    frames were measured. A film may have thousands of frames. You may use `scipy`, or `workbench`.

    y (T,) m; sigma m; tau m -> x (T,) m
    """
    raise Unsolved("filled")
