"""Where to begin the fit of a body to a scan without labels, and which way a body faces."""

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.forward.posing import local_rotations, world_rotations
from workbench.bodies.spaces import has_pose_space, pose_space
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_gaussian
from workbench.fitting.hands import mean_hand
from workbench.fitting.placing import moved
from workbench.fitting.scans.scan import BadScan, Scan
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.priors.poses import shipped_mixture


def facing(root: Array, bind: Array) -> Array:
    """The horizontal unit vector (3,) along which a body faces whose root is turned by `root`
    (3,) rad, and which faces +z in the bind pose, where the root is turned by `bind` (3,) rad.

    A body that lies on its back or its front faces up or down: that vector is returned then.
    """
    forward = (matrix_from_vector(root) @ matrix_from_vector(bind).T)[:, 2]
    level = forward * [1.0, 0.0, 1.0]
    length = float(np.linalg.norm(level))
    return np.asarray(level / length if length > 0 else forward)


YAWS = 8
ARMS = (1.3, 0.7, 0.1)  # rad below the horizontal: hanging down, half raised, and spread
WHOLE_HEIGHT = 0.6  # times the height of the body: a scan that is higher is of all of it
STRAY_SHARE = 0.01  # of the points may lie below the feet, and as many above the head
LARGEST_SIZE, SMALLEST_SIZE = 5.0, 0.1  # times the height of the body: of a scan of a person
FEWEST_POINTS = 20  # points


def scan_starts(
    body: Body, scan: Scan, *, yaws: int = YAWS, arms: tuple[float, ...] = ARMS
) -> tuple[Values, ...]:
    """Values of pose, betas and trans for each of `yaws` facings and each pose of the arms.

    y is up. The facings are evenly distributed about the vertical; `arms` are in rad below the
    horizontal, and everything else of the pose is the bind pose. Seen from above, the medians of
    the scan and of the body coincide, and the feet are at the first percentile of the heights, so
    that a few loose points below do not matter. A scan that is less than 0.6 times as high as the
    body shows only part of it: then the medians of the heights agree instead.

    Raises BadScan for a scan of fewer than 20 points, or one that is more than five times as large
    as the body, or less than a tenth, and BadArgument for no facings or no arms.
    """
    if yaws < 1 or not arms:
        raise BadArgument(
            f"starts need one facing and one pose of the arms or more, not {yaws} and {arms}"
        )
    check_size(body, scan)
    low, high = np.quantile(scan.points[:, 1], [STRAY_SHARE, 1 - STRAY_SHARE])
    middle = np.median(scan.points, axis=0)
    betas = np.zeros(body.n_betas)
    names = [block.name for block in body.blocks()]
    starts = []
    for angle in arms:
        lowered = arms_lowered(body, angle)
        for k in range(yaws):
            pose = lowered.copy()
            turn = matrix_from_vector([0.0, 2 * np.pi * k / yaws, 0.0])
            pose[0] = vector_from_matrix(turn @ matrix_from_vector(pose[0]))
            surface = body.vertices(pose, betas, np.zeros(3))
            trans = middle - np.median(surface, axis=0)
            if high - low > WHOLE_HEIGHT * np.ptp(surface[:, 1]):
                trans[1] = low - surface[:, 1].min()
            starts.append(dict(zip(names, (pose, betas, trans), strict=True)))
    return tuple(starts)


def arms_lowered(body: Body, angle: float) -> Array:
    """The bind pose (K, 3) rad, with straight arms that point `angle` rad below the horizontal.

    A body without joints that are called left_shoulder, left_wrist and so on keeps its bind pose.
    """
    names = list(body.joint_names)
    R = matrix_from_vector(body.bind_pose)
    world = world_rotations(R, body.parents)
    joints = body.joints()
    for side in ("left", "right"):
        if not {f"{side}_shoulder", f"{side}_wrist"} <= set(names):
            return body.bind_pose
        shoulder = names.index(f"{side}_shoulder")
        x, y, _ = joints[names.index(f"{side}_wrist")] - joints[shoulder]
        turn = np.sign(x) * (-angle - np.arctan2(y, abs(x)))
        below = [k for k in range(body.n_joints) if _descends(body.parents, k, shoulder)]
        world[below] = matrix_from_vector([0.0, 0.0, turn]) @ world[below]
    return vector_from_matrix(local_rotations(world, body.parents))


def _descends(parents: tuple[int, ...], joint: int, ancestor: int) -> bool:
    while joint > ancestor:
        joint = parents[joint]
    return joint == ancestor


def check_size(body: Body, scan: Scan) -> None:
    """Raise BadScan for a scan that cannot be of this body."""
    if scan.n_points < FEWEST_POINTS:
        raise BadScan(
            f"a body is fitted to at least {FEWEST_POINTS} points, but the scan has {scan.n_points}"
        )
    height = float(np.ptp(body.template, axis=0).max())
    quantiles = np.quantile(scan.points, [STRAY_SHARE, 1 - STRAY_SHARE], axis=0)
    size = float((quantiles[1] - quantiles[0]).max())
    if not SMALLEST_SIZE < size / height < LARGEST_SIZE:
        raise BadScan(
            f"the scan is {size:.3g} m in size, and the body {height:.3g} m; points are expected "
            "in metres, and of one person (millimetres look 1000 times too large)"
        )


def limb_poses(body: Body) -> tuple[Array, ...]:
    """Poses (K - 1, 3) rad of all joints but the root, at which limbs may begin again.

    They are the mean of `pose_prior` and, for a body with the joints of which it was learned, the
    means of the eight components of `shipped_mixture`: arms that hang, are bent, or are raised.
    """
    mean, mixture = np.reshape(pose_gaussian(body)[0], (-1, 3)), shipped_mixture()
    if tuple(body.joint_names[1:]) != tuple(mixture.joint_names):
        return (mean,)
    return mean, *mixture.means.reshape(-1, len(mean), 3)


CLOSURES = (0.0, 1.5)  # standard deviations of the first component, which closes the hand


def hand_starts(body: Body, scan: Scan) -> tuple[Values, ...]:
    """Values of pose, betas and trans for 24 ways in which a hand may be turned, and some poses.

    A hand has no side that is usually up. Centres and principal axes of hand and scan are brought
    together, by each of the 24 rotations that take a cube to itself, because the longest axis of
    one need not be that of the other. The poses are the mean one and, of a hand with a pose space,
    one that is closed.

    Raises BadScan for a scan of fewer than 20 points, or one that is more than five times as large
    as the hand, or less than a tenth.
    """
    check_size(body, scan)
    hands, (pose, betas, _) = [mean_hand(body)], (block.name for block in body.blocks())
    if has_pose_space(body):
        space = pose_space(body, 1)
        closed = [space.poses(body, np.atleast_1d(x * space.deviations)) for x in CLOSURES]
        hands = [hands[0] | {pose: poses} for poses in closed]
    middle, axes = _principal_frame(scan.points)
    starts = []
    for hand in hands:
        centre, own_axes = _principal_frame(body.vertices(hand[pose]))
        for turn in Rotation.create_group("O").as_matrix():
            R = axes @ turn @ own_axes.T
            starts.append(hand | moved(body, R, middle - R @ centre, hand[pose], hand[betas]))
    return tuple(starts)


def _principal_frame(points: Array) -> tuple[Array, Array]:
    """The centre (3,) of points (N, 3), and their principal axes as columns of a rotation."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2].T
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return middle, axes
