"""Reading the bodies that come with the workbench, in the compact form that the builder wrote."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies.body import Landmarks
from workbench.bodies.capsules import Capsules
from workbench.bodies.readonly import locked
from workbench.bodies.sewn_hands import Sewing, with_hands
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadFile
from workbench.reading.arrays import (
    AGAIN,
    Kind,
    check_numbers,
    opened,
    read_expected,
    reals,
    texts,
    wholes,
)
from workbench.reading.facts import facts_in

REPAIR = f"{AGAIN}, or build the body again"
PARTS = ("rows", "columns", "shares")  # of a sparse matrix of whole numbers
SYNTHETIC = (
    "the people behind this body were made by a program from shapes that artists modelled, and a "
    "synthetic teacher says what pose does to their skin; no body was measured or scanned, only "
    "poses were recorded from people"
)
HAND_SYNTHETIC = (
    "the people behind this hand were made by a program from shapes that artists modelled, a "
    "synthetic teacher says what pose does to their skin, and their poses were made up as well; no "
    "hand was measured or scanned"
)


STEPS = Kind("whole numbers of 16 bits", frozenset({"i2"}), np.asarray)
EXPECTED = {
    "template": reals("N", 3),
    "shapedirs": STEPS("N", 3, "B"),
    "shapedirs_step": reals(),
    "posedirs": STEPS("P", 3, "N"),  # the axes are reversed, which compresses better
    "posedirs_step": reals(),
    "weight_joints": wholes("N", 4),
    "weight_shares": wholes("N", 4),
    "joint_names": texts("K"),
    "parents": wholes("K"),
    "faces": wholes("F", 3),
    **{f"J_regressor_{part}": wholes("entries of J_regressor") for part in PARTS},
    "card": texts(),
}
WHOLE_BODY = {  # what the file of a body has besides
    "mirror": wholes("N"),
    "coco_names": texts("M"),
    **{f"coco_{part}": wholes("entries of coco") for part in PARTS},
}
HAND = {  # and that of a hand
    "tips_names": texts("M"),
    **{f"tips_{part}": wholes("entries of tips") for part in PARTS},
    "hands_mean": reals("Q"),
    "hands_components": reals("C", "Q"),
    "hands_deviations": reals("C"),
}
CAPSULES = {
    "names": texts("C"),
    "joints": wholes("C"),
    "ends": reals("C", 2, 3),
    "end_slopes": reals("C", 2, 3, "B"),
    "radii": reals("C"),
    "radius_slopes": reals("C", "B"),
    "pairs": wholes("P", 2),
}


def embedded(name: str) -> SkinnedBody:
    """One of the bodies in workbench/data/bodies, each read when it is asked for."""
    with as_file(files("workbench") / "data" / "bodies" / f"{name}.npz") as packed:
        body = read_embedded(packed)
    with as_file(files("workbench") / "data" / "bodies" / "capsules.npz") as packed:
        return replace(body, capsules=read_capsules(packed, name))


def embedded_hand() -> SkinnedBody:
    """The right hand in workbench/data/bodies."""
    with as_file(files("workbench") / "data" / "bodies" / "hand.npz") as packed:
        return read_embedded(packed)


def read_capsules(path: Path, name: str) -> Capsules:
    """The capsules of the embedded body of this name. Raises BadFile, or BadBody as Capsules."""
    expected = {f"{name}/{key}": what for key, what in CAPSULES.items()}
    with opened(path, "file of capsules", REPAIR) as archive:
        arrays = read_expected(archive, expected)
    return Capsules.from_arrays({key: arrays[f"{name}/{key}"] for key in CAPSULES})


def read_embedded(path: Path) -> SkinnedBody:
    """A body from a file in the compact form of the embedded bodies, in metres, y up, facing +z.

    Raises BadFile if the file is missing or is not one, BadBody if its arrays do not fit together.
    """
    with opened(path, "embedded body", REPAIR) as archive:
        own = HAND if "hands_mean" in archive.headers else WHOLE_BODY
        arrays = read_expected(archive, EXPECTED | own)
        parts = _unpacked(arrays, facts_in(arrays["card"]).entries)
    return SkinnedBody(**parts, name=path.stem)


def _unpacked(arrays: dict[str, NDArray[Any]], card: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of SkinnedBody, from the arrays of a file."""
    N, joint_names = len(arrays["template"]), tuple(map(str, arrays["joint_names"]))
    weights = np.zeros((N, len(joint_names)))
    check_numbers("weight_joints", arrays["weight_joints"], len(joint_names))
    np.put_along_axis(weights, arrays["weight_joints"], arrays["weight_shares"], axis=1)
    posedirs = np.ascontiguousarray(arrays["posedirs"].T) * float(arrays["posedirs_step"])
    # of a hand the tips of its fingers, and its pose space under the names that MANO's files use
    hand = "hands_mean" in arrays
    extras = ("hands_mean", "hands_components", "hands_deviations") if hand else ()
    marks = "tips" if hand else "coco"
    names = tuple(map(str, arrays[f"{marks}_names"]))
    landmarks = Landmarks(names, _regressor(arrays, marks, (len(names), N)))
    return {
        "template": locked(arrays["template"]),
        "shapedirs": locked(arrays["shapedirs"] * float(arrays["shapedirs_step"])),
        "posedirs": locked(posedirs),
        "J_regressor": _regressor(arrays, "J_regressor", (len(joint_names), N)),
        "weights": locked(weights / _totals("weight_shares", weights)),
        "parents": tuple(int(parent) for parent in arrays["parents"]),
        "faces": arrays["faces"],
        "joint_names": joint_names,
        "mirror": arrays.get("mirror"),
        "landmarks": {marks: landmarks},
        "extras": {name: arrays[name] for name in extras},
        "card": {"synthetic": HAND_SYNTHETIC if hand else SYNTHETIC} | dict(card),
    }


def _regressor(arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, int]) -> csr_array:
    """Rows that sum to one, from whole shares of each."""
    rows, columns, shares = (arrays[f"{name}_{part}"] for part in PARTS)
    check_numbers(f"{name}_rows", rows, shape[0])
    check_numbers(f"{name}_columns", columns, shape[1])
    matrix = csr_array((shares.astype(np.float64), (rows, columns)), shape=shape)
    return csr_array(matrix.multiply(1 / _totals(f"{name}_shares", matrix)))


def _totals(name: str, shares: Array | csr_array) -> Array:
    """The sum of each row, (rows, 1)."""
    totals: Array = np.asarray(shares.sum(axis=1), dtype=np.float64)
    if not (totals > 0).all():
        raise BadFile(f"{name} of row {int(np.argmin(totals))} are not above zero together")
    return totals[:, None]


LEARNED = {
    "near": wholes("F", "J"),
    "posedirs": STEPS("F", 3, 3, "T"),
    "posedirs_step": reals(),
    "card": texts(),
}
UNTRAINED: dict[str, tuple[str, Callable[[SkinnedBody], TriangleBody]]] = {
    "small-scape": ("small", scape),
    "small-blend-scape": ("small", blend_scape),
    "default-scape": ("default", scape),
    "default-blend-scape": ("default", blend_scape),
}  # the skinned body whose mesh, tree and shape space each has, and the model that it follows


def embedded_triangles(name: str) -> TriangleBody:
    """One of the bodies in `UNTRAINED`, with its learned posedirs.

    Everything but posedirs is that of the skinned body, written as deformations of triangles.
    """
    with as_file(files("workbench") / "data" / "bodies" / f"{name}.npz") as packed:
        return read_embedded_triangles(packed, *UNTRAINED[name])


def read_embedded_triangles(
    path: Path, mesh: str, model: Callable[[SkinnedBody], TriangleBody]
) -> TriangleBody:
    """A model of the embedded body `mesh` with the posedirs of a file, called like the file.

    Raises BadFile if the file is missing or is not one, BadBody if its arrays do not fit the body.
    """
    skinned = embedded(mesh)
    body = model(skinned)
    with opened(path, "embedded body", REPAIR) as archive:
        arrays = read_expected(archive, LEARNED)
        card = facts_in(arrays["card"]).entries
        check_numbers("near", arrays["near"], body.n_joints)
    learned = np.asarray(arrays["posedirs"] * float(arrays["posedirs_step"]), dtype=np.float64)
    return replace(
        body,
        posedirs=locked(learned),
        near=arrays["near"],
        name=path.stem,
        card={**card, "skinned_body": dict(skinned.card)},
    )


PLACED = {"bodies": texts("G"), "vertices": wholes("H"), "held": reals("G", 16, 3)}
SEWN = {"full-hands": "full", "full-hands-female": "full-female", "full-hands-male": "full-male"}


def embedded_with_hands(name: str) -> SkinnedBody:
    """One of the bodies in `SEWN`, sewn together when it is asked for.

    Its own file says only where the hand is on the body, and how the body holds its fingers.
    Raises BadFile if a file is missing or is not one, BadBody if they do not fit together.
    """
    body = embedded(SEWN[name])
    return with_hands(body, embedded_hand(), sewing_of(body.name), name)


def sewing_of(body: str) -> Sewing:
    """Where the hand is on one of the bodies that `SEWN` names. Raises BadFile."""
    with (
        as_file(files("workbench") / "data" / "bodies" / "full-hands.npz") as packed,
        opened(packed, "file of a hand's place", REPAIR) as archive,
    ):
        arrays = read_expected(archive, PLACED)
    names = [str(name) for name in arrays["bodies"]]
    if body not in names:
        raise BadFile(f"full-hands.npz does not say how {body!r} holds its fingers; {REPAIR}")
    return Sewing(arrays["vertices"], arrays["held"][names.index(body)])
