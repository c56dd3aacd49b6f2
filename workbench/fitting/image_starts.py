"""Where fits to one image begin: several bodies that one set of keypoints may be of."""

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.mesh_start import moved
from workbench.fitting.observations import BadObservation
from workbench.fitting.regressed_start import regressed_start
from workbench.fitting.regressor_files import shipped_regressor
from workbench.fitting.setup import Setup
from workbench.geometry.rotation import matrix_from_vector

MOST = 8  # directions in which a body may face


def image_starts(body: Body, placed: Setup, count: int) -> list[Values]:
    """`count` starts of a body in one image, the likeliest first.

    The first is what the regressor makes of the keypoints, the second the resting body where its
    torso was seen, which `placed` begins with; the others are the first one turned about its own
    axis. A body that the regressor does not know begins at rest. Raises BadArgument for fewer than
    1 or more than 8 starts.
    """
    if not 1 <= count <= MOST:
        raise BadArgument(f"a fit begins at 1 to {MOST} starts, not at {count}")
    at_rest = {block.name: placed.start[block.name] for block in body.blocks()}
    view = next(view for view in placed.views if not view.held_out)
    try:
        first = regressed_start(shipped_regressor(), body, view, placed.start)
    except (BadArgument, BadObservation):
        return turned_about(body, at_rest, count)
    turned = turned_about(body, first, max(1, count - 1))
    return [turned[0], at_rest, *turned[1:]][:count]


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
