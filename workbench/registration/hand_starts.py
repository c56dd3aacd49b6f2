"""Where to begin the fit of a hand to a scan without labels: every way it may be turned."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.pose_space import has_pose_space, pose_space
from workbench.errors import BadArgument
from workbench.fitting.hands import mean_hand, placed_hand
from workbench.fitting.scans.scan import Scan
from workbench.registration.scan_starts import check_size

CLOSED = (0.0, 1.5)  # standard deviations of the first component, which closes the hand


def hand_starts(body: Body, scan: Scan, *, closed: Sequence[float] = CLOSED) -> tuple[Values, ...]:
    """Values of pose, betas and trans for 24 ways in which a hand may be turned, and some poses.

    A hand has no side that is usually up. Centres and principal axes of hand and scan are brought
    together, by each of the 24 rotations that take a cube to itself, because the longest axis of
    one need not be that of the other. `closed` says how far the hand is closed, in standard
    deviations of the first component of its pose space; a hand without one has its mean pose only.

    Raises BadScan for a scan of fewer than 20 points, or one that is more than five times as large
    as the hand, or less than a tenth, and BadArgument for no poses.
    """
    if not closed:
        raise BadArgument("starts of a hand need at least one pose; give (0.0,) for the mean one")
    check_size(body, scan)
    mean = mean_hand(body)
    pose = body.blocks()[0].name
    hands = [mean]
    if has_pose_space(body):
        space = pose_space(body, 1)
        hands = []
        for amount in closed:
            closing = np.atleast_1d(amount * space.deviations)
            hands.append(mean | {pose: space.poses(body, closing)})
    middle, axes = _frame(scan.points)
    found = []
    for hand in hands:
        own, own_axes = _frame(body.vertices(hand[pose]))
        for turn in Rotation.create_group("O").as_matrix():
            R = axes @ turn @ own_axes.T
            found.append(placed_hand(body, hand, R, middle - R @ own))
    return tuple(found)


def _frame(points: Array) -> tuple[Array, Array]:
    """The centre (3,) of points (N, 3), and their principal axes as columns of a rotation."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2].T
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return middle, axes
