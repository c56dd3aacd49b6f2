"""The four cameras of `balance`, calibrated again on the frames that are not fitted.

The published calibration disagrees with the keypoints: a camera that is left out of a
triangulation is missed by up to 33 px, most of it one common shift. Here the cameras' rotations
and translations are freed together with every keypoint's place, in frames far from the fitted
one: bundle adjustment, which is once more a problem with other names free.

    python -m builder.balance_cameras workbench/data/keypoints/balance_cameras.npz
"""

import sys
from pathlib import Path

import casadi as cs
import numpy as np

from builder.geometry import umeyama
from builder.stored import write_arrays
from workbench.blocks import Block, Values
from workbench.experiments.balance import FRAME, published
from workbench.geometry.camera import Camera, triangulate
from workbench.geometry.rotation import matrix_from_vector
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian, huber
from workbench.solvers import LevenbergMarquardt, Solution

FRAMES = tuple(f for f in range(0, 100, 5) if abs(f - FRAME) >= 10)
SIGMA = 5.0  # px
ROTATION_SIGMA = 0.02  # rad: how far the published calibration may be off
TRANSLATION_SIGMA = 0.05  # m


def bundle(frames: tuple[int, ...] = FRAMES) -> tuple[Problem, Values, tuple[Camera, ...]]:
    """The problem, its start at the published calibration, and its cameras."""
    numbers = published()
    names = [str(name) for name in numbers["camera"]]
    seen = numbers["keypoints"][list(frames)]  # (F, 4, 25, 3)
    cameras = tuple(Camera(name + "/") for name in names)
    count = seen.shape[0] * seen.shape[2]
    points = Block("points", (count, 3), "m")
    start: Values = {}
    residuals = []
    for i, camera in enumerate(cameras):
        pixels = seen[:, i, :, :2].reshape(-1, 2)
        confidence = seen[:, i, :, 2].ravel()
        observed = Block(f"{names[i]}/observed", (count, 2), "px")
        weight = Block(f"{names[i]}/confidence", (count,))
        start |= camera.values(
            K=numbers["K"][i], R=numbers["R"][i], t=numbers["T"][i], distortion=numbers["dist"][i]
        )
        start |= {observed.name: pixels, weight.name: confidence}
        # The confidence c is taken for a precision here: a keypoint has the standard deviation
        # SIGMA / c, and Huber's kernel looks at the residual in units of that. `keypoints` would
        # take c for a weight outside of the kernel; the calibration in data/ was found like this.
        off = (camera.project(points.symbol) - observed.symbol) * cs.repmat(weight.symbol.T, 2, 1)
        residuals.append(Residual(f"keypoints({names[i]})", cs.vec(off), SIGMA, "px", huber()))
        for block, sigma in (
            (camera.rotation, ROTATION_SIGMA),
            (camera.translation, TRANSLATION_SIGMA),
        ):
            residuals.append(
                gaussian(block.symbol, mean=start[block.name], covariance=sigma**2, unit=block.unit)
            )
    places = triangulate(
        cameras,
        start,
        [start[f"{name}/observed"] for name in names],
        [start[f"{name}/confidence"] for name in names],
    )
    middle = np.nanmedian(places, axis=0)
    start[points.name] = np.where(np.isfinite(places), places, middle)
    residuals.append(gaussian(points.symbol, mean=middle, covariance=1.0, unit="m"))
    free = ["points", *(b.name for c in cameras for b in (c.rotation, c.translation))]
    blocks = [points, *(block for camera in cameras for block in camera.blocks)]
    return Problem(residuals, free, blocks=blocks), start, cameras


def calibrate() -> tuple[Solution, Values, tuple[Camera, ...]]:
    """Solve it."""
    problem, start, cameras = bundle()
    solver = LevenbergMarquardt(max_iterations=60)
    solution = solver.solve(
        problem, start, callback=lambda i: print(f"cost {i.cost:.6g}  gradient {i.optimality:.1e}")
    )
    return solution, start | solution.values, cameras


def main(path: Path) -> None:
    """Calibrate, and write R (4, 3, 3) and T (4, 3) m.

    The keypoints do not fix the world's frame and scale: they stay where the published
    triangulation of the same frames has them.
    """
    solution, values, cameras = calibrate()
    print(solution.status.name, solution.message)
    before = published()["keypoints3d_dlt"][list(FRAMES)].reshape(-1, 3)
    world = umeyama(values["points"], before)
    off = np.linalg.norm(world(values["points"]) - before, axis=1)
    print(
        f"scale {world.scale:.4f}; median distance to the published points {np.median(off):.4f} m"
    )
    R = np.array([matrix_from_vector(values[c.rotation.name]) for c in cameras]) @ world.R.T
    T = np.array([values[c.translation.name] for c in cameras]) * world.scale - R @ world.t
    names = np.array([c.prefix.rstrip("/") for c in cameras])
    write_arrays(path, {"camera": names, "R": R, "T": T, "frames": np.array(FRAMES)})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
