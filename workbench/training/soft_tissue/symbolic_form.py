"""The one-step model as a problem: linear, and its Jacobian says what the motions determined."""

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.motions import SoftTissue
from workbench.motions.tissue_inputs import input_names
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.training.soft_tissue.identification import OneStep

NOTHING = 1e-9  # of the largest input: what moves less in all clips counts as still


def one_step_problem(one: OneStep, tissue: SoftTissue, coefficient: int = 0) -> Problem:
    """The factors of one coefficient, a row of [A_1 A_2 B], as unknowns of a linear least squares.

    The block `factors` (2 C + X,) is labelled with what each factor belongs to, in units of the
    root mean square of it in the clips, so that factors can be compared. All coefficients have the
    same Jacobian. The residual has as many rows as unknowns: Q'(Z w - y), with Z = Q R, which has
    the rank, the null space and the minimum of the M rows of Z w - y. Its null space is what the
    motions did not excite: an input that never moved, or inputs that always moved together.
    """
    Z = _scaled(one)
    Q, R = np.linalg.qr(Z)
    y = Q.T @ one.targets[:, coefficient]
    factors = Block("factors", (Z.shape[1],), "1", factor_names(tissue))
    off = cs.DM(R) @ factors.symbol - cs.DM(y)
    return Problem(
        [Residual("one step ahead", off, _noise(one, coefficient), "1")],
        free=["factors"],
        blocks=[factors],
    )


def one_step_start(tissue: SoftTissue) -> Values:
    """The factors at which the tissue does not move."""
    return {"factors": np.zeros(2 * tissue.n_coefficients + tissue.response.shape[1])}


def factor_names(tissue: SoftTissue) -> tuple[str, ...]:
    """What the factors belong to: coefficients of the two frames before, and the inputs."""
    C = tissue.n_coefficients
    before = [
        f"coefficient {c} {ago}" for ago in ("a frame ago", "two frames ago") for c in range(C)
    ]
    n_parts = int(tissue.part.max(initial=-1)) + 1
    return (*before, *input_names(tissue.joint_names, n_parts, tissue.n_betas))


def still_inputs(one: OneStep, tissue: SoftTissue) -> tuple[str, ...]:
    """The inputs that no clip moved: any factor explains them, and training leaves it at zero."""
    size = np.sqrt((one.regressors**2).mean(axis=0))
    names = factor_names(tissue)
    return tuple(names[i] for i in np.flatnonzero(size <= NOTHING * size.max()))


def _scaled(one: OneStep) -> Array:
    """The regressors, each divided by its root mean square; those that never move are zero."""
    sizes = np.sqrt((one.regressors**2).mean(axis=0))
    there = sizes > NOTHING * sizes.max()
    return np.where(there, one.regressors / np.where(there, sizes, 1.0), 0.0)


def _noise(one: OneStep, coefficient: int) -> float:
    """The rms of what the best factors leave; at least a thousandth of the coefficient's."""
    Z = _scaled(one)
    y = one.targets[:, coefficient]
    left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-9)[0]
    return float(max(np.sqrt(np.mean(left**2)), 1e-3 * np.sqrt(np.mean(y**2))))
