"""Posed vertices as a polynomial of theta, without bones: the first thing that one might try.

A body with these features, `template` the constant term, and `unskinned` in place of skinning is
v = f(theta) with f linear, cubic or quadratic. It knows no rotations: theta and theta plus a full
turn are two poses to it, and it does not turn with its root.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.bodies.forward.features import Posture, rotation_vectors


def unskinned(points: cs.MX, motions: Sequence[cs.MX], weights: cs.MX) -> cs.MX:
    """The points (3, N) unchanged: there are no bones that move them."""
    return points


@dataclass(frozen=True)
class Powers:
    """x, x^2, ..., x^degree of every number x of theta by itself: F = 3 (K - 1) degree."""

    degree: int

    def __call__(self, at: Posture) -> cs.MX:
        """The features (F, 1), in powers of rad."""
        x = rotation_vectors(at)
        return cs.vertcat(*[x**power for power in range(1, self.degree + 1)])


def products(at: Posture) -> cs.MX:
    """x and all products x y of two numbers of theta: F = n + n (n + 1) / 2, n = 3 (K - 1)."""
    x = rotation_vectors(at)
    rows, columns = np.triu_indices(x.shape[0])
    return cs.vertcat(x, x[rows.tolist()] * x[columns.tolist()])
