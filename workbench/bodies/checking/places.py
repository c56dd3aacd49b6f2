"""Findings about where a model is: its unit, the axes, its sides, and which way its faces look."""

from collections.abc import Iterator, Mapping

import numpy as np

from workbench.arrays import Array
from workbench.bodies.checking.findings import FileFinding
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.geometry.guesses import TURNS
from workbench.geometry.rotation import vector_from_matrix

SIZES = {  # m, the largest extent of a model of each family
    "SMPL": (0.3, 2.6),
    "SMPL-H": (0.3, 2.6),
    "SMPL-X": (0.3, 2.6),
    "MANO": (0.06, 0.4),
    "FLAME": (0.12, 0.6),
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
    size, limits = model.size, SIZES.get(model.family)
    if limits is not None and not limits[0] <= size <= limits[1]:
        fits = [unit for unit, m in METRES.items() if limits[0] <= size * m <= limits[1]]
        if fits:
            in_metres = size * METRES[fits[0]]
            yield FileFinding(
                "v_template",
                f"The model is {size:.4g} large, in metres, which is too large for {model.family}; "
                f"in {fits[0]} it would be {in_metres:.2f} m. Multiply {ALL} by "
                f"{METRES[fits[0]]:g}.",
            )
        else:
            yield FileFinding(
                "v_template",
                f"The model is {size:.4g} large, in metres, but {model.family} is "
                f"{limits[0]:g} to {limits[1]:g}. Find out its unit, and multiply {ALL} by the "
                "metres in it.",
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
            "workbench.bodies.mirrored.",
        )
        return
    up = axes.get("up", "y")
    if up != "y":
        yield FileFinding(
            "v_template",
            f"The model stands along {up}, but y points up here. Export it again with y up, or "
            f"begin every pose with the root turned by {_turn(TURNS[up])} rad. Turning v_template, "
            "shapedirs and posedirs alone is not enough: the 9 columns of each joint in posedirs "
            "belong to rotations about the old axes.",
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
    return "(" + ", ".join(f"{x:.4f}".rstrip("0").rstrip(".") for x in _vector(rotation)) + ")"


def _vector(rotation: Array) -> list[float]:
    return [float(x) + 0.0 for x in np.round(vector_from_matrix(rotation), 4)]


def _inwards(model: ModelArrays) -> Iterator[FileFinding]:
    volume = signed_volume(model)
    if volume < 0:
        yield FileFinding(
            "f",
            "The faces look inwards: seen from outside, their corners run clockwise, so that the "
            "surface is drawn inside out and its normals point into the body. Reverse the corners: "
            "f[:, ::-1]. A mirrored model needs this too.",
        )


def signed_volume(model: ModelArrays) -> float:
    """The volume that the faces enclose, negative if they look inwards; 0 if it cannot be found."""
    faces, template = model.faces, model.template
    if faces is None or template is None or not len(faces):
        return 0.0
    if faces.min() < 0 or faces.max() >= len(template):
        return 0.0
    a, b, c = np.moveaxis((template - template.mean(axis=0))[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
