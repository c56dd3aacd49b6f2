"""Triangle bodies learned from meshes in known poses, and exact least squares for small meshes.

Least squares by QR are exact to the last digit, even for unknowns that blended rotations show a
million times less clearly than the others.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lstsq
from scipy.sparse.linalg import LinearOperator

from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.training.triangles.learning import (
    LSQR,
    Lsqr,
    PosedMeshes,
    learn_bends,
    learn_shapes,
)


@dataclass(frozen=True)
class Direct(Lsqr):
    """By QR with pivots of the matrix itself. Raises BadArgument for more than `most` unknowns."""

    cutoff: float = 1e-13  # of the largest singular value: smaller ones count as zero
    most: int = 3000

    def solve(self, A: LinearOperator, b: Array) -> Array:
        """The minimum x."""
        n = A.shape[1]
        if n > self.most:
            raise BadArgument(
                f"{n} unknowns are too many for a direct solution, which takes up to {self.most}; "
                "take Lsqr"
            )
        matrix = A @ np.eye(n)
        return np.asarray(lstsq(matrix, b, cond=self.cutoff, lapack_driver="gelsy")[0])


def learn(
    start: TriangleBody,
    people: ArrayLike,
    posed: PosedMeshes,
    *,
    n_betas: int,
    ridge: float,
    by: Lsqr = LSQR,
) -> TriangleBody:
    """Learn SCAPE or BlendSCAPE, depending on the weights of `start`, from two sets of meshes.

    `people` (P, N, 3) m at rest give the template and D; `posed` meshes of them give Q, with the
    betas that each person has at rest. SCAPE also has one set of people and one of poses.
    """
    shapes = learn_shapes(people, start.faces, n_betas)
    shaped = replace(start, template=shapes.template, shapedirs=shapes.shapedirs)
    if posed.person.min() < 0 or posed.person.max() >= len(shapes.betas):
        raise BadArgument(f"posed meshes are of persons 0 to {len(shapes.betas) - 1}, no others")
    return learn_bends(shaped, posed, shapes.betas, ridge=ridge, by=by)
