"""A small network from the keypoints of one person in one image to the pose and the facing.

It is the regressor with which SPIN begins its fits (Kolotouros et al., Learning to Reconstruct 3D
Human Pose and Shape via Model-fitting in the Loop, 2019), of keypoints in the place of an image.
Only NumPy is needed to use it; `lectures/material/regressor_training.py` trains it.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Mask
from workbench.errors import BadArgument, BadFile
from workbench.geometry.mirror import AXIAL, REFLECTION, opposites
from workbench.geometry.rotation import nearest_rotation
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes

FEWEST_KEYPOINTS = 3  # keypoints, below which nothing says how a body is turned
MIRRORED_COLUMNS = np.outer(REFLECTION, REFLECTION)[:, :2]  # what becomes of them under S R S
FOLDER = files("workbench") / "data" / "poses"
REGRESSOR_FILE = "regressor.npz"
MOST_LAYERS = 9


@dataclass(frozen=True, eq=False)
class PoseRegressor:
    """From M keypoints in one image to the rotations of a body's K joints.

    The input of the network is what `normalised` makes of the keypoints, so that the answer does
    not depend on where in the image a person is and how large; its output are the first two
    columns of the root's rotation (Zhou et al., On the Continuity of Rotation Representations in
    Neural Networks, 2019) and the rotation vectors of the other joints about `mean`, all of them
    times `scales`. Between the layers negative numbers become 0. The answers to an image and to
    its mirror image are averaged, so that they are exactly mirrored.

    The K joints begin with the root. Each layer has weights (inputs, outputs) and biases
    (outputs,); `mean` (K, 3) rad is the mean pose, and `scales` (K,) what one radian of a joint
    counts in the training.
    """

    keypoint_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    mean: Array
    scales: Array

    def regress(self, rays: ArrayLike, confidence: ArrayLike) -> tuple[Array, Array]:
        """The rotation of the root in the camera's frame (..., 3, 3), and the pose (..., K, 3) rad.

        `rays` (..., M, 2) are where the rays of the keypoints meet the plane at depth 1, which is
        (pixel - centre) / focal; the first row of the pose is zero. Keypoints of confidence 0 are
        not known, and the others count alike. Raises BadArgument for other shapes, and unless
        three keypoints of each image are known.
        """
        checked = self._checked(rays, confidence)
        points, known = (
            array.reshape(-1, *array.shape[checked[1].ndim - 1 :]) for array in checked
        )
        network, to_virtual = normalised(points, known)
        swap = opposites(self.keypoint_names)
        both_ways = np.stack([network, network[:, swap] * [-1, 1, 1]])
        answers = self._forward(both_ways.reshape(2 * len(points), -1))
        answers = answers.reshape(2, len(points), -1)
        columns = answers[..., :6].reshape(2, -1, 3, 2)
        columns = (columns[0] + MIRRORED_COLUMNS * columns[1]) / (2 * self.scales[0])
        K, other = len(self.joint_names), opposites(self.joint_names)
        turns = answers[..., 6:].reshape(2, -1, K - 1, 3) / self.scales[1:, None]
        pose = np.zeros((len(points), K, 3))
        pose[:, 1:] = (self.mean + self.mean[other] * AXIAL)[1:] / 2
        pose[:, 1:] += (turns[0] + turns[1][:, other[1:] - 1] * AXIAL) / 2
        third = np.cross(columns[..., 0], columns[..., 1])
        R = nearest_rotation(np.concatenate([columns, third[..., None]], axis=2))
        R = to_virtual.swapaxes(1, 2) @ R
        shape = checked[1].shape[:-1]
        return R.reshape(*shape, 3, 3), pose.reshape(*shape, K, 3)

    def _forward(self, x: Array) -> Array:
        last = len(self.weights) - 1
        for i, (W, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ W + b
            if i < last:
                x = np.maximum(x, 0.0)
        return x

    def _checked(self, rays: ArrayLike, confidence: ArrayLike) -> tuple[Array, Array]:
        points, trust = np.asarray(rays, dtype=float), np.asarray(confidence, dtype=float)
        M = len(self.keypoint_names)
        if points.shape[-2:] != (M, 2) or trust.shape != points.shape[:-1]:
            raise BadArgument(
                f"a regressor of {M} keypoints takes rays (..., {M}, 2) and confidences "
                f"(..., {M}), not {points.shape} and {trust.shape}"
            )
        if not np.isfinite(points[trust > 0]).all():
            raise BadArgument("a keypoint has no finite position; give it confidence 0")
        if ((trust > 0).sum(axis=-1) < FEWEST_KEYPOINTS).any():
            raise BadArgument(f"an image shows fewer than {FEWEST_KEYPOINTS} keypoints of {M}")
        return points, trust


def normalised(rays: Array, confidence: Array) -> tuple[Array, Array]:
    """The input (N, M, 3) of a network, and the rotation (N, 3, 3) of the camera to the person.

    The camera is turned without roll until it looks at the median of the known keypoints, so that
    the same person looks alike anywhere in an image. Points are then divided by their median
    distance from the median. Medians of coordinates hardly change if a few keypoints are wrong. The
    third column is 1 for a known keypoint; others are 0.
    """
    known = confidence > 0
    centre = _median(rays, known)
    to_virtual = looking_at(centre)
    points = np.einsum(
        "nij,nmj->nmi",
        to_virtual,
        np.concatenate(
            [np.where(known[..., None], rays, centre[:, None]), np.ones((*rays.shape[:2], 1))],
            axis=2,
        ),
    )
    flat = points[..., :2] / np.maximum(points[..., 2:], 0.1)
    flat = flat - _median(flat, known)[:, None]
    size = _median(np.linalg.norm(flat, axis=2, keepdims=True), known)
    flat = np.clip(flat / np.maximum(size, 1e-9)[:, None], -5, 5)
    return np.concatenate([flat * known[..., None], known[..., None]], axis=2), to_virtual


def looking_at(place: Array) -> Array:
    """The smallest rotations (N, 3, 3) that take the rays of places (N, 2) at depth 1 to z."""
    d = np.column_stack([place, np.ones(len(place))])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    x, y, z = d.T
    a = 1 / (1 + z)
    rows = [[1 - a * x * x, -a * x * y, -x], [-a * x * y, 1 - a * y * y, -y], [x, y, z]]
    return np.array(rows).transpose(2, 0, 1)


def _median(points: Array, known: Mask) -> Array:
    """The median (N, D) of the known points (N, M, D) of each image."""
    return np.asarray(np.nanmedian(np.where(known[..., None], points, np.nan), axis=1))


def read_regressor(path: str | Path) -> PoseRegressor:
    """Read a regressor; `lectures/material/regressor_training.py` saves it. Raises BadFile."""
    with opened(path, "regressor of poses", "give a file of such a network") as archive:
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
