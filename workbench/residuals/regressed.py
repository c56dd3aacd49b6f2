"""Joints against weighted means of vertices: what a joint regressor says of a rest surface."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.blocks import Points
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.arguments import expressed, named_after
from workbench.residuals.residual import Residual


def regressed(
    joints: Points | cs.MX,
    vertices: Points | cs.MX,
    regressor: cs.MX | csr_array | ArrayLike,
    *,
    sigma: float,
    name: str | None = None,
) -> Residual:
    """(R V)_k - J_k in metres: E_J, joints (K, 3) at the means of vertices (N, 3) (SMPL, 4.1).

    `joints` and `vertices` are symbols of blocks, or points; `regressor` (K, N) is an array, a
    sparse one, or the symbol of a block. Where the rows of the regressor sum to one, a common
    translation of joints and vertices changes nothing. Raises BadResidual for a regressor of
    another shape.
    """
    bones, joint_reads = expressed(joints)
    surface, surface_reads = expressed(vertices)
    name = name or named_after("regressed", bones, bones)
    shape = (bones.shape[1], surface.shape[1])
    if isinstance(regressor, cs.MX):
        R = regressor
    else:
        dense = regressor.toarray() if isinstance(regressor, csr_array) else regressor
        found = reals(f"residual {name!r}: the regressor", dense)
        if found.ndim != 2 or not np.isfinite(found).all():
            raise BadResidual(f"residual {name!r} needs a regressor (K, N) of finite numbers")
        R = cs.MX(cs.sparsify(cs.DM(found.T)))
    if R.shape != shape[::-1]:
        raise BadResidual(
            f"residual {name!r} needs a regressor of shape {shape}, a row for each joint and a "
            f"column for each vertex, not {R.shape[::-1]}"
        )
    return Residual(
        name,
        cs.vec(surface @ R - bones),
        sigma,
        "m",
        points=(*joint_reads, *surface_reads),
        rows_per_point=3,
    )
