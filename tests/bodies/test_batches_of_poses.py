"""Joints and motions of many poses at once are those of the kinematics, one by one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.arrays import Array
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.forward.joint_batch import JointBatch
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.skeleton import Skeleton

RNG = np.random.default_rng(0)
BODY = load_skinned("small")


@pytest.mark.parametrize("bind", [np.zeros((24, 3)), 0.4 * RNG.standard_normal((24, 3))])
def test_motions_are_those_of_single_poses(bind: Array) -> None:
    skeleton = Skeleton.of(BODY)
    one = Kinematics(skeleton, bind, BODY.parents)
    batch = JointBatch.of(skeleton, bind, BODY.parents)
    poses = RNG.standard_normal((5, 24, 3)) * np.array([0.0, 1e-9, 0.5, 2.0, 3.1])[:, None, None]
    betas = RNG.standard_normal((5, BODY.n_betas))
    many = batch.motions(poses, betas)
    for i in range(5):
        alone = one.motion(poses[i], betas[i])
        assert_allclose(many.G[i], alone.G, atol=1e-14)
        assert_allclose(many.features[i], alone.features, atol=1e-14)
        assert_allclose(many.joints[i], alone.joints, atol=1e-14)
    assert_allclose(batch(poses, betas), many.joints, atol=0)
