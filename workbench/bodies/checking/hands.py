"""Findings about hands: their side, whether they were mirrored, and where their mean is."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.bodies.checking.findings import FileFinding
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.bodies.files.joint_names import FINGERS
from workbench.geometry.mirror import AXIAL
from workbench.geometry.rotation import matrix_from_vector

LONG = ("index", "middle", "ring", "pinky")
SIDES = {"l": "left", "r": "right"}
OPPOSED = (
    -0.5
)  # the correlation of stretches along x with those along y and z, below which x is turned
CLOSE = 0.05  # of the norm of a mean: two means that differ by less are the same one
DECIDED = 0.1  # of the largest chirality, 1: below it a hand may be either
BENT = 0.15  # rad, the mean bend of fingers at rest from which on they are not flat


@dataclass(frozen=True, eq=False)
class Hand:
    """One hand of a model, at rest.

    Attributes:
        letter: what the keys of its arrays end in: nothing, l or r.
        side: left or right, as the file says; empty if it does not.
        joints: (16, 3) the wrist and the joints of the fingers, in the order of `FINGERS`.
        mean: (15, 3) rad, its mean pose; zeros without one.
    """

    letter: str
    side: str
    joints: Array
    mean: Array

    def bend(self, mean: Array) -> float:
        """The mean angle in rad between the bones of the long fingers, in a pose (15, 3)."""
        places = _posed(self.joints, mean)
        angles = []
        for finger in LONG:
            a, b, c = (places[1 + FINGERS.index(f"{finger}{i}")] for i in (1, 2, 3))
            bones = [b - a, c - b]
            lengths = [float(np.linalg.norm(bone)) for bone in bones]
            if min(lengths) > 0:
                cosine = float(bones[0] @ bones[1]) / (lengths[0] * lengths[1])
                angles.append(float(np.arccos(np.clip(cosine, -1, 1))))
        return float(np.mean(angles)) if angles else 0.0

    @property
    def chirality(self) -> float:
        """Above 0 for a left hand and below 0 for a right one, if the mean pose closes the fingers.

        It is the volume that is spanned by the direction of the fingers, the direction from the
        little finger to the index finger, and the direction in which the mean pose bends fingers.
        """
        rest, closed = self.joints, _posed(self.joints, self.mean)
        rows = {name: 1 + FINGERS.index(name) for name in FINGERS}
        fingers = rest[rows["middle1"]] - rest[0]
        thumbwards = rest[rows["index1"]] - rest[rows["pinky1"]]
        ends = [rows[f"{finger}3"] for finger in LONG]
        palmwards = (closed[ends] - rest[ends]).mean(axis=0)
        ways = [fingers, thumbwards, palmwards]
        lengths = [float(np.linalg.norm(way)) for way in ways]
        if min(lengths) <= 0 or lengths[2] < 0.01 * lengths[0]:
            return 0.0
        return float(np.linalg.det(np.array(ways)) / np.prod(lengths))


def _posed(joints: Array, pose: Array) -> Array:
    """The joints (16, 3) of a hand with these rotations of its fingers, the wrist being still."""
    R, places = matrix_from_vector(pose), joints.copy()
    for finger in range(5):
        turn, at = np.eye(3), joints[0]
        for i in range(3):
            k = 1 + 3 * finger + i
            before = joints[0] if i == 0 else joints[k - 1]
            at = at + turn @ (joints[k] - before)
            places[k] = at
            turn = turn @ R[k - 1]
    return places


def hands_of(model: ModelArrays) -> list[Hand]:
    """The hands that a file has: one in MANO's layout, two in SMPL-H's and SMPL-X's."""
    joints = model.joints
    if joints is None or len(model.names) != len(joints):
        return []
    at = dict(zip(model.names, joints, strict=True))
    found = []
    for letter, side in (("", ""), ("l", "left"), ("r", "right")):
        prefix = f"{side}_" if side else ""
        names = [f"{prefix}{name}" for name in ("wrist", *FINGERS)]
        if not all(name in at for name in names):
            continue
        mean = model.extra(f"hands_mean{letter}")
        pose = np.zeros(45) if mean is None or mean.size != 45 else mean.astype(np.float64)
        said = side or side_in_name(model.where)
        places = np.array([at[name] for name in names])
        found.append(Hand(letter, said, places, pose.reshape(15, 3)))
    return found


def side_in_name(where: str) -> str:
    """Left or right, if the name of a file says one of them."""
    name = Path(where).stem.lower()
    said = [side for side in SIDES.values() if side in name]
    return said[0] if len(said) == 1 else ""


def about_hands(model: ModelArrays) -> Iterator[FileFinding]:
    """The sides of hands, and what belongs to their pose spaces."""
    yield from _pose_spaces(model)
    for hand in hands_of(model):
        yield from _side(hand)
        yield from _mean_in_template(hand)
        yield from _mean_in_coefficients(model, hand)
    yield from _both_means(model)
    yield from _unmirrored_shapes(model)


def _pose_spaces(model: ModelArrays) -> Iterator[FileFinding]:
    for letter in ("", *SIDES):
        mean, rows = (model.extra(f"hands_{what}{letter}") for what in ("mean", "components"))
        if mean is not None and mean.size != 45:
            yield FileFinding(
                f"hands_mean{letter}",
                f"hands_mean{letter} has {mean.size} numbers, but the 15 joints of a hand have 45 "
                "angles. Take it from the original file.",
            )
        if rows is not None and (rows.ndim != 2 or rows.shape[1] != 45):
            yield FileFinding(
                f"hands_components{letter}",
                f"hands_components{letter} has shape {rows.shape}, but components are rows of the "
                "45 angles of a hand. Transpose it, or take it from the original file.",
            )


def _side(hand: Hand) -> Iterator[FileFinding]:
    """Fingers that the mean pose bends backwards, or a hand of the other side."""
    chirality = hand.chirality
    if not hand.side or abs(chirality) < DECIDED:
        return
    seen = "left" if chirality > 0 else "right"
    if seen == hand.side:
        return
    key = f"hands_mean{hand.letter}"
    if hand.letter:
        text = (
            f"{key} bends the fingers of the {hand.side} hand backwards, as that of the other hand "
            f"would. Mirror it: multiply each rotation vector of {key} and of "
            f"hands_components{hand.letter} by (1, -1, -1)."
        )
    else:
        text = (
            f"The name of the file says {hand.side}, but this is a {seen} hand, by the order of "
            f"its fingers and the way in which {key} closes them. Either the file has a wrong "
            "name, or only some of its arrays were mirrored: a mirrored hand has the other sign "
            "of x in v_template, shapedirs and posedirs, of y and z in hands_mean and "
            "hands_components, and reversed faces. bodies.mirrored does all of this."
        )
    yield FileFinding(key, text)


def _mean_in_template(hand: Hand) -> Iterator[FileFinding]:
    at_rest = hand.bend(np.zeros((15, 3)))
    if not hand.mean.any() or at_rest < BENT:
        return
    undone = -hand.mean  # the inverse of each rotation; the root of a chain is undone first
    if hand.bend(undone) < 0.5 * at_rest:
        key = f"hands_mean{hand.letter}"
        yield FileFinding(
            "v_template",
            f"The fingers of v_template are bent by {np.degrees(at_rest):.0f} degrees on average, "
            f"and {key} undone would stretch them: the mean pose is in the template, and would be "
            f"added twice. Set {key} to zero, or take a template with a flat hand.",
        )


def _mean_in_coefficients(model: ModelArrays, hand: Hand) -> Iterator[FileFinding]:
    rows = model.extra(f"hands_components{hand.letter}")
    coefficients = model.extra(f"hands_coeffs{hand.letter}")
    mean = hand.mean.ravel()
    usable = rows is not None and coefficients is not None and mean.any()
    if not usable or rows is None or coefficients is None:
        return
    if rows.ndim != 2 or rows.shape[1] != 45 or coefficients.ndim != 2:
        return
    if coefficients.shape[1] > len(rows) or len(coefficients) < 2:
        return
    found = coefficients.mean(axis=0) @ rows[: coefficients.shape[1]]
    spanned = rows.T @ np.linalg.lstsq(rows.T, mean, rcond=None)[0]
    if np.linalg.norm(spanned) > 0.5 * np.linalg.norm(mean) and np.linalg.norm(
        found - spanned
    ) < 0.25 * np.linalg.norm(spanned):
        yield FileFinding(
            f"hands_coeffs{hand.letter}",
            f"The poses of hands_coeffs{hand.letter} have a mean of their own, which is that of "
            f"hands_mean{hand.letter}: together, the mean is added twice. Subtract from "
            f"hands_coeffs{hand.letter} its mean over the rows, or set hands_mean{hand.letter} to "
            "zero.",
        )


def _both_means(model: ModelArrays) -> Iterator[FileFinding]:
    """The means of two hands, which are each other's mirror images up to small differences."""
    left, right = (model.extra(f"hands_mean{letter}") for letter in SIDES)
    if left is None or right is None or left.size != 45 or right.size != 45:
        return
    if not left.any() or not right.any():
        return
    own = left.astype(np.float64).reshape(15, 3)
    other = right.astype(np.float64).reshape(15, 3)
    mirrored = other * AXIAL

    def near(a: Array, b: Array) -> bool:
        return bool(np.linalg.norm(a - b) < CLOSE * np.linalg.norm(b))

    if near(own, other) and not near(own, mirrored):
        yield FileFinding(
            "hands_meanl",
            "hands_meanl is the same as hands_meanr, so that one of the hands bends its fingers "
            "backwards. Multiply each rotation vector of hands_meanl, and of hands_componentsl, by "
            "(1, -1, -1).",
        )
    for key, doubled in (
        ("hands_meanl", near(own, 2 * mirrored)),
        ("hands_meanr", near(mirrored, own / 0.5)),
    ):
        if doubled:
            yield FileFinding(
                key,
                f"{key} is twice the mean of the other hand: the mean was added twice where the "
                "file was made. Halve it.",
            )


def stretches(model: ModelArrays) -> Array | None:
    """How each shape direction stretches the model along x, y and z: (B, 3), by least squares."""
    if model.template is None or model.shapedirs is None or not model.shapedirs.shape[2]:
        return None
    N = len(model.template)
    centred = np.column_stack([model.template - model.template.mean(axis=0), np.ones(N)])
    slopes = np.linalg.lstsq(centred, model.shapedirs.reshape(N, -1), rcond=None)[0][:3]
    slopes = slopes.reshape(3, 3, -1)  # by the coordinate, of the displacement, of each direction
    return np.asarray(np.einsum("iib->bi", slopes))


def _unmirrored_shapes(model: ModelArrays) -> Iterator[FileFinding]:
    """Shape directions of a hand whose x was not turned when the template was mirrored."""
    if model.family != "MANO" or (found := stretches(model)) is None:
        return
    with np.errstate(invalid="ignore", divide="ignore"):
        norms = np.linalg.norm(found, axis=0)
        xy, xz, yz = (
            float(found[:, i] @ found[:, j] / (norms[i] * norms[j]))
            for i, j in ((0, 1), (0, 2), (1, 2))
        )
    if xy < OPPOSED and xz < OPPOSED and yz > -OPPOSED:
        yield FileFinding(
            "shapedirs",
            "Shape directions that make the hand larger along y and z make it smaller along x: x "
            "of shapedirs was not mirrored with v_template, which is a known mistake of MANO's "
            "left hand. Change its sign, shapedirs[:, 0, :] *= -1; betas that were fitted before "
            "belong to the file as it was.",
        )
