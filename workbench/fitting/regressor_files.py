"""Regressors in files, and the one that comes with the workbench."""

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.fitting.pose_regressor import PoseRegressor
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes
from workbench.writing import write_arrays

FOLDER = files("workbench") / "data" / "poses"
REGRESSOR_FILE = "regressor.npz"
MOST_LAYERS = 9
LARGEST = 2**15 - 1  # of the whole numbers in which weights are stored


def save_regressor(regressor: PoseRegressor, path: str | Path) -> None:
    """Write a regressor into an .npz; weights become multiples of a step, in 16 bits.

    The step is the largest weight of a layer / 32,767. Raises BadFile if it cannot be written.
    """
    arrays = {
        "keypoint_names": np.array(regressor.keypoint_names),
        "joint_names": np.array(regressor.joint_names),
        "mean": regressor.mean.astype(np.float32),
        "scales": regressor.scales.astype(np.float32),
    }
    for i, (W, b) in enumerate(zip(regressor.weights, regressor.biases, strict=True)):
        step = float(np.abs(W).max()) / LARGEST or 1.0
        arrays[f"weights_{i}"] = np.rint(W / step).astype(np.int16)
        arrays[f"step_{i}"] = np.array(step)
        arrays[f"biases_{i}"] = b.astype(np.float32)
    write_arrays(path, arrays)


def read_regressor(path: str | Path) -> PoseRegressor:
    """Read a regressor that `save_regressor` wrote. Raises BadFile if there is none in it."""
    with opened(path, "regressor of poses", "give a file that `save_regressor` wrote") as archive:
        layers = sum(f"weights_{i}" in archive.headers for i in range(MOST_LAYERS))
        expected = {
            "keypoint_names": texts("M"),
            "joint_names": texts("K"),
            "mean": reals("K", 3),
            "scales": reals("K"),
        }
        for i in range(max(1, layers)):
            expected[f"weights_{i}"] = wholes(f"n{i}", f"n{i + 1}")
            expected[f"step_{i}"] = reals()
            expected[f"biases_{i}"] = reals(f"n{i + 1}")
        arrays = read_expected(archive, expected)
        keypoints, joints = (tuple(map(str, arrays[f"{x}_names"])) for x in ("keypoint", "joint"))
        weights: list[Array] = [arrays[f"weights_{i}"] * arrays[f"step_{i}"] for i in range(layers)]
        inputs, outputs = 3 * len(keypoints), 3 + 3 * len(joints)
        if (len(weights[0]), weights[-1].shape[1]) != (inputs, outputs):
            raise BadFile(
                f"its network takes {len(weights[0])} numbers and gives {weights[-1].shape[1]}; "
                f"{len(keypoints)} keypoints are {inputs}, and {len(joints)} joints {outputs}"
            )
        if not (arrays["scales"] > 0).all():
            raise BadFile("its scales are not above 0")
    return PoseRegressor(
        keypoints,
        joints,
        tuple(weights),
        tuple(arrays[f"biases_{i}"] for i in range(layers)),
        arrays["mean"],
        arrays["scales"],
    )


@cache
def shipped_regressor() -> PoseRegressor:
    """The regressor that comes with the workbench, for COCO's keypoints and SMPL's joints.

    `data/poses/PROVENANCE.md` says how it was trained.
    """
    with as_file(FOLDER / REGRESSOR_FILE) as path:
        return read_regressor(path)
