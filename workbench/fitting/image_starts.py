"""Where fits to one image begin: several bodies that one set of keypoints may be of."""

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.mesh_start import moved
from workbench.geometry.rotation import matrix_from_vector

MOST = 8  # directions in which a body may face


def turned_about(body: Body, values: Values, count: int) -> list[Values]:
    """`count` starts: the given one first, then the same body turned about its own axis.

    The second faces the other way, for the keypoints of a person seen from the front and of one
    seen from the back differ least, and the others face between. The middle of the body's joints
    stays where it is. Raises BadArgument for fewer than 1 or more than 8 starts.
    """
    if not 1 <= count <= MOST:
        raise BadArgument(f"a fit begins at 1 to {MOST} starts, not at {count}")
    pose, betas, trans = body.blocks()
    root = matrix_from_vector(values[pose.name][0])
    joints = body.joints(values[pose.name], values[betas.name], values[trans.name])
    middle: Array = joints.mean(axis=0)
    found = [{name: values[name] for name in (pose.name, betas.name, trans.name)}]
    for k in _order(MOST)[1:count]:
        turn = root @ matrix_from_vector([0.0, 2 * np.pi * k / MOST, 0.0]) @ root.T
        whole = moved(body, turn @ root, np.zeros(3))
        start = found[0] | {pose.name: values[pose.name].copy()}
        start[pose.name][0] = whole[pose.name][0]
        there = body.joints(start[pose.name], start[betas.name], np.zeros(3)).mean(axis=0)
        found.append(start | {trans.name: middle - there})
    return found


def _order(n: int) -> list[int]:
    """0, n / 2, and then the others, those far from both first."""
    rest = sorted(set(range(n)) - {0, n // 2}, key=lambda k: abs(k % (n // 2) - n / 4))
    return [0, n // 2, *rest]
