"""Joints seen in an image: what one camera knows of a body, and what a second one adds.

E_J of SMPLify with one Gaussian prior: the 24 joints, projected, are compared with detected
pixels. A camera sees across its view, and hardly along it; the linearization says by how much.
Everything is made up: body, cameras, and 3 px of noise.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.geometry.rotation import matrix_from_vector

SIGMA = 3.0  # px
rng = np.random.default_rng(5)
body = wb.load_body("small")
truth = {
    "pose": 0.2 * rng.standard_normal((24, 3)),
    "betas": np.zeros(body.n_betas),
    "trans": np.array([0.1, 0.0, 0.2]),
}
pose, betas, trans = (block.symbol for block in body.blocks())
joints = body.joint_points(pose, betas, trans)
K = np.array([[1000.0, 0, 500], [0, 1000.0, 500], [0, 0, 1]])  # px
UPRIGHT = np.diag([1.0, -1.0, -1.0])  # y is up in the world and down in an image


def seen_from(name: str, angle: float) -> tuple[wb.Residual, wb.Values]:
    """The residual of a camera 4 m away, `angle` rad around the body, and its numbers."""
    camera = wb.Camera(f"{name}/")
    R = UPRIGHT @ matrix_from_vector([0, -angle, 0])
    numbers = camera.values(K=K, R=R, t=[0, 0, 4])
    seen = camera.pixels(body.joints(**truth), numbers)
    seen = seen + SIGMA * rng.standard_normal(seen.shape)
    observed = wb.Block(f"{name}/seen", (24, 2), "px")
    sure = np.ones(24)
    term = wb.residuals.keypoints(joints, camera, observed.symbol, sure, sigma=SIGMA, name=name)
    return term, numbers | {observed.name: seen}


front, of_front = seen_from("front", 0.0)
side, of_side = seen_from("side", np.pi / 2)
prior = wb.residuals.gaussian(pose, covariance=0.3**2, unit="rad", name="prior")
start = body.start() | of_front | of_side
setups = {"one camera": [front, prior], "two cameras": [front, side, prior]}
solutions, errors, sigmas = {}, {}, {}
for name, residuals in setups.items():
    problem = wb.Problem(residuals, free=["trans", "pose"])
    solution = solutions[name] = wb.solve(problem, start)
    found = start | solution.values
    off = body.joints(found["pose"], trans=found["trans"]) - body.joints(**truth)
    errors[name] = np.abs(1e3 * off)  # (24, 3) mm: across, up, along the view of the first camera
    place = problem.free.slices["trans"]
    sigmas[name] = 1e3 * np.sqrt(np.diag(problem.linearize(found).covariance)[place])  # mm

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    for name in setups:
        x, y, z = sigmas[name]
        print(f"{name}: place known to {x:.0f}, {y:.0f} and {z:.0f} mm (across, up, along)")
        print(f"  joints off by {errors[name].mean(axis=0).round(0)} mm in the mean")
    with house_style():
        figure, (ax,) = sheet(7, 3.8)
        for name, off in errors.items():
            ax.plot(np.sort(off[:, 2]), np.arange(1, 25), "o-", ms=4, label=f"{name}, along")
            ax.plot(np.sort(off[:, 0]), np.arange(1, 25), "x:", ms=4, label=f"{name}, across")
        ax.set(xlabel="joint off by at most (mm)", ylabel="joints")
        ax.legend()
    Path(__file__).with_name("one_camera.png").write_bytes(png(figure))
    print("One camera hardly knows how far away a joint is; a second one, from the side, does.")
