"""Whether the arrays of a body fit together; if they do not, which of them, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.checks import numbers
from workbench.bodies.body import Body
from workbench.bodies.capsules import Capsules
from workbench.bodies.files.reading import SKINNED, clashes
from workbench.bodies.forward.arrays import SkinnedArrays
from workbench.bodies.forward.features import count_features, rotation_elements
from workbench.bodies.landmarks import Landmarks
from workbench.errors import BadBody, NotNumbers

Refuse = Callable[[str], NoReturn]
Shaped = NDArray[Any] | csr_array
FARTHEST = 1e3  # m
ROW_SUM_TOLERANCE = 1e-3  # single-precision files of many small weights reach 1e-5


class Mirrored(SkinnedArrays, Protocol):
    """A skinned body that may be its own mirror image."""

    @property
    def mirror(self) -> Index | None:
        """The vertex on the other side of each, (N,), or None."""

    @property
    def capsules(self) -> Capsules | None:
        """The tubes with round ends that stand for it, or None."""


def check(body: Mirrored) -> None:
    """Raise BadBody with what is wrong and where, or return."""

    def refuse(reason: str) -> NoReturn:
        raise BadBody(f"body {body.name!r}: {reason}")

    check_tree(refuse, body.parents)
    check_shapes(refuse, {"template": (body.template, ("N", 3))})
    if not len(body.template):
        refuse("template has no vertices")
    N, K = len(body.template), len(body.parents)
    F = 9 * (K - 1)
    if body.features is not rotation_elements:
        B = body.shapedirs.shape[2] if body.shapedirs.ndim == 3 else 0
        try:
            F = count_features(body.features, K, B)
        except Exception as error:
            refuse(f"its features cannot be made of a pose of {K} joints and {B} betas: {error}")
    check_shapes(
        refuse,
        {
            "shapedirs": (body.shapedirs, (N, 3, "B")),
            "posedirs": (body.posedirs, (N, 3, F)),
            "J_regressor": (body.J_regressor, (K, N)),
            "weights": (body.weights, (N, K)),
            "faces": (body.faces, ("F", 3)),
        },
    )
    if len(body.joint_names) != K:
        refuse(f"joint_names has {len(body.joint_names)} names for {K} joints")
    check_finite(refuse, body, ("template", "shapedirs", "posedirs", "weights", "J_regressor"))
    check_sizes(refuse, body, ("template", "shapedirs", "posedirs"))
    with np.errstate(over="ignore", invalid="ignore"):  # sums that overflow are not one
        check_rows(refuse, "weights", body.weights.sum(axis=1), "vertex")
        check_rows(refuse, "J_regressor", np.asarray(body.J_regressor.sum(axis=1)), "joint")
    if body.weights.min(initial=0) < -ROW_SUM_TOLERANCE:
        vertex, joint = np.unravel_index(int(body.weights.argmin()), body.weights.shape)
        refuse(f"weights[{vertex}, {joint}] is negative ({body.weights[vertex, joint]:.3g})")
    if body.faces.size and not 0 <= body.faces.min() <= body.faces.max() < N:
        face = int(np.argmax(((body.faces < 0) | (body.faces >= N)).any(axis=1)))
        refuse(f"face {face} is {body.faces[face].tolist()}, but there are vertices 0 to {N - 1}")
    if body.mirror is not None and not _swaps_pairs(body.mirror, N):
        refuse("mirror must swap vertices in pairs: mirror[mirror] is not 0, 1, 2, ...")
    if body.bind_pose.shape != (K, 3) or not np.isfinite(body.bind_pose).all():
        refuse(f"bound_in must be finite angles ({K}, 3), not an array {body.bind_pose.shape}")
    given = np.zeros((K, 3)) if body.rest_joints is None else body.rest_joints
    if given.shape != (K, 3) or not np.isfinite(given).all():
        refuse(f"rest_joints must be finite places ({K}, 3) m, not an array {given.shape}")
    if own := clashes(body.extras, SKINNED):
        refuse(f"extras must not be called like the body's own arrays in a file: {', '.join(own)}")
    check_landmarks(refuse, body.landmarks, N)
    check_capsules(refuse, body)


def check_capsules(refuse: Refuse, body: Mirrored) -> None:
    """Refuse what is no Capsules, and those that do not fit the joints or the betas."""
    capsules = body.capsules
    if capsules is None:
        return
    if not isinstance(capsules, Capsules):
        refuse(
            f"capsules must be Capsules or None, not something of type {type(capsules).__name__}"
        )
    K, B = len(body.parents), body.shapedirs.shape[2]
    if capsules.radius_slopes.shape[1] != B:
        refuse(f"its capsules are of {capsules.radius_slopes.shape[1]} betas, but it has {B}")
    if capsules.joints.size and not 0 <= capsules.joints.min() <= capsules.joints.max() < K:
        refuse(f"its capsules must be on joints 0 to {K - 1}")


def chosen_vertices(body: Body, vertices: object) -> list[int]:
    """The vertices that a mask (N,) or a list of their numbers chooses; raises BadBody."""
    N, there = body.n_vertices, f"body {body.name!r} has vertices 0 to {body.n_vertices - 1}"
    try:
        found = numbers("vertices", vertices)
    except NotNumbers as error:
        raise BadBody(f"{error}; {there}") from None
    if found.dtype == bool and found.shape == (N,):
        return [int(vertex) for vertex in np.flatnonzero(found)]
    if found.ndim != 1 or (found.size and found.dtype.kind not in "iu"):
        raise BadBody(
            f"{there}; choose some by a list of whole numbers, or by a mask of shape ({N},), "
            f"not by an array of {found.dtype} of shape {found.shape}"
        )
    outside = (found < 0) | (found >= N)
    if outside.any():
        raise BadBody(f"there is no vertex {found[outside][0]}; {there}")
    return [int(vertex) for vertex in found]


def _swaps_pairs(mirror: Index, N: int) -> bool:
    fits = mirror.shape == (N,) and bool(((mirror >= 0) & (mirror < N)).all())
    return fits and np.array_equal(mirror[mirror], np.arange(N))


def check_shapes(
    refuse: Refuse, arrays: Mapping[str, tuple[Shaped, tuple[int | str, ...]]]
) -> None:
    """Refuse an array of another shape than the sizes beside it; a letter stands for any size."""
    for name, (array, expected) in arrays.items():
        found = array.shape
        fits = len(found) == len(expected) and all(
            isinstance(size, str) or size == n for n, size in zip(found, expected, strict=True)
        )
        if not fits:
            refuse(f"{name} has shape {found}, but must be ({', '.join(map(str, expected))})")


def check_finite(refuse: Refuse, body: object, names: Iterable[str]) -> None:
    """Refuse arrays of a body, dense or sparse, with entries that are infinite or not numbers."""
    for name in names:
        array = getattr(body, name)
        if isinstance(array, csr_array):
            if not np.isfinite(array.data).all():
                refuse(f"{name} holds entries that are not finite")
            continue
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            refuse(f"{name}[{', '.join(map(str, bad[0]))}] is not finite ({len(bad)} such entries)")


def check_sizes(refuse: Refuse, body: object, names: Iterable[str]) -> None:
    """Refuse arrays of positions or directions in metres (N, 3, ...) with entries beyond FARTHEST.

    A body of a person in millimetres is refused as well: residuals, priors and starts are in m.
    """
    for name in names:
        array = np.abs(getattr(body, name))
        if array.size and (largest := float(array.max())) > FARTHEST:
            vertex = int(np.unravel_index(int(array.argmax()), array.shape)[0])
            refuse(
                f"{name} of vertex {vertex} has an entry of {largest:.3g} m, and a body has none "
                f"beyond {FARTHEST:,.0f} m; `workbench check-body` says which unit the file is in"
            )


def check_rows(refuse: Refuse, name: str, sums: Array, row: str) -> None:
    """Refuse an array whose rows do not sum to one; `row` is what each belongs to."""
    worst = int(np.argmax(abs(sums - 1)))
    if not abs(sums[worst] - 1) <= ROW_SUM_TOLERANCE:  # nor NaN, of numbers that overflow
        refuse(f"{name} of {row} {worst} sum to {sums[worst]:.6g}, but must sum to 1")


def check_landmarks(refuse: Refuse, sets: Mapping[str, Landmarks], N: int) -> None:
    """Refuse sets of landmarks whose names cannot be used, or that do not fit the mesh."""
    for name, landmarks in sets.items():
        if not isinstance(name, str):
            refuse(f"a set of landmarks has a text for a name, not {name!r}")
        if name == "joints":
            refuse(
                "a set of landmarks called 'joints' could not be reached, for that is what the "
                "body's own joints are called; give it another name"
            )
        if not hasattr(landmarks, "regressor"):
            refuse(
                f"landmarks {name!r} must be Landmarks(names, regressor), not something of type "
                f"{type(landmarks).__name__}"
            )
        if not np.isfinite(landmarks.regressor.data).all():
            refuse(f"landmarks {name!r}: the regressor holds entries that are not finite")
        if landmarks.regressor.shape != (len(landmarks.names), N):
            refuse(
                f"landmarks {name!r}: {len(landmarks.names)} names and a regressor "
                f"{landmarks.regressor.shape}, which must be ({len(landmarks.names)}, {N})"
            )
        if landmarks.names:
            sums = np.asarray(landmarks.regressor.sum(axis=1))
            check_rows(refuse, f"weights in landmarks {name!r}", sums, "point")


def check_tree(refuse: Refuse, parents: tuple[int, ...]) -> None:
    """Refuse parents that do not come before their children."""
    if not parents or parents[0] != -1:
        refuse(f"joint 0 must be the root, with parent -1, but parents are {parents[:4]}...")
    for k, parent in enumerate(parents[1:], start=1):
        if not 0 <= parent < k:
            refuse(
                f"joint {k} has parent {parent}; parents must come before their children, "
                f"so it must be one of 0 to {k - 1}"
            )
