"""What the hardware allows: the memory that has to move and the product that has to be formed."""

import numpy as np
from scipy.linalg.blas import dsyrk

from benchmarks.bodies_made_up import Case
from benchmarks.candidates import Candidate
from workbench.arrays import Array

FLOOR = "floor"


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
