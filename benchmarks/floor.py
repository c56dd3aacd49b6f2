"""What the hardware allows: the memory that has to move and the product that has to be formed."""

from dataclasses import replace

import numpy as np
from scipy.linalg.blas import dsyrk

from benchmarks.bodies_made_up import Case
from benchmarks.candidates import Candidate
from workbench.arrays import Array
from workbench.bodies.forward.compiled import CompiledMesh

FLOOR, OWN = "floor", "floor of its own bytes"


def candidate(case: Case) -> Candidate:
    """Nothing useful, but what everybody has to do at least; never checked.

    Forward: every pose direction is read once (gemv 3 N x 9 (K - 1)). Jacobian: and J (3 N x n) is
    written once. Step: and J'J is formed once (syrk).
    """
    m, n = 3 * case.body.n_vertices, case.problem.free.size
    posedirs = np.ascontiguousarray(case.body.posedirs.reshape(m, -1))
    features = np.ones(posedirs.shape[1])
    J = np.zeros((n, m)).T  # stored column by column, as dsyrk likes it

    def read(x: Array) -> Array:
        return posedirs @ features

    def write(x: Array) -> tuple[Array, Array]:
        r = read(x)
        J.fill(x[0])
        return r, J

    def form(x: Array) -> Array:
        write(x)
        return np.asarray(dsyrk(1.0, J, trans=1))

    return Candidate(FLOOR, read, write, form)


def of_own_bytes(case: Case) -> tuple[Candidate, int]:
    """What the compiled arithmetic of a body does at least, and how many bytes it stores of it.

    Forward: these bytes, in the types in which they are stored, are read once (their largest number
    is found, eight bytes at a time), and the observed vertices; the residual is written. Jacobian:
    and J is written once. Step: and J'J is formed once, by BLAS and with all zeros.
    """
    arithmetic = replace(case.body).numeric.mesh()
    assert isinstance(arithmetic, CompiledMesh)
    packed = arithmetic.packed
    stored = [packed.vertices, packed.shapes, packed.posedirs, packed.joints]
    words = [array.ravel().view(np.int64) for array in stored if array.size]
    m, n = 3 * case.body.n_vertices, case.problem.free.size
    r, J = np.zeros(m), np.zeros((n, m)).T

    def read(x: Array) -> Array:
        for one in words:
            one.max()
        return np.multiply(case.fixed, x[0], out=r)

    def write(x: Array) -> tuple[Array, Array]:
        read(x)
        J.fill(x[0])
        return r, J

    def form(x: Array) -> Array:
        write(x)
        return np.asarray(dsyrk(1.0, J, trans=1))

    return Candidate(OWN, read, write, form), sum(one.nbytes for one in words)
