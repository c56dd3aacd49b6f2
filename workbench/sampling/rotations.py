"""Rotation vectors among what is sampled, and the shortest ones of the same rotations."""

import numpy as np

from workbench.arrays import Array
from workbench.geometry import rotation
from workbench.sampling.log_density import LogDensity


def shortest_rotations(target: LogDensity, z: Array) -> Array:
    """z (k,) with rotation vectors beyond half a turn replaced by those of the same rotations.

    Rotation vectors are those of the joints of the problem's bodies. One of which only a part is
    sampled stays as it is, and so does one whose bounds forbid the shorter vector.
    """
    space, problem = target.subspace, target.problem
    if space.entries is None:
        return z
    x, sampled = space.points(z[None])[0], np.isin(np.arange(problem.free.size), space.entries)
    for row in problem.rotations:
        length = float(np.linalg.norm(x[row]))
        if length > np.pi and sampled[row].all():
            shorter = rotation.shortest(x[row])
            if ((shorter >= problem.lower[row]) & (shorter <= problem.upper[row])).all():
                x[row] = shorter
    return np.asarray(x[space.entries])
