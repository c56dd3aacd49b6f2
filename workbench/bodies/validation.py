"""Whether the arrays of a body fit together; if they do not, which of them, and why."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks.checks import numbers
from workbench.bodies.body import Body, Landmarks
from workbench.bodies.capsules import Capsules
from workbench.bodies.files.reading import SKINNED, TRIANGLES, clashes
from workbench.bodies.forward.surface import count_features, rotation_elements
from workbench.errors import BadBody, BadMesh, NotNumbers
from workbench.geometry.triangles import gradients

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody
    from workbench.bodies.triangles.body import TriangleBody

Refuse = Callable[[str], NoReturn]
Shaped = NDArray[Any] | csr_array
Shape = tuple[int | str, ...]  # a letter stands for any size
FARTHEST = 1e3  # m
ROW_SUM_TOLERANCE = 1e-3  # single-precision files of many small weights reach 1e-5


def check_skinned(body: SkinnedBody) -> None:
    """Raise BadBody with what is wrong and where, or return."""
    refuse = _refusal(body)
    N, K = _check_rest(refuse, body)
    F = 9 * (K - 1)
    if body.features is not rotation_elements:
        B = body.shapedirs.shape[2] if body.shapedirs.ndim == 3 else 0
        try:
            F = count_features(body.features, K, B)
        except Exception as error:
            refuse(f"its features cannot be made of a pose of {K} joints and {B} betas: {error}")
    shapes: dict[str, Shape] = {"shapedirs": (N, 3, "B"), "posedirs": (N, 3, F)}
    _check_arrays(refuse, body, shapes | {"weights": (N, K)}, "vertex", SKINNED)
    _check_sizes(refuse, body, ("shapedirs", "posedirs"))
    if body.weights.min(initial=0) < -ROW_SUM_TOLERANCE:
        vertex, joint = np.unravel_index(int(body.weights.argmin()), body.weights.shape)
        refuse(f"weights[{vertex}, {joint}] is negative ({body.weights[vertex, joint]:.3g})")
    if body.faces.size and not 0 <= body.faces.min() <= body.faces.max() < N:
        face = int(np.argmax(((body.faces < 0) | (body.faces >= N)).any(axis=1)))
        refuse(f"face {face} is {body.faces[face].tolist()}, but there are vertices 0 to {N - 1}")
    if (mirror := body.mirror) is not None:
        fits = mirror.shape == (N,) and bool(((mirror >= 0) & (mirror < N)).all())
        if not fits or not np.array_equal(mirror[mirror], np.arange(N)):
            refuse("mirror must swap vertices in pairs: mirror[mirror] is not 0, 1, 2, ...")
    if body.bind_pose.shape != (K, 3) or not np.isfinite(body.bind_pose).all():
        refuse(f"bound_in must be finite angles ({K}, 3), not an array {body.bind_pose.shape}")
    joints = np.zeros((K, 3)) if body.rest_joints is None else body.rest_joints
    if joints.shape != (K, 3) or not (np.abs(joints) <= FARTHEST).all():
        refuse(
            f"rest_joints must be finite places ({K}, 3) within {FARTHEST:,.0f} m, not an array "
            f"{joints.shape}{f' up to {np.abs(joints).max():.3g}' if joints.size else ''}"
        )
    if "J_regressor" in body.free and ("joints" in body.free or body.rest_joints is not None):
        refuse(
            "nothing would read J_regressor where the joints are free or given; free one of the "
            "two, and take dataclasses.replace(body, rest_joints=None) for the joints that "
            "J_regressor finds"
        )
    if body.capsules is not None:
        _check_capsules(refuse, body.capsules, K, body.n_betas)


def check_triangles(body: TriangleBody) -> None:
    """Raise BadBody with what is wrong and where, or return."""
    refuse = _refusal(body)
    _, K = _check_rest(refuse, body)
    F = len(body.faces)
    check_shapes(refuse, partial(getattr, body), {"near": (F, "J")})
    shapes: dict[str, Shape] = {
        "shapedirs": (F, 3, 3, "B"),
        "posedirs": (F, 3, 3, 3 * body.near.shape[1]),
        "weights": (F, K),
    }
    _check_arrays(refuse, body, shapes, "face", TRIANGLES)
    wrong = ((body.near < 1) | (body.near >= K)).any(axis=1)
    wrong |= (np.diff(np.sort(body.near, axis=1), axis=1) == 0).any(axis=1)
    if wrong.any():
        face = int(np.argmax(wrong))
        refuse(
            f"face {face} is near the joints {body.near[face].tolist()}, but must be near "
            f"different ones of 1 to {K - 1}"
        )
    try:
        parts = body.stitching.n_components
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows has no area
            gradients(body.template, body.template, body.faces)
    except BadMesh as error:
        refuse(str(error))
    if parts != 1:
        refuse(
            f"the faces leave {body.n_vertices} vertices in {parts} pieces, and stitching does not "
            "say where one piece is beside another; keep one piece"
        )


def _refusal(body: Body) -> Refuse:
    def refuse(reason: str) -> NoReturn:
        raise BadBody(f"body {body.name!r}: {reason}")

    return refuse


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


def _check_rest(refuse: Refuse, body: Body) -> tuple[int, int]:
    """The numbers of vertices and joints of a tree and a mesh that can be."""
    parents = body.parents
    check_tree(refuse, parents)
    check_shapes(refuse, partial(getattr, body), {"template": ("N", 3), "faces": ("F", 3)})
    if not len(body.template):
        refuse("template has no vertices")
    if len(body.joint_names) != len(parents):
        refuse(f"joint_names has {len(body.joint_names)} names for {len(parents)} joints")
    return len(body.template), len(parents)


def _check_arrays(
    refuse: Refuse,
    body: SkinnedBody | TriangleBody,
    shapes: Mapping[str, Shape],
    row: str,
    keys: Collection[str],
) -> None:
    """What both kinds of body have; `row` is what each row of weights belongs to."""
    N = len(body.template)
    check_shapes(refuse, partial(getattr, body), {**shapes, "J_regressor": (len(body.parents), N)})
    for name in ("template", *shapes, "J_regressor"):
        _check_finite(refuse, name, getattr(body, name))
    _check_sizes(refuse, body, ("template",))
    _check_rows(refuse, "weights", body.weights, row)
    _check_rows(refuse, "J_regressor", body.J_regressor, "joint")
    if own := clashes(body.extras, keys):
        refuse(f"extras must not be called like the body's own arrays in a file: {', '.join(own)}")
    _check_landmarks(refuse, body.landmarks, N)


def _check_capsules(refuse: Refuse, capsules: object, K: int, B: int) -> None:
    if not isinstance(capsules, Capsules):
        refuse(
            f"capsules must be Capsules or None, not something of type {type(capsules).__name__}"
        )
    if capsules.radius_slopes.shape[1] != B:
        refuse(f"its capsules are of {capsules.radius_slopes.shape[1]} betas, but it has {B}")
    if capsules.joints.size and not 0 <= capsules.joints.min() <= capsules.joints.max() < K:
        refuse(f"its capsules must be on joints 0 to {K - 1}")


def check_shapes(
    refuse: Refuse, array: Callable[[str], Shaped], shapes: Mapping[str, Shape]
) -> None:
    """Refuse an array of another shape than is expected."""
    for name, expected in shapes.items():
        shape = array(name).shape
        sizes = [
            n if isinstance(size, str) else size for n, size in zip(shape, expected, strict=False)
        ]
        if len(shape) != len(expected) or tuple(sizes) != shape:
            refuse(f"{name} has shape {shape}, but must be ({', '.join(map(str, expected))})")


def _check_finite(refuse: Refuse, name: str, array: NDArray[Any] | csr_array) -> None:
    if isinstance(array, csr_array):
        if not np.isfinite(array.data).all():
            refuse(f"{name} holds entries that are not finite")
        return
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        refuse(f"{name}[{', '.join(map(str, bad[0]))}] is not finite ({len(bad)} such entries)")


def _check_sizes(refuse: Refuse, body: Body, names: Iterable[str]) -> None:
    """Refuse positions or directions in metres (N, 3, ...) with entries beyond FARTHEST."""
    for name in names:
        array = np.abs(getattr(body, name))
        if array.size and (largest := float(array.max())) > FARTHEST:
            vertex = int(np.unravel_index(int(array.argmax()), array.shape)[0])
            refuse(
                f"{name} of vertex {vertex} has an entry of {largest:.3g} m, and a body has none "
                f"beyond {FARTHEST:,.0f} m; `workbench body check` says which unit the file is in"
            )


def _check_rows(refuse: Refuse, name: str, rows: Array | csr_array, row: str) -> None:
    """Refuse an array whose rows do not sum to one; `row` is what each belongs to."""
    with np.errstate(over="ignore", invalid="ignore"):  # sums that overflow are not one
        sums = np.asarray(rows.sum(axis=1))
    wrong = ~(abs(sums - 1) <= ROW_SUM_TOLERANCE)  # nor NaN
    if wrong.any():
        worst = int(np.argmax(np.where(wrong, abs(sums - 1), 0)))
        refuse(f"{name} of {row} {worst} sum to {sums[worst]:.6g}, but must sum to 1")


def _check_landmarks(refuse: Refuse, sets: Mapping[str, Landmarks], N: int) -> None:
    """Refuse sets of landmarks whose names cannot be used, or that do not fit the mesh."""
    for name, landmarks in sets.items():
        if not isinstance(name, str) or name == "joints":
            refuse(
                f"a set of landmarks cannot be called {name!r}: its name is a text, and 'joints' "
                "are the body's own joints"
            )
        if not isinstance(landmarks, Landmarks):
            refuse(
                f"landmarks {name!r} must be Landmarks(names, regressor), not something of type "
                f"{type(landmarks).__name__}"
            )
        _check_finite(refuse, f"the regressor of landmarks {name!r}", landmarks.regressor)
        if landmarks.regressor.shape != (len(landmarks.names), N):
            refuse(
                f"landmarks {name!r}: {len(landmarks.names)} names and a regressor "
                f"{landmarks.regressor.shape}, which must be ({len(landmarks.names)}, {N})"
            )
        _check_rows(refuse, f"weights in landmarks {name!r}", landmarks.regressor, "point")


def chosen_vertices(body: Body, vertices: object) -> list[int]:
    """The vertices that a mask (N,) or a list of their numbers chooses; raises BadBody."""
    N, known = body.n_vertices, f"body {body.name!r} has vertices 0 to {body.n_vertices - 1}"
    try:
        chosen = numbers("vertices", vertices)
    except NotNumbers as error:
        raise BadBody(f"{error}; {known}") from None
    if chosen.dtype == bool and chosen.shape == (N,):
        chosen = np.flatnonzero(chosen)
    if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
        raise BadBody(
            f"{known}; choose some by a list of whole numbers, or by a mask of shape ({N},), "
            f"not by an array of {chosen.dtype} of shape {chosen.shape}"
        )
    outside = (chosen < 0) | (chosen >= N)
    if outside.any():
        raise BadBody(f"there is no vertex {chosen[outside][0]}; {known}")
    return [int(vertex) for vertex in chosen]
