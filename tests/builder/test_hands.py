"""The builder of hands: synthetic poses, local blend shapes, collapsing; nothing is trained."""

import numpy as np
import pytest

from builder.collapsing import collapsed_part
from builder.hands.mesh import JOINT_NAMES, to_flat
from builder.hands.sets import ANGLES, HandPoses, draw_angles
from builder.hands.training import far_share, solved
from builder.ridge import RidgeSums
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument

pytestmark = pytest.mark.thorough

HAND = load_skinned("hand")
JOINTS = HAND.joints()
ENDS = HAND.landmark("tips")


def test_two_synergies_explain_what_santello_reports() -> None:
    """Over 80 % of the variance of fifteen angles, in two components."""
    angles = draw_angles(4000, np.random.default_rng(0))
    table = np.radians(np.array(list(ANGLES.values()), dtype=float))
    assert (angles >= table[:, 2]).all()
    assert (angles <= table[:, 3]).all()
    variances = np.linalg.eigvalsh(np.cov(angles.T))[::-1]
    assert 0.80 < variances[:2].sum() / variances.sum() < 0.90


def test_bent_fingers_go_to_the_palm() -> None:
    angles = np.zeros((1, 15))
    names = list(ANGLES)
    for name in ("index1_flexion", "middle1_flexion", "ring1_flexion", "pinky1_flexion"):
        angles[0, names.index(name)] = 1.0
    tips = HAND.landmark("tips", HandPoses(JOINTS, ENDS).poses(angles)[0])
    assert (tips[:4, 1] < ENDS[:4, 1] - 0.03).all()
    angles = np.zeros((1, 15))
    angles[0, names.index("thumb3_flexion")] = 0.8
    moved = HAND.landmark("tips", HandPoses(JOINTS, ENDS).poses(angles)[0])[4]
    little = JOINTS[JOINT_NAMES.index("pinky1")]
    assert np.linalg.norm(moved - little) < np.linalg.norm(ENDS[4] - little)


def test_flattening_is_undone_by_skinning() -> None:
    """The exact inverse: a curled hand at rest, posed back, is the curled hand."""
    pose = HandPoses(JOINTS, ENDS).draw(1, np.random.default_rng(3))[0]
    curled = HAND.vertices(pose)
    joints, ends = HAND.joints(pose), HAND.landmark("tips", pose)
    rest, _ = to_flat(curled, joints, ends, HAND.weights)
    R = rest.rotations.transpose(0, 2, 1)  # back to the curled hand
    blended = np.einsum("nk,kij->nij", HAND.weights, R)
    shifts = joints - (R @ rest.joints[..., None])[..., 0]
    again = (blended @ rest.vertices[..., None])[..., 0] + HAND.weights @ shifts
    np.testing.assert_allclose(again, curled, atol=1e-10)
    for first in (1, 4, 7, 10):  # straight, and in the palm's plane
        assert np.ptp(rest.joints[first : first + 3, 1]) < 1e-12


def test_higher_price_makes_blend_shapes_local() -> None:
    rng = np.random.default_rng(5)
    features, errors = rng.standard_normal((60, 18)), rng.standard_normal((60, 4, 3))
    sums = RidgeSums.of([(features, errors)])
    distances = np.array([[0.0, 0.1], [0.1, 0.0], [0.02, 0.06], [0.05, 0.05]])
    support = np.ones((4, 18), dtype=bool)
    found = [solved(sums, support, distances, 1e-3, price) for price in (0.0, 1.0, 100.0)]
    shares = [far_share(some, distances) for some in found]
    assert shares[0] > shares[1] > shares[2]
    mistakes = [sums.error(some) for some in found]
    assert mistakes[0] < mistakes[1] < mistakes[2]
    plain = np.linalg.solve(sums.features + 0.06 * np.eye(18), sums.products[0].T).T
    np.testing.assert_allclose(found[0][0], plain)


def test_part_collapses_with_its_border() -> None:
    n = 9
    grid = np.array([[i, j, 0.0] for i in range(n) for j in range(n)]) / n
    faces = [
        corner
        for i in range(n - 1)
        for j in range(n - 1)
        for a in [n * i + j]
        for corner in ((a, a + n, a + 1), (a + 1, a + n, a + n + 1))
    ]
    border = np.flatnonzero((grid[:, :2] == 0).any(1) | (grid[:, :2] == (n - 1) / n).any(1))
    kept, found = collapsed_part(grid, np.array(faces), border, 60)
    assert len(kept) == 60
    assert np.isin(border, kept).all()
    corners = grid[kept][found]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(((n - 1) / n) ** 2)
    with pytest.raises(BadArgument, match="does not come down"):
        collapsed_part(grid, np.array(faces), border, 3)
