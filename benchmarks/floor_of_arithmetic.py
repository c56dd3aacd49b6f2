"""The least time in which a core forms the products of a compiled body, however fast memory is.

Nearly all arithmetic of a surface is products that are added to something, and a core does a
product and a sum in one instruction. How many such instructions it does in a second is found by
BLAS, with matrices that stay in the cache.
"""

from dataclasses import replace

import casadi as cs
import numpy as np

from benchmarks.bodies_made_up import Case
from benchmarks.candidates import Candidate
from workbench.arrays import Array, Index
from workbench.bodies.forward.c_functions import vertex_functions
from workbench.bodies.forward.compiled import CompiledMesh
from workbench.bodies.forward.packing import PackedVertices

ARITHMETIC = "floor of its arithmetic"
SIDE = 96  # of square matrices, for which BLAS reaches 95 % of a core's products (measured)


def candidate(case: Case) -> Candidate:
    """As many products by BLAS as the compiled arithmetic of a body takes; never checked.

    Only forward and Jacobian are counted: what a step adds is J'J, which the other floors form.
    """
    arithmetic = replace(case.body).numeric.mesh()
    assert isinstance(arithmetic, CompiledMesh)
    forward, jacobian = products(arithmetic.packed)
    A, B, C = (np.ones((SIDE, SIDE)) for _ in range(3))

    def multiply(count: int) -> Array:
        whole, left = divmod(round(count / SIDE**2), SIDE)  # products of matrices, and of rows
        for rows in [SIDE] * whole + [left]:
            np.matmul(A[:rows], B, out=C[:rows])
        return C

    def by_jacobian(x: Array) -> tuple[Array, Array]:
        return C[0], multiply(jacobian)

    return Candidate(ARITHMETIC, lambda x: multiply(forward), by_jacobian, lambda x: C)


def products(packed: PackedVertices) -> tuple[int, int]:
    """How many products the points of a packed body take, and these with their derivative.

    Factors by which a residual multiplies rows are left out.
    """
    B, groups = packed.sizes[1], len(packed.vertices)
    added, others = vertex_functions(B)
    of = {name: _products(function) for name, function in (added | others).items()}
    weighted, corrected, moving = _listed(packed.joints)
    points = groups * (of["shaped"] + of["moved"]) + weighted * of["blended"]
    points += corrected * 9 * of["posed"]
    by_pose = weighted * of["carried"] + moving * (of["arm"] + of["turned"])
    by_pose += corrected * (9 * of["d_posed"] + of["turned_d_posed"])
    by_betas = B * (groups * of["by_beta"] + weighted * of["shifted"])
    each = points, points + by_pose + by_betas
    lanes = packed.vertices.shape[2]
    return lanes * each[0], lanes * each[1]


def _products(function: cs.Function) -> int:
    multiplying = (cs.OP_MUL, cs.OP_SQ)
    return sum(function.instruction_id(k) in multiplying for k in range(function.n_instructions()))


def _listed(joints: Index) -> tuple[int, int, int]:
    """How many joints have weights on, posedirs for, and move groups: the lists' lengths."""
    total, at = [0, 0, 0], 0
    while at < len(joints):
        for kind in range(3):
            length = int(joints[at])
            total[kind] += length
            at += 1 + length
    return total[0], total[1], total[2]
