"""Findings about the arrays of a model: sums, faces and landmarks; the tree of joints; betas."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index, Mask
from workbench.bodies.checking.model_arrays import (
    FileFinding,
    ModelArrays,
    counted,
    of_all,
    row_name,
)
from workbench.bodies.files.joint_names import NAMES, TREES
from workbench.bodies.files.reading import MIRROR
from workbench.bodies.spaces import COUNTS, WITH_FACE
from workbench.bodies.validation import ROW_SUM_TOLERANCE


def about_numbers(model: ModelArrays) -> Iterator[FileFinding]:
    """Weights, regressor, faces, columns of posedirs, landmarks on faces, texture coordinates."""
    yield from _weights(model)
    yield from _regressor(model)
    yield from _faces(model)
    yield from _posedirs(model)
    yield from _landmarks(model)
    yield from _texture(model)
    yield from _mirror(model)


def _sums(
    key: str, rows: Array | csr_array, which: str, named: Callable[[int], str], harm: str
) -> Iterator[FileFinding]:
    """Rows that do not sum to one."""
    with np.errstate(over="ignore"):
        sums = np.asarray(rows.sum(axis=1)).ravel()
    wrong: Mask = np.asarray(~(abs(sums - 1) <= ROW_SUM_TOLERANCE))
    if wrong.any():
        worst = int(np.argmax(abs(sums - 1)))
        yield FileFinding(
            key,
            f"The weights of {of_all(wrong, which)} do not sum to 1, those of {named(worst)} to "
            f"{sums[worst]:.4g}, {harm}",
        )


def _weights(model: ModelArrays) -> Iterator[FileFinding]:
    if model.weights is None:
        return
    harm = (
        "so that they lag behind where the body moves. Divide each row by its sum: weights / "
        "weights.sum(axis=1, keepdims=True)."
    )
    yield from _sums("weights", model.weights, "vertices", lambda vertex: f"vertex {vertex}", harm)
    negative: Mask = np.asarray((model.weights < -ROW_SUM_TOLERANCE).any(axis=1))
    if negative.any():
        yield FileFinding(
            "weights",
            f"{of_all(negative, 'vertices')} have weights below zero, down to "
            f"{model.weights.min():.3g}, and move against their joints. Set them to zero and "
            "divide each row by its sum.",
        )


def _regressor(model: ModelArrays) -> Iterator[FileFinding]:
    harm = (
        "so that they are not where their vertices are. Divide each row by its sum, if it is not "
        "zero; otherwise take J_regressor from the original file."
    )
    if model.regressor is not None:
        named = partial(row_name, model.names)
        yield from _sums("J_regressor", model.regressor, "joints", named, harm)


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
    same: Mask = np.asarray((faces == np.roll(faces, 1, axis=1)).any(axis=1))
    if same.any():
        yield FileFinding(
            "f",
            f"{of_all(same, 'faces')} have a corner twice, and no area. Remove them.",
            warning=False,
        )


def _posedirs(model: ModelArrays) -> Iterator[FileFinding]:
    if model.posedirs is None or not model.n_joints:
        return
    K, P = model.n_joints, model.posedirs.shape[2]
    smpl, star = 9 * (K - 1), 4 * (K - 1) + 1
    if smpl == P or star == P:
        return
    why = ""
    if P % 9 == 0:
        why = f" They are as many as {P // 9 + 1} joints have: posedirs is of another model."
    elif 4 * K == P:
        why = " They are quaternions of all joints, the root included, as in SUPR: it is not read."
    yield FileFinding(
        "posedirs",
        f"posedirs has {P} columns, but {K} joints have {smpl} of SMPL's pose features or {star} "
        f"of STAR's.{why} Take posedirs and kintree_table from one file.",
    )


def _landmarks(model: ModelArrays) -> Iterator[FileFinding]:
    F = 0 if model.faces is None else len(model.faces)
    for prefix in ("", "dynamic_"):
        places, shares = (
            model.extra(f"{prefix}lmk_{what}") for what in ("faces_idx", "bary_coords")
        )
        if places is not None and F and (places.min() < 0 or places.max() >= F):
            yield FileFinding(
                f"{prefix}lmk_faces_idx",
                f"{prefix}lmk_faces_idx names face {_first_outside(places)}, but there are "
                f"faces 0 to {F - 1}. The landmarks are those of another mesh: take both from one "
                "file.",
            )
        if shares is None:
            continue
        off = abs(shares.sum(axis=-1) - 1) > ROW_SUM_TOLERANCE
        if shares.shape[-1] != 3 or (places is not None and shares.shape[:-1] != places.shape):
            there = "nothing" if places is None else str(places.shape)
            yield FileFinding(
                f"{prefix}lmk_bary_coords",
                f"{prefix}lmk_bary_coords has shape {shares.shape}, but must have three numbers "
                f"for each of {prefix}lmk_faces_idx, which is {there}. Take both from one file.",
            )
        elif off.any():
            yield FileFinding(
                f"{prefix}lmk_bary_coords",
                f"The barycentric coordinates of {of_all(off, 'landmarks')} in {prefix}"
                "lmk_bary_coords do not sum to 1, so that the landmarks are not on the surface. "
                "Divide each by its sum.",
            )


def _first_outside(numbers: Index) -> int:
    """The number that is below zero, or else the largest."""
    return int(numbers.min() if numbers.min() < 0 else numbers.max())


def _texture(model: ModelArrays) -> Iterator[FileFinding]:
    corners, places = model.extra("ft"), model.extra("vt")
    if corners is None or corners.ndim != 2 or model.faces is None:
        return
    if len(corners) != len(model.faces):
        yield FileFinding(
            "ft",
            f"ft has {counted(len(corners), 'row', 'rows')}, one for each face, but f has "
            f"{len(model.faces):,}: the texture is that of another mesh. Take both from one file.",
            warning=False,
        )
    elif places is not None and (corners.min() < 0 or corners.max() >= len(places)):
        yield FileFinding(
            "ft",
            f"ft names texture coordinate {_first_outside(corners)}, but vt has {len(places):,}. "
            "Take both from one file, or subtract 1 if ft counts from 1.",
        )


def _mirror(model: ModelArrays) -> Iterator[FileFinding]:
    pairs = model.extra(MIRROR)
    if pairs is None or model.template is None:
        return
    N, places = len(model.template), pairs.ravel()
    there = len(places) == N and places.min() >= 0 and places.max() < N
    whole = places.astype(np.int64)
    if not there or not np.array_equal(whole[whole], np.arange(N)):
        yield FileFinding(
            MIRROR,
            f"{MIRROR} does not swap the {N} vertices in pairs, so that the body has no mirror: it "
            "cannot be trained or used as its own mirror image. Take it from the original file.",
            warning=False,
        )


FAR = 0.15  # of the size of a model, from a joint to where its skin begins; 0.07 is seen
EXCHANGED = 0.03  # by how much two joints together are closer to their skin if they change places
FAR_IN_A_HEAD = 0.4  # the skin that a jaw moves begins far from its joint
REORDER = (
    "Sort the joints so that parents come before their children: the columns of kintree_table and "
    "weights, the rows of J_regressor, and the groups of 9 columns of posedirs, all in one order"
)


ORDERS = (
    "The rows of J_regressor, the columns of weights and the tree are in different orders, or the "
    "vertices are those of another mesh: take all from one file."
)


def about_tree(model: ModelArrays) -> Iterator[FileFinding]:
    """The order of joints in kintree_table, and whether the other arrays have the same order."""
    table = model.table
    if table is None or not table.shape[1]:
        return
    K = table.shape[1]
    numbers = np.arange(K)
    if np.array_equal(table[0], numbers) and not np.array_equal(table[1], numbers):
        yield FileFinding(
            "kintree_table",
            "The rows of kintree_table are swapped: row 0 must be the parents, row 1 the numbers "
            "of the joints. Swap them: kintree_table[::-1].",
        )
        return
    if not np.array_equal(table[1, 1:], numbers[1:]):
        yield FileFinding(
            "kintree_table",
            f"Row 1 of kintree_table must number the joints 0, 1, 2, ..., but begins "
            f"{table[1, :5].tolist()}. {REORDER}; then number them anew.",
        )
        return
    yield from _order(model, table)
    yield from _of_family(model)
    yield from _apart(model)


def _order(model: ModelArrays, table: Index) -> Iterator[FileFinding]:
    K, parents = table.shape[1], table[0]
    outside = [k for k in range(1, K) if not 0 <= parents[k] < K]
    if outside:
        yield FileFinding(
            "kintree_table",
            f"{row_name(model.names, outside[0]).capitalize()} has parent "
            f"{int(parents[outside[0]])}, which is no joint: there are joints 0 to {K - 1}, and "
            "joint 0 alone has no parent. Give it its parent, or leave the joint out.",
        )
        return
    late = [k for k in range(1, K) if parents[k] >= k]
    if late:
        k = late[0]
        circle = "" if _reach_root(parents) else " Some joints are their own ancestors."
        yield FileFinding(
            "kintree_table",
            f"{row_name(model.names, k).capitalize()} has parent {int(parents[k])}, which does not "
            f"come before it.{circle} {REORDER}.",
        )
    if 0 < parents[0] < K:
        yield FileFinding(
            "kintree_table",
            f"Joint 0 has parent {int(parents[0])}, but must be the root, whose parent files write "
            f"as -1 or 4294967295. {REORDER}.",
        )


def _reach_root(parents: Index) -> bool:
    """Whether every joint has the root among its ancestors."""
    at = np.arange(len(parents))
    for _ in range(len(parents)):
        at = np.where(at == 0, 0, parents[at])
    return bool((at == 0).all())


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


def _apart(model: ModelArrays) -> Iterator[FileFinding]:
    """Joints that are far from where their skin meets that of their parents."""
    away = joints_away(model)
    if away is None:
        return
    known = model.family in TREES  # in a tree that nobody knows, it may be meant
    own = np.diag(away)
    gains = own[:, None] + own - away - away.T
    i, j = (int(k) for k in np.unravel_index(int(np.nanargmax(gains)), gains.shape))
    if gains[i, j] > EXCHANGED:
        i, j = sorted((i, j))
        yield FileFinding(
            "J_regressor",
            f"{row_name(model.names, i).capitalize()} and {row_name(model.names, j)} would be "
            f"closer to the skin that they move if they changed places. {ORDERS}",
            known,
        )
        return
    far = np.flatnonzero(own > (FAR_IN_A_HEAD if model.family == "FLAME" else FAR))
    if len(far):
        k = int(np.nanargmax(own))
        joints = counted(len(far), "joint is", "joints are")
        yield FileFinding(
            "J_regressor",
            f"Of {len(own)} joints, {joints} far from the skin that they move: "
            f"{row_name(model.names, k)} is {own[k]:.0%} of the size of the model away from where "
            f"its skin begins. {ORDERS}",
            known,
        )


def joints_away(model: ModelArrays) -> Array | None:
    """The distance of each joint from where the skin of each begins, by the model's size: (K, K).

    The skin of a joint begins where it meets its parent's: at the mean of the vertices by the
    product of both weights. NaN in the columns of joints that have no such place; None if no joint
    has one.
    """
    joints, parents, template = model.joints, model.parents, model.template
    if joints is None or parents is None or model.weights is None or template is None:
        return None
    if not model.size > 0:
        return None
    places = np.full((len(parents), 3), np.nan)
    for k in range(1, len(parents)):
        shared = model.weights[:, k] * model.weights[:, parents[k]]
        total = float(shared.sum())
        if total > 0:
            places[k] = shared @ template / total
    away = np.asarray(np.linalg.norm(joints[:, None] - places, axis=2) / model.size)
    return away if np.isfinite(np.diag(away)).any() else None


RELEASED = {"SMPL": 300, "STAR": 300, "SMPL-X": 400, "FLAME": 400}  # directions, in the full files
DECLARED = ("num_betas", "n_betas", "num_shape_coeffs", "shape_dim")  # keys that say their number
NOTHING = 1e-9  # of the largest direction, below which a direction moves nothing


def model_of(model: ModelArrays) -> str:
    """The family, or STAR by its pose features."""
    P = 0 if model.posedirs is None else model.posedirs.shape[2]
    K = model.n_joints
    return "STAR" if K > 1 and P == 4 * (K - 1) + 1 else model.family


def about_spaces(model: ModelArrays) -> Iterator[FileFinding]:
    """The number of shape directions, against the file's own words and those of its release."""
    if model.shapedirs is None:
        return
    B, name = model.shapedirs.shape[2], model_of(model)
    if not B:
        yield FileFinding(
            "shapedirs", "There are no shape directions: everybody has the same shape.", False
        )
        return
    acting = _acting(model)
    if acting < B:
        yield FileFinding(
            "shapedirs",
            f"Only the first {acting} of {B} shape directions do anything; the others are zero, "
            "and their betas cannot be found by any fit. Take the file with all directions, or "
            f"keep shapedirs[:, :, :{acting}].",
        )
    for key in DECLARED:
        said = model.scalar(key)
        if said is not None and said != B:
            yield FileFinding(
                key,
                f"The file says {said} in {key}, but shapedirs has "
                f"{counted(B, 'direction', 'directions')}: {_which(said, B)}",
            )
    if "card" not in model.raw or name in WITH_FACE:  # the workbench's own bodies are no release
        yield from _cut(name, B)


def _which(said: int, B: int) -> str:
    if said > B:
        return (
            f"it was cut to {B} of {said}, and betas that were fitted with more do not belong to "
            f"it. Take the file with all {said}, or use the first {B} betas alone."
        )
    return f"it asks for the first {said}. Keep shapedirs[:, :, :{said}], or correct the number."


def _cut(name: str, B: int) -> Iterator[FileFinding]:
    full = RELEASED.get(name)
    if full is None or full == B:
        return
    if name not in WITH_FACE:
        yield FileFinding(
            "shapedirs",
            f"There are {B} shape directions, and {name} was released with up to {full} too. Betas "
            f"beyond the first {B} have no meaning here: take the larger file if you have them.",
            warning=False,
        )
    elif B in COUNTS:
        yield FileFinding(
            "shapedirs",
            f"There are {COUNTS[B][0]} directions of shape and {COUNTS[B][1]} of expression, of "
            f"300 and 100 in the full file of {name}. Expressions begin at beta {COUNTS[B][0]} "
            "here, and at beta 300 there: do not copy betas from one to the other.",
            warning=False,
        )
    else:
        yield FileFinding(
            "shapedirs",
            f"There are {B} shape directions, but files of {name} have 400 (300 of shape and 100 "
            "of expression) or 20 (10 of each). Here all of them count as shape, and the package "
            "smplx takes directions 10 to 19 for expressions. Take a file of 400 or 20.",
        )


def _acting(model: ModelArrays) -> int:
    """The number of the first directions up to the last one that is not zero."""
    if model.shapedirs is None:
        return 0
    largest = np.abs(model.shapedirs).max(axis=(0, 1), initial=0.0)
    acting = np.flatnonzero(largest > NOTHING * max(largest.max(initial=0.0), 1e-300))
    return int(acting[-1]) + 1 if len(acting) else 0
