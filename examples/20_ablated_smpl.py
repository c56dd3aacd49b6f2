"""The course's visualize_ablated_smpl: what each part of SMPL is good for, by leaving it out.

No blend weights: parts ride on single joints, and tear. No pose blend shapes: elbows and knees
collapse. No shape blend shapes: everybody is the mean person. Each ablation is a function from a
body to a body, so the ablated one poses, fits and is diagnosed like the whole.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.bodies.ablations import ABLATIONS

body = wb.load_body()
joint = {name: k for k, name in enumerate(body.joint_names)}

pose = np.zeros((24, 3))
for name, degrees in {
    "left_elbow": (0, -100, 0),
    "right_elbow": (0, 70, 0),
    "left_shoulder": (0, 0, -40),
    "right_shoulder": (0, 0, 65),
    "left_hip": (-75, 0, 0),
    "left_knee": (100, 0, 0),
    "right_hip": (-15, 0, 0),
    "right_knee": (30, 0, 0),
    "spine2": (0, 20, 0),
}.items():
    pose[joint[name]] = np.radians(degrees)
betas = np.array([-1.0, 2.0, 0.5])  # shorter and heavier than the mean

whole = body.vertices(pose, betas)
ablated = {f"no {part}": ablate(body).vertices(pose, betas) for part, ablate in ABLATIONS.items()}
away = {name: 1e3 * np.linalg.norm(v - whole, axis=1) for name, v in ablated.items()}  # mm

# what a fit makes of it: every ablated body is given the whole one's surface to explain
residuals_left = {}
for part, ablate in ABLATIONS.items():
    student = ablate(wb.load_body("small"))
    target = wb.load_body("small").vertices(pose, betas)
    symbols = [block.symbol for block in student.blocks()]
    terms = [wb.residuals.vertices(student.points(*symbols), target, sigma=0.01)]
    terms.append(wb.residuals.gaussian(symbols[1], covariance=1e4))
    problem = wb.Problem(terms, free=["pose", "betas", "trans"])
    found = wb.solve(problem, student.start()).values
    left = np.linalg.norm(student.vertices(**found) - target, axis=1)
    residuals_left[f"no {part}"] = 1e3 * left.mean()  # mm

if __name__ == "__main__":
    from workbench.plots import caption_differences, house_style, plot_differences, png, sheet

    with house_style():
        figure, (ax,) = sheet(10.5, 5.2)
        plot_differences(whole, ablated, body.faces, ax=ax, most=60)
    Path(__file__).with_name("ablated_smpl.png").write_bytes(png(figure))
    print(caption_differences(whole, ablated))
    for name, millimetres in residuals_left.items():
        print(f"fitted to the whole body's surface, {name} leaves {millimetres:.1f} mm on average")
