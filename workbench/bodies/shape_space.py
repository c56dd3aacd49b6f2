"""The betas of a body with a face, apart: the person's shape, and the expression of the face.

SMPL-X and FLAME store both in one array, shapedirs (N, 3, B): 300 directions of shape and then 100
of expression, or 10 and 10 in files that were cut (Pavlakos et al., Expressive Body Capture, 2019;
Li et al., Learning a Model of Facial Shape and Expression from 4D Scans, 2017). A body here has one
block of betas for all of them; a `ShapeSpace` says which rows are which, and makes betas of both.
"""

from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.checks import reals
from workbench.bodies.body import Body
from workbench.bodies.files.joint_names import family
from workbench.errors import BadArgument

WITH_FACE = ("SMPL-X", "FLAME")
COUNTS = {400: (300, 100), 20: (10, 10)}  # directions of shape and of expression, by their number


@dataclass(frozen=True)
class ShapeSpace:
    """Which of B betas are the shape's, and which the expression's.

    Attributes:
        n_betas: B.
        shape: the rows of betas that are the person's shape.
        expression: the rows that are the expression of the face; empty for a body without a face.
    """

    n_betas: int
    shape: range
    expression: range

    def first(self, shape: int, expression: int = 0) -> "ShapeSpace":
        """The space of the first few coefficients of shape and expression; all others stay zero.

        Raises BadArgument if there are fewer.
        """
        for what, count, there in (
            ("shape", shape, self.shape),
            ("expression", expression, self.expression),
        ):
            if not 0 <= count <= len(there):
                raise BadArgument(
                    f"there are {len(there)} coefficients of {what}; ask for 0 to so many, not "
                    f"{count}"
                )
        return replace(self, shape=self.shape[:shape], expression=self.expression[:expression])

    def blocks(self, prefix: str = "") -> tuple[Block, Block]:
        """New blocks `shape` (S,) and `expression` (E,): list them among a problem's `blocks`."""
        return (
            Block(prefix + "shape", (len(self.shape),), "sd"),
            Block(prefix + "expression", (len(self.expression),), "sd"),
        )

    def betas(self, shape: cs.MX, expression: cs.MX | None = None) -> cs.MX:
        """The betas (B, 1) of a shape (S, 1) and an expression (E, 1), zero without one.

        The map is affine, so that a body takes it wherever it takes betas.
        """
        parts = [(self.shape, shape, "shape")]
        if expression is not None:
            parts.append((self.expression, expression, "expression"))
        total = cs.MX(self.n_betas, 1)
        for rows, part, what in parts:
            if part.shape != (len(rows), 1):
                raise BadArgument(
                    f"the {what} is an expression ({len(rows)}, 1) here, not {part.shape}"
                )
            placed = cs.DM(np.eye(self.n_betas)[:, rows.start : rows.stop])
            total = total + cs.sparsify(placed) @ part
        return total

    def numbers(self, shape: ArrayLike = (), expression: ArrayLike = ()) -> Array:
        """The same in numbers: betas (..., B) of a shape (..., S) and an expression (..., E).

        Fewer coefficients than there are stand for the first ones; the others are zero. Raises
        BadArgument for too many.
        """
        given = [reals("the shape", shape), reals("the expression", expression)]
        front = np.broadcast_shapes(*(part.shape[:-1] for part in given))
        found = np.zeros((*front, self.n_betas))
        for rows, part, what in zip(
            (self.shape, self.expression), given, ("shape", "expression"), strict=True
        ):
            if part.shape[-1] > len(rows):
                raise BadArgument(
                    f"there are {len(rows)} coefficients of {what}, and {part.shape[-1]} were given"
                )
            found[..., rows.start : rows.start + part.shape[-1]] = part
        return found


def shape_space(body: Body) -> ShapeSpace:
    """Which betas of a body are the shape's, and which the expression's.

    SMPL-X and FLAME with 400 betas have 300 of shape and 100 of expression, with 20 they have 10 of
    each. All betas of other bodies, and of SMPL-X and FLAME in other numbers, are of shape.
    """
    B = body.n_betas
    with_face = family(body.n_joints, body.parents) in WITH_FACE
    shape = COUNTS[B][0] if with_face and B in COUNTS else B
    return ShapeSpace(B, range(shape), range(shape, B))
