"""Which pose puts both feet on the floor and one hand on a wall, and what does that leave open?"""

# A file for the commands, with a residual of its own and a body. The docstring above is the
# question on its pages. `workbench new residual NAME` writes another one to begin with.
#
#     workbench run examples/36_a_file_of_your_own.py
#     workbench diagnose examples/36_a_file_of_your_own.py --data-alone

from collections.abc import Sequence

import numpy as np

import workbench as wb

AXES = {"x": 0, "y": 1, "z": 2}


def coordinate(
    points: wb.Points, axis: str, value: float, rows: Sequence[int], *, sigma: float
) -> wb.Residual:
    """One coordinate of some points against a value in m: those that lie in a plane."""
    names = points.labels or tuple(map(str, range(points.count)))
    return wb.Residual(
        f"{axis} of {', '.join(names[i] for i in rows)}",
        points.symbol[AXES[axis], list(rows)].T - value,  # (M, 1) m
        sigma,
        unit="m",
        points=(points,),
        labels=tuple(names[i] for i in rows),
    )


body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
joints = body.joint_points(pose, betas, trans)
number = {name: k for k, name in enumerate(body.joint_names)}
ankles = [number["left_ankle"], number["right_ankle"]]

floor = coordinate(joints, "y", 0.08, ankles, sigma=0.005)  # the ankles' height on the floor
wall = coordinate(joints, "z", 0.45, [number["right_wrist"]], sigma=0.005)  # in front
upright = wb.residuals.gaussian(pose, covariance=0.3**2, unit="rad", name="upright")
problem = wb.Problem([floor, wall, upright], free=["pose", "trans[y]"])
start = body.start() | {"trans": np.array([0.0, 1.0, 0.0])}

priors = ["upright"]  # not data
compared = ["levenberg-marquardt", "ipopt"]

if __name__ == "__main__":
    solution = wb.solve(problem, start)
    print(solution.status.name, "at a cost of", round(solution.cost, 3))
    found = start | solution.values
    places = body.joints(**found)
    print("heights of the ankles in m:", places[ankles, 1].round(3))
    print("the wrist is at z =", places[number["right_wrist"], 2].round(3), "m")
    data = wb.diagnose(problem.without(*priors), found)
    print(f"the data alone determine {data.rank} of {problem.free.size} numbers")
