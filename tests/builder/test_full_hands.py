"""How a body holds its fingers is found from its surface alone."""

import numpy as np

from builder.full_hands import held_fingers
from workbench.bodies.files.embedded import embedded, embedded_hand
from workbench.bodies.files.embedded_with_hands import sewing_of


def test_fingers_that_are_bent_are_found_and_the_wrist_stays() -> None:
    hand = embedded_hand()
    pose = np.random.default_rng(0).normal(0, 0.15, (16, 3))
    pose[0] = 0
    betas = np.array([1.0, -0.5])
    found, rms = held_fingers(hand, hand.vertices(pose, betas, [0.3, 0.2, 0.1]))
    assert rms < 1e-4
    np.testing.assert_array_equal(found[0], 0)
    np.testing.assert_allclose(found, pose, atol=0.02)


def test_the_shipped_pose_is_what_the_builder_finds() -> None:
    sewing = sewing_of("full")
    found, rms = held_fingers(embedded_hand(), embedded("full").template[sewing.vertices])
    np.testing.assert_allclose(found, sewing.held, atol=1e-6)
    assert round(1e3 * rms, 2) == 1.06  # mm, as PROVENANCE.md says
