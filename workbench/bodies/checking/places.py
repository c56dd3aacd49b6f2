"""Findings about where a model is: unit, axes, sides and the way its faces look; its hands."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.bodies.checking.model_arrays import FileFinding, ModelArrays
from workbench.bodies.files.joint_names import FINGERS
from workbench.geometry.guesses import UP_TO_Y
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.geometry.solids import volume

SIZES = {  # m, the largest extent of a model of each family: at least, usually, at most
    "SMPL": (0.3, 1.7, 2.6),
    "SMPL-H": (0.3, 1.7, 2.6),
    "SMPL-X": (0.3, 1.7, 2.6),
    "MANO": (0.06, 0.2, 0.4),
    "FLAME": (0.12, 0.28, 0.6),
}
METRES = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048}
LARGEST_SHAPE, LARGEST_POSE = 0.3, 1.0  # of the size of a model, of an entry of shapedirs, posedirs
AXES = ("x", "y", "z")
ALL = "v_template, shapedirs and posedirs"


def about_places(model: ModelArrays) -> Iterator[FileFinding]:
    """The unit, the directions of up, left and front, and the side to which faces look."""
    if model.template is None or not model.size > 0:
        return
    yield from _unit(model)
    yield from _axes(model)
    yield from _inwards(model)


def _unit(model: ModelArrays) -> Iterator[FileFinding]:
    size = model.size
    least, usual, most = SIZES.get(model.family, (0.0, size, np.inf))
    if not least <= size <= most:
        units = [unit for unit, metres in METRES.items() if least <= size * metres <= most]
        units.sort(key=lambda unit: abs(np.log(size * METRES[unit] / usual)))
        fits = [f"in {unit} it would be {size * METRES[unit]:.2f} m" for unit in units]
        what_to_do = (
            f"{', and '.join(fits)}. Multiply {ALL} by {METRES[units[0]]:g}"
            f"{f', if it is in {units[0]}' if len(units) > 1 else ''}."
            if units
            else f"{model.family} is {least:g} to {most:g}. Find out its unit, and multiply {ALL} "
            "by the metres in it."
        )
        yield FileFinding(
            "v_template",
            f"The model is {size:.4g} large, in metres, which is not the size of {model.family}: "
            f"{what_to_do}",
        )
    for key, array, limit, what in (
        ("shapedirs", model.shapedirs, LARGEST_SHAPE, "one unit of a beta"),
        ("posedirs", model.posedirs, LARGEST_POSE, "a pose"),
    ):
        largest = 0.0 if array is None or not array.size else float(abs(array).max())
        if largest > limit * size:
            yield FileFinding(
                key,
                f"{key} has entries up to {largest:.3g}, where the whole model is {size:.3g} "
                f"large: {what} would tear it apart. {key} is in another unit than v_template, or "
                "is not divided by what its coefficients were multiplied with: scale it.",
            )


def directions(model: ModelArrays) -> dict[str, Array]:
    """Up, left and front (3,) by the joints whose names say them, where there are such names."""
    joints = model.joints
    if joints is None or model.n_joints != len(model.names):
        return {}
    at = dict(zip(model.names, joints, strict=True))
    found = {
        "left": _mean_of_pairs(at),
        "up": _difference(at, ("head", "neck"), ("left_ankle", "right_ankle", "pelvis"))
        if model.family != "FLAME"
        else _difference(at, ("left_eye", "right_eye"), ("root",)),
        "front": _difference(at, ("left_foot", "right_foot"), ("left_ankle", "right_ankle")),
    }
    return {name: way for name, way in found.items() if way is not None and np.any(way)}


def _mean_of_pairs(at: Mapping[str, Array]) -> Array | None:
    """The mean difference from joints on the right to those on the left."""
    pairs = [
        (name, f"right_{name.removeprefix('left_')}") for name in at if name.startswith("left_")
    ]
    ways = [at[left] - at[right] for left, right in pairs if right in at]
    return np.asarray(np.mean(ways, axis=0)) if ways else None


def _difference(
    at: Mapping[str, Array], to: tuple[str, ...], start: tuple[str, ...]
) -> Array | None:
    ends = [[at[name] for name in names if name in at] for names in (to, start)]
    if not all(ends):
        return None
    return np.asarray(np.mean(ends[0], axis=0) - np.mean(ends[1], axis=0))


def axis_of(way: Array) -> str:
    """The axis along which a direction is longest: `y` or `-z`."""
    k = int(np.argmax(abs(way)))
    return f"{'-' if way[k] < 0 else ''}{AXES[k]}"


def _axes(model: ModelArrays) -> Iterator[FileFinding]:
    ways = directions(model)
    axes = {name: axis_of(way) for name, way in ways.items()}
    if len(axes) == 3 and np.linalg.det(np.array([ways[n] for n in ("left", "up", "front")])) < 0:
        yield FileFinding(
            "v_template",
            "Left and right are swapped: seen from the front, the joints that are called left are "
            "on the person's right. The model was mirrored, or its joints were named for the other "
            "side. Exchange left and right in joint_names, or mirror the whole model with "
            "workbench.bodies.hands.",
        )
        return
    up = axes.get("up", "y")
    if up != "y":
        yield FileFinding(
            "v_template",
            f"The model stands along {up}, but y points up here. Export it again with y up, or "
            f"begin every pose with the root turned by {_turn(UP_TO_Y[up])} rad. Turning "
            "v_template, shapedirs and posedirs alone is not enough: the 9 columns of each joint "
            "in posedirs belong to rotations about the old axes.",
        )
    elif axes.get("left", "x") != "x":
        x, _, z = ways["left"]
        angle = float(np.arctan2(z, x))  # which a turn about y takes to the x axis
        yield FileFinding(
            "v_template",
            f"The left side of the model is along {axes['left']}, but here it is along x, and the "
            f"body faces z. Export it again so, or begin every pose with the root turned by (0, "
            f"{angle:.4f}, 0) rad.",
        )


def _turn(rotation: Array) -> str:
    """A rotation as the rotation vector of a root joint, for a sentence."""
    numbers = (float(x) + 0.0 for x in np.round(vector_from_matrix(rotation), 4))
    return "(" + ", ".join(f"{x:.4f}".rstrip("0").rstrip(".") for x in numbers) + ")"


def _inwards(model: ModelArrays) -> Iterator[FileFinding]:
    faces, template = model.faces, model.template
    if faces is None or template is None or not len(faces):
        return
    if faces.min() >= 0 and faces.max() < len(template) and volume(template, faces) < 0:
        yield FileFinding(
            "f",
            "The faces look inwards: seen from outside, their corners run clockwise, so that the "
            "surface is drawn inside out and its normals point into the body. Reverse the corners: "
            "f[:, ::-1]. A mirrored model needs this too.",
        )


LONG = ("index", "middle", "ring", "pinky")
SIDES = {"l": "left", "r": "right"}
# the correlation of stretches along x with those along y and z, below which x is turned
OPPOSED = -0.5
DECIDED = 0.1  # of the largest chirality, 1: below it a hand may be either


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


def hands_in_file(model: ModelArrays) -> list[Hand]:
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
    for hand in hands_in_file(model):
        yield from _side(hand)
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
