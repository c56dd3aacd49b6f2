"""Student's t of poses: as learned, and as shipped."""

import numpy as np
from scipy.stats import multivariate_t

from builder.pose_student import learn_pose_student
from workbench.geometry.mirror import AXIAL, opposites
from workbench.priors.mocap import Mocap
from workbench.priors.poses import shipped_gaussian
from workbench.priors.tailed_poses import shipped_student
from workbench.synthetic.skeleton import JOINT_NAMES


def test_density_is_that_of_scipy() -> None:
    prior = shipped_student()
    at = prior.mean + 0.3 * np.random.default_rng(0).normal(size=(4, len(prior.mean)))
    expected = multivariate_t(prior.mean, prior.scale, df=prior.dof).logpdf(at)
    np.testing.assert_allclose(prior.log_density(at), expected, rtol=1e-9)


def test_tails_are_those_of_what_was_recorded() -> None:
    """Two joints that move as a t of three degrees of freedom, and far more than another two."""
    rng = np.random.default_rng(1)
    clips, frames = 16, 60
    n = clips * frames
    poses = np.zeros((n, 24, 3))
    scale = np.sqrt(3.0 / rng.chisquare(3.0, size=n))[:, None]
    for joint, sd in (("spine1", 0.2), ("spine2", 0.1)):
        poses[:, JOINT_NAMES.index(joint)] = sd * scale * rng.normal(size=(n, 3))
    names = tuple(f"{k:02}" for k in range(clips))
    found = learn_pose_student(Mocap(poses, np.arange(n) // frames, names, JOINT_NAMES))
    assert found.joint_names == ("spine1", "spine2")
    assert 2.3 < found.dof < 3.9
    np.testing.assert_allclose(np.sqrt(np.diag(found.scale))[[0, 3]], [0.2, 0.1], rtol=0.1)


def test_the_shipped_one_is_the_same_on_both_sides_and_of_the_gaussians_frames() -> None:
    prior, normal = shipped_student(), shipped_gaussian()
    assert set(prior.joint_names) == set(normal.joint_names) - set(normal.unmeasured)
    assert (prior.n_frames, prior.held_out) == (normal.n_frames, normal.held_out)
    turned = prior.mean.reshape(-1, 3)[opposites(prior.joint_names)] * AXIAL
    np.testing.assert_allclose(turned.ravel(), prior.mean, atol=1e-6)
    assert 3 < prior.dof < 5
    assert np.linalg.eigvalsh(prior.scale).min() > 1e-5
