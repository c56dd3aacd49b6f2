"""Some vertices of a body that stand for all of them in a fit: enough for each joint."""

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.body import Body

LEAST = 20  # vertices of each joint, or all that it has: six numbers place a rigid part


def sampled_vertices(body: Body, count: int) -> Index:
    """About `count` vertices, in order, evenly over those that follow each joint most.

    Those that follow one joint are taken at equal steps in the order of the mesh; each joint has
    its share of all vertices, but `LEAST` of them or all that it has.
    """
    N, owner = body.n_vertices, body.vertex_weights.argmax(axis=1)
    chosen: list[int] = []
    for k in range(body.n_joints):
        own = np.flatnonzero(owner == k)
        many = min(len(own), max(LEAST, round(count * len(own) / N)))
        if many:
            chosen += own[np.linspace(0, len(own) - 1, many).round().astype(int)].tolist()
    return np.array(sorted(chosen), dtype=np.int64)


def counted(body: Body, chosen: Index) -> Array:
    """How many of all vertices each chosen one stands for, (n,), divided by their mean."""
    owner = body.vertex_weights.argmax(axis=1)
    of_all = np.bincount(owner, minlength=body.n_joints)
    of_chosen = np.bincount(owner[chosen], minlength=body.n_joints)
    found = of_all[owner[chosen]] / of_chosen[owner[chosen]]
    return np.asarray(found / found.mean())
