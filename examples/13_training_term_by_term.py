"""What registrations tell of a body, and what each term of training adds.

Four people in six poses each are registered with 60 vertices on two joints. Each person's template
and joints are unknown, and so are the pose blend shapes and skinning weights that all share, and
every pose and place: 2,700 unknowns. The diagnosis names each direction that the registrations
leave open, and the terms of SMPL's training close them one after another (Loper et al., SMPL,
2015, section 4.1).
"""

from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.synthetic.made_up import jointed_tube, random_smpl
from workbench.training.first_guess import Start

tube = jointed_tube(15, 4)
segments = np.where(tube.template[:, 0] > 0, 1, 0)
start = Start(tube.template, tube.faces, (-1, 0), ("root", "tip"), segments)
body = random_smpl(start, 1, seed=3)
body = replace(body, shapedirs=body.shapedirs[:, :, :0])  # everybody has a template
rng = np.random.default_rng(4)

learning = body.freed("posedirs", "weights")
scans, first, values = [], [], {}
for s in range(4):
    person = learning.freed("template", "joints", prefix=f"subject {s}/")
    template = person.free["template"].symbol
    first.append(
        wb.residuals.gaussian(
            cs.vec(template), mean=body.template.ravel(), covariance=0.03**2, name=f"E_T {s}"
        )
    )
    for j in range(6 * s, 6 * s + 6):
        pose = rng.standard_normal((2, 3))
        symbols = [block.symbol for block in person.blocks(f"scan {j}/")]
        mesh = body.vertices(pose)  # an exact registration
        scans.append(
            wb.residuals.vertices(person.points(*symbols), mesh, sigma=0.002, name=f"E_D {j}")
        )
        values |= person.start(f"scan {j}/") | {f"scan {j}/pose": pose}
posedirs, weights = (learning.free[name] for name in ("posedirs", "weights"))
small = wb.residuals.gaussian(cs.vec(posedirs.symbol), covariance=0.01**2, name="E_P")
sums = wb.Constraint("weights sum to one", cs.sum1(weights.symbol).T, 1.0, 1.0)


def diagnosed(residuals: list[wb.Residual]) -> wb.Diagnosis:
    """The diagnosis of a choice of terms, with everything free."""
    free = [name for name in values if not name.endswith("betas")]
    found = wb.diagnose(wb.Problem(residuals, free, constraints=[sums]), values)
    assert isinstance(found, wb.Diagnosis)
    return found


data = diagnosed(scans)
open_with = {
    "E_D": len(data.null_directions),
    "E_D + E_T": len(diagnosed([*scans, *first]).null_directions),
    "E_D + E_T + E_P": len(diagnosed([*scans, *first, small]).null_directions),
}

if __name__ == "__main__":
    print(data)
    for terms, count in open_with.items():
        print(f"{terms}: {count} directions are open")
    print("What is still open with E_T and E_P are the root joints: a place of the root joint and")
    print("the translations of its scans undo each other. E_J keeps them at the middle of a ring.")
