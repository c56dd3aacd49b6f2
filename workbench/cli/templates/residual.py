"""Which shape of a body has these lengths between joints, as a tape measured them?"""

# A residual of your own, and a problem to try it on:
#
#     workbench run NAME.py         solve the problem, and write a page with every number
#     workbench diagnose NAME.py    rank, priors, and whether the derivatives are right
#     workbench compare NAME.py     several solvers from the same start
#     workbench sample NAME.py      how uncertain each unknown is, by draws

from collections.abc import Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

import workbench as wb


# 1. A residual is a function of points and numbers that returns a `Residual`. It knows no body: the
#    points may be joints, vertices or landmarks of any, or a block of yours.
def NAME(
    points: wb.Points, pairs: Sequence[tuple[int, int]], observed: ArrayLike, *, sigma: float
) -> wb.Residual:
    """|p_i - p_j| - d_ij in metres, a row for each of M pairs of points.

    points (3, N) m; pairs (M, 2), the numbers of points; observed (M,) m. Where two points
    coincide their distance has no derivative.
    """
    one, other = (points.symbol[:, list(numbers)] for numbers in zip(*pairs, strict=True))
    lengths = cs.sqrt(cs.sum1((one - other) ** 2)).T  # (M, 1) m; sum1 adds the rows up
    names = points.labels or tuple(map(str, range(points.count)))
    return wb.Residual(
        "NAME",
        lengths - np.asarray(observed, dtype=float),
        sigma,  # the size of an ordinary error, in the unit of the rows
        unit="m",
        points=(points,),  # the points that the expression reads
        labels=tuple(f"{names[i]} to {names[j]}" for i, j in pairs),
    )


# 2. A problem to try it on. These lengths are made up: they are those of a body of known shape.
body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
joints = body.joint_points(pose, betas, trans)
limbs = [("left_hip", "left_knee"), ("left_knee", "left_ankle"), ("left_shoulder", "left_elbow")]
limbs += [("left_elbow", "left_wrist"), ("neck", "head"), ("left_hip", "right_hip")]
number = {name: k for k, name in enumerate(body.joint_names)}
pairs = [(number[a], number[b]) for a, b in limbs]

truth = body.start() | {"betas": np.array([1.5, -1.0, 0.5] + [0.0] * (body.n_betas - 3))}
places = body.joints(**truth)
lengths = [float(np.linalg.norm(places[i] - places[j])) for i, j in pairs]

data = NAME(joints, pairs, lengths, sigma=0.005)
usual = wb.residuals.gaussian(betas, covariance=1.0, name="usual shapes")
problem = wb.Problem([data, usual], free=["betas[0:3]"])
start = body.start()
priors = ["usual shapes"]  # residuals that are not data

# 3. Two things that every residual is held to: it is zero where the observations are met, and the
#    slope that CasADi derives is that of the numbers. `workbench diagnose` checks the slope too.
if __name__ == "__main__":  # `python NAME.py`
    at_truth = problem.linearize(truth).residual[problem.rows["NAME"]]
    print("largest at the truth:", np.abs(at_truth).max())
    print(wb.diagnose(problem, start).report())
