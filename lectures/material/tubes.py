"""A tube on two bones, the simplest limb, for which the effect of skinning has closed formulas.

It lies along x, its root at one end and its joint in the middle. The weight w of the second bone
goes from 0 to 1 over a zone around the joint, in a straight line. Bent or twisted there by an
angle a, linear blending multiplies by c = 1 - w + w exp(i a), which is shorter than 1:

    |c|^2 = 1 - 4 w (1 - w) sin^2(a / 2)

With l the length of the zone and A the area of a cross-section, the tube loses the volume

    bent     A l sin^2(a / 2) / 3
    twisted  A l sin^2(a / 2) 2 / 3

(the integral of the map's determinant; w (1 - w) integrates to l / 6). Dual quaternion blending
turns every ring rigidly, and loses none.
"""

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody


def tube(
    *,
    half_length: float = 0.3,
    radius: float = 0.05,
    zone: float = 0.1,
    rings: int = 61,
    around: int = 32,
) -> SkinnedBody:
    """A closed tube of `rings` rings of `around` vertices and two lids; lengths in m.

    `joint_names` are root and joint; it has one beta, the radius in units of 10 %. Raises BadBody
    for fewer than 3 rings or an even number (one must be at the joint), or a zone that does not
    fit.
    """
    if rings < 3 or rings % 2 == 0 or around < 3:
        raise BadBody(
            f"a tube needs an odd number of rings, 3 at least, one being at the joint, and 3 "
            f"vertices around; not {rings} and {around}"
        )
    if not 0 < zone <= 2 * half_length:
        raise BadBody(f"a zone of {zone} m does not fit into a tube of {2 * half_length} m")
    s = np.linspace(-half_length, half_length, rings)
    angle = 2 * np.pi * np.arange(around) / around
    circle = radius * np.column_stack([np.zeros(around), np.cos(angle), np.sin(angle)])
    skin = (s[:, None, None] * [1.0, 0.0, 0.0] + circle).reshape(-1, 3)
    template = np.vstack([skin, [[-half_length, 0, 0], [half_length, 0, 0]]])
    share = np.clip(0.5 + template[:, 0] / zone, 0, 1)
    wider = 0.1 * template * [0.0, 1.0, 1.0]
    regressor = np.zeros((2, len(template)))
    regressor[0, :around] = 1 / around
    middle = rings // 2 * around
    regressor[1, middle : middle + around] = 1 / around
    return SkinnedBody(
        template=template,
        shapedirs=wider[:, :, None],
        posedirs=np.zeros((len(template), 3, 9)),
        J_regressor=csr_array(regressor),
        weights=np.column_stack([1 - share, share]),
        parents=(-1, 0),
        faces=_faces(rings, around),
        joint_names=("root", "joint"),
        name="tube",
    )


def linear_radius(weight: Array | float, angle: Array | float) -> Array:
    """|c|, the share of the radius that linear blending leaves at a twist by `angle` rad."""
    w = np.asarray(weight)
    return np.asarray(np.sqrt(1 - 4 * w * (1 - w) * np.sin(np.asarray(angle) / 2) ** 2))


def volume_lost_bent(area: float, zone: float, angle: Array | float) -> Array:
    """The volume, m^3, that linear blending loses of a bent tube of cross-section `area`, m^2."""
    return area * zone * np.sin(np.asarray(angle) / 2) ** 2 / 3


def volume_lost_twisted(area: float, zone: float, angle: Array | float) -> Array:
    """The volume that linear blending loses of a twisted tube: twice that of a bent one."""
    return 2 * volume_lost_bent(area, zone, angle)


def _faces(rings: int, around: int) -> Index:
    ring, j = np.divmod(np.arange((rings - 1) * around), around)
    a, b = ring * around + j, ring * around + (j + 1) % around
    c, d = a + around, b + around
    side = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    first, last = rings * around, rings * around + 1
    j = np.arange(around)
    after = (j + 1) % around
    end = (rings - 1) * around
    near = np.column_stack([np.full(around, first), after, j])
    far = np.column_stack([np.full(around, last), end + j, end + after])
    return np.concatenate([side, near, far])
