"""Joints as weighted means of few vertices, by least squares."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.training.simplex import kkt_residual, shares_to_zero

FEWEST = 60  # vertices that a row may use at least


@dataclass(frozen=True, eq=False)
class JointRegressor:
    """A regressor, which computes joints from vertices.

    Attributes:
        matrix: (K, N), the weights of vertices; each row sums to one.
        rms: (K,) in metres, the distance of each regressed joint from the given ones.
        kkt: the largest residual of the Karush-Kuhn-Tucker conditions.
    """

    matrix: csr_array
    rms: Array
    kkt: float


def fit_joint_regressor(
    templates: Array, joints: Array, rings: csr_array, reach: float = 0.2
) -> JointRegressor:
    """The shares (K, N) that give joints (S, K, 3) from templates (S, N, 3), row by row.

    min |T_s R' - J_s|^2 with R >= 0 and rows that sum to one, over the vertices within `reach` m
    of the joint. Few shapes do not decide a row: many give the same joints on all shapes in the
    affine span of these. What is found has at most 3 S entries above zero. The root's row is that
    of `rings` (K, N).
    """
    S, N, _ = templates.shape
    rows, rms, worst = np.zeros((joints.shape[1], N)), np.zeros(joints.shape[1]), 0.0
    rows[0], means = rings[[0]].toarray()[0], templates.mean(axis=0)
    for k in range(1, joints.shape[1]):
        distance = np.linalg.norm(means - joints[:, k].mean(axis=0), axis=1)
        order = np.argsort(distance, kind="stable")
        near = order[: max(FEWEST, int(np.count_nonzero(distance < reach)))]
        away = (templates[:, near] - joints[:, None, k]).transpose(0, 2, 1).reshape(3 * S, -1)
        found = shares_to_zero(away)
        every = np.ones(len(near), dtype=bool)
        kkt = kkt_residual(away.T @ away, np.zeros(len(near)), found, every)
        worst = max(worst, kkt)
        rows[k, near] = found
        rms[k] = np.sqrt(np.mean((away @ found) ** 2) * 3)
    return JointRegressor(csr_array(rows), rms, worst)
