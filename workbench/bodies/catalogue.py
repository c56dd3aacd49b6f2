"""The bodies that come with the workbench, in the compact form of its builder; those in files."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from importlib.resources import as_file, files
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args, overload

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies.body import Landmarks
from workbench.bodies.capsules import Capsules
from workbench.bodies.files.layouts import body_from, is_triangle_body, triangle_body_from
from workbench.bodies.files.reading import contents_of
from workbench.bodies.hands import mirrored
from workbench.bodies.readonly import locked
from workbench.bodies.sewn_hands import Sewing, with_hands
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.environment import expanded
from workbench.errors import BadBody, BadFile, listed
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


def packed(name: str) -> AbstractContextManager[Path]:
    """The file of this name in workbench/data/bodies."""
    return as_file(files("workbench") / "data" / "bodies" / f"{name}.npz")


def embedded(name: str) -> SkinnedBody:
    """One of the bodies in workbench/data/bodies, each read when it is asked for."""
    with packed(name) as path, packed("capsules") as capsules:
        return replace(read_embedded(path), capsules=read_capsules(capsules, name))


def embedded_hand() -> SkinnedBody:
    """The right hand in workbench/data/bodies."""
    with packed("hand") as path:
        return read_embedded(path)


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
        further = HAND if "hands_mean" in archive.headers else WHOLE_BODY
        arrays = read_expected(archive, EXPECTED | further)
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


LEARNED_POSEDIRS = {
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
    with packed(name) as path:
        return read_embedded_triangles(path, *UNTRAINED[name])


def read_embedded_triangles(
    path: Path, mesh: str, model: Callable[[SkinnedBody], TriangleBody]
) -> TriangleBody:
    """A model of the embedded body `mesh` with the posedirs of a file, called like the file.

    Raises BadFile if the file is missing or is not one, BadBody if its arrays do not fit the body.
    """
    skinned = embedded(mesh)
    body = model(skinned)
    with opened(path, "embedded body", REPAIR) as archive:
        arrays = read_expected(archive, LEARNED_POSEDIRS)
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


HANDS_PLACE = {
    "bodies": texts("G"),
    "held": reals("G", 16, 3),
    "origin": wholes("N"),
    "faces": wholes("F", 3),
    "mirror": wholes("N"),
    "left": wholes("H"),
    "right": wholes("H"),
}
SEWN = {"full-hands": "full", "full-hands-female": "full-female", "full-hands-male": "full-male"}


def embedded_with_hands(name: str) -> SkinnedBody:
    """One of the bodies in `SEWN`, sewn together when it is asked for.

    Its own file has the mesh, and says how the body holds its fingers.
    Raises BadFile if a file is missing or is not one, BadBody if they do not fit together.
    """
    body = embedded(SEWN[name])
    return with_hands(body, embedded_hand(), sewing_of(body.name), name)


def sewing_of(body: str) -> Sewing:
    """How one of the bodies that `SEWN` names is sewn to hands. Raises BadFile."""
    with packed("full-hands") as path, opened(path, "file of a hand's place", REPAIR) as archive:
        arrays = read_expected(archive, HANDS_PLACE)
    names = [str(name) for name in arrays["bodies"]]
    if body not in names:
        raise BadFile(f"full-hands.npz does not say how {body!r} holds its fingers; {REPAIR}")
    hands = {side: arrays[side] for side in ("left", "right")}
    pose = arrays["held"][names.index(body)]
    return Sewing(arrays["origin"], arrays["faces"], arrays["mirror"], hands, pose)


Embedded = Literal[  # of these, type checkers know that they are skinned
    "default",
    "default-female",
    "default-male",
    "small",
    "full",
    "full-female",
    "full-male",
]
WithHands = Literal["full-hands", "full-hands-female", "full-hands-male"]  # skinned as well
Hands = Literal["hand", "hand-left"]  # and these
EmbeddedTriangles = Literal[
    "small-scape", "small-blend-scape", "default-scape", "default-blend-scape"
]


BODIES: dict[str, Callable[[], SkinnedBody | TriangleBody]] = {
    **{name: partial(embedded, name) for name in get_args(Embedded)},
    **{name: partial(embedded_with_hands, name) for name in get_args(WithHands)},
    "hand": embedded_hand,
    "hand-left": lambda: mirrored(embedded_hand(), "hand-left"),
    **{name: partial(embedded_triangles, name) for name in get_args(EmbeddedTriangles)},
}  # a body of your own is a function without arguments that returns it, and a line here


@overload
def load_body(name_or_path: Embedded | WithHands | Hands = "default") -> SkinnedBody: ...
@overload
def load_body(name_or_path: EmbeddedTriangles) -> TriangleBody: ...
@overload
def load_body(name_or_path: str | Path) -> SkinnedBody | TriangleBody: ...
def load_body(name_or_path: str | Path = "default") -> SkinnedBody | TriangleBody:
    """A body of the catalogue by its name in `BODIES`, or the body in an .npz or .pkl file.

    Files are in the layout of SMPL (SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR and the like), or were
    written by `save_body`; `check_body_file` says what is wrong with one. The first bytes of a file
    tell what it is; its name does not. A file whose `bs_style` is `triangles` holds a TriangleBody,
    all others hold a SkinnedBody. Nothing in a file is ever run, changed or copied. `Path("small")`
    means a file that is called like a body.

    Arrays that a body does not compute with, such as the principal components of MANO's hands or
    the face landmarks of SMPL-X, are the body's `extras`. Entries that cannot be kept, such as
    Python objects, are named with the reason in the body's card under `left_out`.

    Raises BadFile (UnsafePickle) if there is no such body or file, or it is not a body, and
    BadBody if its arrays do not fit together.
    """
    if isinstance(name_or_path, str) and name_or_path in BODIES:
        return BODIES[name_or_path]()
    if not isinstance(name_or_path, (str, PathLike)):
        raise BadFile(
            f"a body is loaded by name or from a path, not by a {type(name_or_path).__name__}; "
            f"the bodies are {listed(BODIES)}"
        )
    path = expanded(name_or_path)
    if not path.exists():
        raise BadFile(
            f"no body is called {str(name_or_path)!r}, and there is no such file; "
            f"the bodies are {listed(BODIES)}, or give the path of an .npz or .pkl file"
        )
    raw = contents_of(path)
    make = triangle_body_from if is_triangle_body(raw) else body_from
    return make(raw, path.stem, str(path))


def load_skinned(name_or_path: str | Path = "default") -> SkinnedBody:
    """A body with a chain of bones and weights for each vertex; otherwise as `load_body`.

    Raises what `load_body` raises, and BadBody for a TriangleBody.
    """
    body = load_body(name_or_path)
    if isinstance(body, SkinnedBody):
        return body
    skinned = (*get_args(Embedded), *get_args(WithHands), *get_args(Hands))
    raise BadBody(
        f"a SkinnedBody is needed here, but body {body.name!r} is a TriangleBody; the skinned "
        f"bodies are {listed(skinned)}, or give a file of another kind"
    )
