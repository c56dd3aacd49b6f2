"""Predictors of blend shapes: laws of ridge regression, the group lasso and distances."""

from dataclasses import replace

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench.bodies.forward.features import count_features, rotation_vectors
from workbench.bodies.forward.skinning import unskinned
from workbench.errors import BadArgument, BadFile
from workbench.geometry.solids import along_edges
from workbench.lectures.material.tubes import tube
from workbench.studies.blend_shapes.kernel_features import Powers, products
from workbench.studies.blend_shapes.sparsity import (
    group_lasso,
    joint_distances,
    local_ridge,
    nonzero_share,
    refitted,
)
from workbench.studies.blend_shapes.study import PredictorPlan
from workbench.studies.blend_shapes.training_data import (
    feature_matrix,
)
from workbench.synthetic.fine_weights import teacher_of
from workbench.training.ridge import Sums, solve_ridge


def ridge(A: np.ndarray, D: np.ndarray, value: float) -> np.ndarray:
    """Ridge regression with all features at all vertices."""
    return solve_ridge(Sums.of([(A, D)]), np.ones((D.shape[1], A.shape[1]), bool), value)


def test_polynomials_are_recovered_without_bones() -> None:
    body, rng = random_body(n_joints=3), np.random.default_rng(0)
    for features in (rotation_vectors, Powers(3), products):
        F = count_features(features, 3, 0)
        truth = replace(
            body, features=features, posedirs=rng.normal(size=(30, 3, F)), skinning=unskinned
        )
        poses = rng.normal(size=(80, 3, 3))
        A = feature_matrix(truth, features, poses)
        found = ridge(A, truth.vertices(poses) - truth.template, 1e-14)
        np.testing.assert_allclose(found, truth.posedirs, atol=1e-7)
    assert [count_features(f, 24, 0) for f in (Powers(3), products)] == [207, 69 + 69 * 70 // 2]


def test_small_and_large_normal_equations_agree() -> None:
    rng = np.random.default_rng(0)
    D = rng.normal(size=(20, 7, 3))
    for F in (5, 60):
        A = rng.normal(size=(20, F))
        found = ridge(A, D, 0.1)
        assert (
            np.abs(
                A.T @ (D.reshape(20, -1) - A @ found.reshape(21, F).T) - 2 * found.reshape(21, F).T
            ).max()
            < 1e-12
        )
        everywhere = local_ridge(A, D, np.zeros((1, 7)), 1.0, 0.1)
        np.testing.assert_allclose(everywhere, found, atol=1e-12)


def test_distances_along_a_tube_are_lengths() -> None:
    body = tube(rings=21)
    ring = 10 * 32 + np.arange(32)
    (found,) = along_edges(body.template, body.faces, [ring])
    along = np.abs(body.template[: 21 * 32, 0])
    np.testing.assert_allclose(found[: 21 * 32], along, atol=1e-12)
    np.testing.assert_allclose(found[21 * 32 :], 0.3 + 0.05, atol=1e-12)
    apart, _ = along_edges(np.vstack([body.template, [[9, 9, 9]]]), body.faces, [ring, ring])
    assert apart[-1] == np.inf
    assert joint_distances(body).shape == (1, len(body.template))


def test_group_lasso_meets_its_optimality_conditions() -> None:
    """The gradient of a group that acts has the penalty's length and its direction; of others less.

    Checked on a made-up problem whose planted groups are found.
    """
    rng = np.random.default_rng(0)
    A = rng.normal(size=(200, 12))
    truth = np.zeros((5, 3, 12))
    truth[0, :, 4:8], truth[3, :, :4] = rng.normal(size=(3, 4)), rng.normal(size=(3, 4))
    D = np.einsum("nf,icf->nic", A, truth) + 0.01 * rng.normal(size=(200, 5, 3))
    penalty = 0.05
    found = group_lasso(A, D, 4, penalty)
    acts = np.linalg.norm(found.reshape(5, 3, 3, 4), axis=(1, 3)) > 0
    assert acts.tolist() == (np.abs(truth.reshape(5, 3, 3, 4)).max(axis=(1, 3)) > 0).tolist()
    left = D - np.einsum("nf,icf->nic", A, found)
    pull = np.einsum("nf,nic->icf", A, left).reshape(5, 3, 3, 4) / 200
    sizes = np.linalg.norm(pull, axis=(1, 3))
    np.testing.assert_allclose(sizes[acts], penalty, rtol=3e-4)
    assert (sizes[~acts] < penalty).all()
    again = refitted(A, D, found)
    assert nonzero_share(again) == nonzero_share(found) == 2 / 15
    np.testing.assert_allclose(again, truth, atol=0.01)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (
            {"examples": 300, "training": 200},
            "300 examples cannot be taken from 200 training poses",
        ),
        ({"examples": 5}, "at least 10"),
        ({"test": 3}, "need at least 20 poses"),
    ],
)
def test_impossible_plans_are_refused(wrong: dict[str, int], text: str) -> None:
    with pytest.raises(BadArgument, match=text):
        PredictorPlan(**wrong)  # type: ignore[arg-type]


def test_other_bodies_have_no_teacher() -> None:
    with pytest.raises(BadFile, match=r"no teacher for body 'made-up'; .* default and small"):
        teacher_of(random_body())
