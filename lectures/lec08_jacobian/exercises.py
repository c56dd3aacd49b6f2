"""Exercises of lecture 8, the Jacobian.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Then

    workbench lecture check 8 lec08_jacobian.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def rank(J: Array) -> int:
    """How many independent directions of x the residual notices, given its Jacobian.

    That is the number of singular values that are not zero. Rounding leaves small numbers in place
    of zeros, and these must not count. All of J may be given in another unit, that is, times
    any number, so that no fixed limit will do.

    J (m, n) -> a whole number
    """
    raise Unsolved("rank")


def null_space(J: Array) -> Array:
    """An orthonormal basis of the directions that no residual notices: p with J p = 0.

    J may have more rows than columns, or fewer. What is zero but for rounding counts as zero, as
    in `rank`.

    J (m, n), of rank r -> (n, n - r), a direction in each column
    """
    raise Unsolved("null_space")


def depends(parents: list[int]) -> Array:
    """The pattern of a tree of joints: entry [i, k] is 1 if joint i moves when joint k turns, else 0.

    parents[k] is the joint that k hangs on, which comes before k in the list; it is -1 for the
    root. Joint k turns about its own place, so that it does not move itself.

    parents (K,) -> (K, K) of 0 and 1
    """
    raise Unsolved("depends")


def rank_of_tree(parents: list[int]) -> int:
    """The rank of all joints by all rotations, from the tree alone; the root stays in its place.

    No bone has length 0, and bones that meet in a joint do not lie on one line.

    parents (K,) -> a whole number
    """
    raise Unsolved("rank_of_tree")


def sigmas(J: Array) -> Array:
    """How well each unknown is known, to first order, from whitened residuals (one sigma each).

    Infinite for an unknown that takes part in a direction that no residual notices: for one whose
    row in an orthonormal basis of the null space, as columns, is longer than 1e-8. (That is far above
    rounding, and far below what matters.)

    J (m, n) -> (n,), standard deviations
    """
    raise Unsolved("sigmas")


def markers() -> list[int]:
    """Vertices of the body `small`, at most 24 of 369, that together with its 24 joints tell all.

    That is: joints and these vertices, as functions of the 72 numbers of the pose, have rank 72 at
    random poses. Which vertices, and how you find them, is up to you: look where the twists are,
    or let the computer try. (32 directions are left, and a vertex tells at most 3, so that at
    least 11 are needed.)

    `import workbench as wb` and `body = wb.load_body("small")` have what you need: body.joints(pose)
    (24, 3) m and body.vertices(pose) (369, 3) m for a pose (24, 3) rad, vertices numbered 0 to 368;
    body.weights (369, 24) says on which joints each of them hangs. For derivatives, the numeric
    Jacobian of lecture 6 will do: answer with flat arrays, so 72 numbers to 72 + 1107. It is off by
    some 1e-10, and `rank` of 8.1, whose tolerance is that of rounding, would count that as seen:
    count the singular values above 1e-6 instead. Those of what is seen are far above it.

    -> a list of whole numbers
    """
    raise Unsolved("markers")
