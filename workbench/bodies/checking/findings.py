"""Findings about a model: its arrays, the tree of its joints, its betas, where it is, its hands."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.bodies.checking.model_arrays import FileFinding, ModelArrays, of_all, row_name
from workbench.bodies.files.joint_names import FINGER_JOINTS, NAMES, TREES
from workbench.bodies.spaces import FACE_BETAS, WITH_FACE
from workbench.bodies.validation import ROW_SUM_TOLERANCE
from workbench.geometry.guesses import UP_TO_Y
from workbench.geometry.mirror import opposite
from workbench.geometry.rotation import vector_from_matrix
from workbench.geometry.solids import volume


def about_numbers(model: ModelArrays) -> Iterator[FileFinding]:
    """Weights, regressor, faces, columns of posedirs."""
    for key, rows, what, harm in (
        ("weights", model.weights, "vertices", "they lag behind where the body moves"),
        ("J_regressor", model.regressor, "joints", "they are not where their vertices are"),
    ):
        if rows is None:
            continue
        sums = np.asarray(rows.sum(axis=1)).ravel()
        wrong: Mask = np.asarray(~(abs(sums - 1) <= ROW_SUM_TOLERANCE))
        if wrong.any():
            worst = int(np.argmax(abs(sums - 1)))
            named = f"vertex {worst}" if key == "weights" else row_name(model.names, worst)
            yield FileFinding(
                key,
                f"The weights of {of_all(wrong, what)} do not sum to 1, those of {named} to "
                f"{sums[worst]:.4g}, so that {harm}. Divide each row by its sum, if it is not "
                f"zero; otherwise take {key} from the original file.",
            )
    if (W := model.weights) is not None and W.min() < -ROW_SUM_TOLERANCE:
        negative: Mask = np.asarray((W < -ROW_SUM_TOLERANCE).any(axis=1))
        yield FileFinding(
            "weights",
            f"{of_all(negative, 'vertices')} have weights below zero, down to {W.min():.3g}, and "
            "move against their joints. Set them to zero and divide each row by its sum.",
        )
    yield from _faces(model)
    yield from _posedirs(model)


def _faces(model: ModelArrays) -> Iterator[FileFinding]:
    if model.faces is None or model.template is None or not model.faces.size:
        return
    N, faces = len(model.template), model.faces
    outside: Mask = np.asarray(((faces < 0) | (faces >= N)).any(axis=1))
    if faces.min() == 1 and faces.max() == N:
        yield FileFinding(
            "f",
            f"The faces count vertices from 1 to {N}, as .obj files do, but must count from 0. "
            "Subtract 1 from f.",
        )
    elif outside.any():
        first = int(np.argmax(outside))
        yield FileFinding(
            "f",
            f"{of_all(outside, 'faces')} name vertices that do not exist: face {first} is "
            f"{faces[first].tolist()}, and there are vertices 0 to {N - 1}. The faces are those of "
            "another mesh, or vertices were removed: take both from one file.",
        )


def _posedirs(model: ModelArrays) -> Iterator[FileFinding]:
    if model.posedirs is None or not model.n_joints:
        return
    K, P = model.n_joints, model.posedirs.shape[2]
    smpl, star = 9 * (K - 1), 4 * (K - 1) + 1
    if P not in (smpl, star):
        other = f" They are as many as {P // 9 + 1} joints have." if P % 9 == 0 else ""
        yield FileFinding(
            "posedirs",
            f"posedirs has {P} columns, but {K} joints have {smpl} of SMPL's pose features or "
            f"{star} of STAR's.{other} Take posedirs and kintree_table from one file.",
        )


REORDER = (
    "Sort the joints so that parents come before their children: the columns of kintree_table and "
    "weights, the rows of J_regressor, and the groups of 9 columns of posedirs, all in one order"
)


def about_tree(model: ModelArrays) -> Iterator[FileFinding]:
    """The order of joints in kintree_table, and whether the other arrays have the same order."""
    table = model.table
    if table is None or not table.shape[1]:
        return
    numbers = np.arange(table.shape[1])
    swapped = np.array_equal(table[0], numbers)
    if not np.array_equal(table[1, 1:], numbers[1:]):
        yield FileFinding(
            "kintree_table",
            "The rows of kintree_table are swapped: row 0 must be the parents, row 1 the numbers "
            "of the joints. Swap them: kintree_table[::-1]."
            if swapped
            else "Row 1 of kintree_table must number the joints 0, 1, 2, ..., but begins "
            f"{table[1, :5].tolist()}. {REORDER}; then number them anew.",
        )
        return
    yield from _order(model, table)
    yield from _of_family(model)


def _order(model: ModelArrays, table: Index) -> Iterator[FileFinding]:
    K, parents = table.shape[1], table[0]
    for k in range(1, K):
        if not 0 <= parents[k] < k:
            who = f"{row_name(model.names, k).capitalize()} has parent {int(parents[k])}"
            yield FileFinding(
                "kintree_table",
                f"{who}, which does not come before it. {REORDER}."
                if 0 <= parents[k] < K
                else f"{who}, which is no joint: there are joints 0 to {K - 1}, and joint 0 alone "
                "has no parent. Give it its parent, or leave the joint out.",
            )
            return


def _of_family(model: ModelArrays) -> Iterator[FileFinding]:
    """A tree of as many joints as a model of the family has, but another one."""
    K, parents = model.n_joints, model.parents
    if parents is None or K not in NAMES or "joint_names" in model.raw:
        return
    name = NAMES[K][0]
    wrong = [k for k in range(K) if parents[k] != TREES[name][k]]
    if wrong:
        k = wrong[0]
        names = model.names
        yield FileFinding(
            "kintree_table",
            f"There are {K} joints as in {name}, but the tree is another one: the parent of "
            f"{row_name(names, k)} is {row_name(names, parents[k])}, and in {name} it is "
            f"{row_name(names, TREES[name][k])}. The names that are shown are {name}'s and may be "
            "wrong. If the joints are in another order, sort them; otherwise add joint_names.",
        )


LEAST_DIRECTION = 1e-9  # of the largest direction, below which a direction moves nothing


def model_of(model: ModelArrays) -> str:
    """The family, or STAR by its pose features."""
    P = 0 if model.posedirs is None else model.posedirs.shape[2]
    K = model.n_joints
    return "STAR" if K > 1 and P == 4 * (K - 1) + 1 else model.family


def about_spaces(model: ModelArrays) -> Iterator[FileFinding]:
    """Shape directions that do nothing, and numbers of them of which no expression is told."""
    if model.shapedirs is None:
        return
    B, name = model.shapedirs.shape[2], model_of(model)
    if not B:
        return
    largest = np.abs(model.shapedirs).max(axis=(0, 1), initial=0.0)
    acting = int(np.flatnonzero(largest > LEAST_DIRECTION * largest.max()).max(initial=-1)) + 1
    if acting < B:
        yield FileFinding(
            "shapedirs",
            f"Only the first {acting} of {B} shape directions do anything; the others are zero, "
            "and their betas cannot be found by any fit. Take the file with all directions, or "
            f"keep shapedirs[:, :, :{acting}].",
        )
    if name in WITH_FACE and B not in FACE_BETAS:
        yield FileFinding(
            "shapedirs",
            f"There are {B} shape directions, but files of {name} have 400 (300 of shape and 100 "
            "of expression) or 20 (10 of each). Here all of them count as shape, and the package "
            "smplx takes directions 10 to 19 for expressions. Take a file of 400 or 20.",
        )


SIZES = {  # m, the largest extent of a model of each family: at least, usually, at most
    "SMPL": (0.3, 1.7, 2.6),
    "SMPL-H": (0.3, 1.7, 2.6),
    "SMPL-X": (0.3, 1.7, 2.6),
    "MANO": (0.06, 0.2, 0.4),
    "FLAME": (0.12, 0.28, 0.6),
}
METRES = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048}
LARGEST_SHAPE, LARGEST_POSE = 0.3, 1.0  # of the size of a model, of an entry of shapedirs, posedirs
ELSEWHERE = 0.7  # of the median distance from joints to all parts: a joint as far from its own part
AXES = ("x", "y", "z")
IN_METRES = "v_template, shapedirs and posedirs"


def about_places(model: ModelArrays) -> Iterator[FileFinding]:
    """The unit, the directions of up, left and front, and the side to which faces look."""
    if model.template is None or not model.size > 0:
        return
    yield from _unit(model)
    yield from _axes(model)
    yield from _columns_of_weights(model)
    faces, template = model.faces, model.template
    if faces is None or not len(faces) or faces.min() < 0 or faces.max() >= len(template):
        return
    if volume(template, faces) < 0:
        yield FileFinding(
            "f",
            "The faces look inwards: seen from outside, their corners run clockwise, so that the "
            "surface is drawn inside out and its normals point into the body. Reverse the corners: "
            "f[:, ::-1]. A mirrored model needs this too.",
        )


def _columns_of_weights(model: ModelArrays) -> Iterator[FileFinding]:
    """Whether joints are among the vertices that they move, or no nearer to them than others."""
    W, template, joints = model.weights, model.template, model.joints
    if W is None or template is None or joints is None or W.shape != (len(template), len(joints)):
        return
    sums = W.sum(axis=0)
    moving = np.flatnonzero(sums > 0)
    if len(moving) < 2:
        return
    middles = (W[:, moving].T @ template) / sums[moving, None]
    away = np.linalg.norm(middles[:, None] - joints[moving], axis=2)  # vertices of k, joint l
    if np.median(np.diag(away)) > ELSEWHERE * np.median(away):
        yield FileFinding(
            "weights",
            "Joints are no nearer to the vertices that they move than to those of other joints. "
            "The columns of weights and the rows of J_regressor are in different orders: bring "
            "both into the order of kintree_table.",
        )


def _unit(model: ModelArrays) -> Iterator[FileFinding]:
    size = model.size
    least, usual, most = SIZES.get(model.family, (0.0, size, np.inf))
    if not least <= size <= most:
        units = [unit for unit, metres in METRES.items() if least <= size * metres <= most]
        units.sort(key=lambda unit: abs(np.log(size * METRES[unit] / usual)))
        fits = [f"in {unit} it would be {size * METRES[unit]:.2f} m" for unit in units]
        what_to_do = (
            f"{', and '.join(fits)}. Multiply {IN_METRES} by {METRES[units[0]]:g}"
            f"{f', if it is in {units[0]}' if len(units) > 1 else ''}."
            if units
            else f"{model.family} is {least:g} to {most:g}. Find out its unit, and multiply "
            f"{IN_METRES} by the metres in it."
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
    places = dict(zip(model.names, joints, strict=True))
    left = [name for name in places if name.startswith("left_") and opposite(name) in places]
    ends = {
        "left": (left, [opposite(name) for name in left]),
        "up": (["head", "neck"], ["left_ankle", "right_ankle", "pelvis"]),
        "front": (["left_foot", "right_foot"], ["left_ankle", "right_ankle"]),
    }
    ways = {}
    for name, (to, start) in ends.items():
        ends_of = [[places[joint] for joint in joints if joint in places] for joints in (to, start)]
        if all(ends_of):
            ways[name] = np.mean(ends_of[0], axis=0) - np.mean(ends_of[1], axis=0)
    return {name: way for name, way in ways.items() if np.any(way)}


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
        turn = ", ".join(f"{x + 0.0:.4g}" for x in np.round(vector_from_matrix(UP_TO_Y[up]), 4))
        yield FileFinding(
            "v_template",
            f"The model stands along {up}, but y points up here. Export it again with y up, or "
            f"begin every pose with the root turned by ({turn}) rad. Turning "
            "v_template, shapedirs and posedirs alone is not enough: the 9 columns of each joint "
            "in posedirs belong to rotations about the old axes.",
        )


LONG_FINGERS = ("index", "middle", "ring", "pinky")
# the correlation of stretches along x with those along y and z, below which x is turned
OPPOSED = -0.5
DECIDED = 0.1  # of the largest chirality, 1: below it a hand may be either


@dataclass(frozen=True)
class Hand:
    """A hand: the `letter` at the end of its keys, its `side` as the file says, its chirality.

    That is above 0 for a left hand and below 0 for a right one, if the mean pose closes the
    fingers: the volume that is spanned by the direction of the fingers, that from the little
    finger to the index finger, and that in which the mean pose bends.
    """

    letter: str
    side: str
    chirality: float


def hands_in_file(model: ModelArrays) -> list[Hand]:
    """The hands that a file has: one in MANO's layout, two in SMPL-H's and SMPL-X's."""
    joints = model.joints
    if joints is None or len(model.names) != len(joints):
        return []
    places_of, hands = dict(zip(model.names, joints, strict=True)), []
    in_name = [side for side in ("left", "right") if side in Path(model.where).stem.lower()]
    for letter, side in (("", ""), ("l", "left"), ("r", "right")):
        prefix = f"{side}_" if side else ""
        places = {name: places_of.get(prefix + name) for name in ("wrist", *FINGER_JOINTS)}
        ends = {name: place for name, place in places.items() if place is not None}
        if len(ends) == len(places):
            mean = model.extra(f"hands_mean{letter}")
            pose = np.zeros(45) if mean is None or mean.size != 45 else mean.astype(np.float64)
            said = side or (in_name[0] if len(in_name) == 1 else "")
            hands.append(Hand(letter, said, _chirality(ends, pose.reshape(15, 3))))
    return hands


def _chirality(places: Mapping[str, Array], pose: Array) -> float:
    turns = dict(zip(FINGER_JOINTS, pose, strict=True))
    fingers, thumbwards = places["middle1"] - places["wrist"], places["index1"] - places["pinky1"]
    bends = [  # how small turns of its joints move the last joint of each finger
        np.cross(turns[f"{finger}{i}"], places[f"{finger}3"] - places[f"{finger}{i}"])
        for finger in LONG_FINGERS
        for i in (1, 2)
    ]
    ways = np.array([fingers, thumbwards, np.sum(bends, axis=0) / len(LONG_FINGERS)])
    lengths = np.linalg.norm(ways, axis=1)
    if lengths.min() <= 0 or lengths[2] < 0.01 * lengths[0]:
        return 0.0
    return float(np.linalg.det(ways) / np.prod(lengths))


def about_hands(model: ModelArrays) -> Iterator[FileFinding]:
    """The sides of hands: fingers that the mean pose bends backwards, shapes not mirrored."""
    for hand in hands_in_file(model):
        seen = "left" if hand.chirality > 0 else "right"
        if not hand.side or abs(hand.chirality) < DECIDED or seen == hand.side:
            continue
        key = f"hands_mean{hand.letter}"
        if hand.letter:
            text = (
                f"{key} bends the fingers of the {hand.side} hand backwards, as that of the other "
                f"hand would. Mirror it: multiply each rotation vector of {key} and of "
                f"hands_components{hand.letter} by (1, -1, -1)."
            )
        else:
            text = (
                f"The name of the file says {hand.side}, but this is a {seen} hand, by the order "
                f"of its fingers and the way in which {key} closes them. Either the file has a "
                "wrong name, or only some of its arrays were mirrored; bodies.mirrored does it all."
            )
        yield FileFinding(key, text)
    yield from _unmirrored_shapes(model)


def _unmirrored_shapes(model: ModelArrays) -> Iterator[FileFinding]:
    """Shape directions of a hand whose x was not turned when the template was mirrored."""
    template, shapedirs = model.template, model.shapedirs
    if model.family != "MANO" or template is None or shapedirs is None or not shapedirs.shape[2]:
        return
    # how each direction stretches the model along x, y and z: (3, B), by least squares
    centred = np.column_stack([template - template.mean(axis=0), np.ones(len(template))])
    slopes = np.linalg.lstsq(centred, shapedirs.reshape(len(template), -1), rcond=None)[0][:3]
    x, y, z = np.einsum("iib->ib", slopes.reshape(3, 3, -1))
    xy, xz, yz = (a @ b / np.sqrt((a @ a) * (b @ b)) for a, b in ((x, y), (x, z), (y, z)))
    if xy < OPPOSED and xz < OPPOSED and yz > -OPPOSED:
        yield FileFinding(
            "shapedirs",
            "Shape directions that make the hand larger along y and z make it smaller along x: x "
            "of shapedirs was not mirrored with v_template, which is a known mistake of MANO's "
            "left hand. Change its sign, shapedirs[:, 0, :] *= -1; betas that were fitted before "
            "belong to the file as it was.",
        )


CHECKS = (about_numbers, about_tree, about_places, about_spaces, about_hands)
