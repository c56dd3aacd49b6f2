"""Findings about single arrays: sums that must be one, places that must exist."""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Mask
from workbench.bodies.checking.findings import FileFinding, counted, of_all, row_name
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.bodies.files.extras import MIRROR
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


def _row_sums(rows: Array | csr_array) -> tuple[Array, Mask]:
    """The sum of each row, and which of them are not one."""
    with np.errstate(over="ignore"):
        sums = np.asarray(rows.sum(axis=1)).ravel()
    return sums, np.asarray(~(abs(sums - 1) <= ROW_SUM_TOLERANCE))


def _weights(model: ModelArrays) -> Iterator[FileFinding]:
    if model.weights is None:
        return
    sums, wrong = _row_sums(model.weights)
    if wrong.any():
        worst = int(np.argmax(abs(sums - 1)))
        yield FileFinding(
            "weights",
            f"The weights of {of_all(wrong, 'vertices')} do not sum to 1; those of vertex {worst} "
            f"sum to {sums[worst]:.4g}. Such vertices lag behind where the body moves. Divide each "
            "row by its sum: weights / weights.sum(axis=1, keepdims=True).",
        )
    negative: Mask = np.asarray((model.weights < -ROW_SUM_TOLERANCE).any(axis=1))
    if negative.any():
        yield FileFinding(
            "weights",
            f"{of_all(negative, 'vertices')} have weights below zero, down to "
            f"{model.weights.min():.3g}, and move against their joints. Set them to zero and "
            "divide each row by its sum.",
        )


def _regressor(model: ModelArrays) -> Iterator[FileFinding]:
    if model.regressor is None:
        return
    sums, wrong = _row_sums(model.regressor)
    if wrong.any():
        worst = int(np.argmax(abs(sums - 1)))
        yield FileFinding(
            "J_regressor",
            f"The rows of {of_all(wrong, 'joints')} in J_regressor do not sum to 1; that of "
            f"{row_name(model.names, worst)} sums to {sums[worst]:.4g}, so that the joint is not "
            "where its vertices are. Divide each row by its sum, if it is not zero; otherwise take "
            "J_regressor from the original file.",
        )


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
                f"{prefix}lmk_faces_idx names face {int(places.max())}, but there are faces 0 to "
                f"{F - 1}. The landmarks are those of another mesh: take both from one file.",
            )
        if shares is None:
            continue
        off = abs(shares.sum(axis=-1) - 1) > ROW_SUM_TOLERANCE
        if shares.shape[-1] != 3 or (places is not None and shares.shape[:-1] != places.shape):
            there = "nothing" if places is None else str(places.shape)
            yield FileFinding(
                f"{prefix}lmk_bary_coords",
                f"{prefix}lmk_bary_coords has shape {shares.shape}, but must have three numbers "
                f"for each of lmk_faces_idx, which is {there}. Take both from one file.",
            )
        elif off.any():
            yield FileFinding(
                f"{prefix}lmk_bary_coords",
                f"The barycentric coordinates of {of_all(off, 'landmarks')} in {prefix}"
                "lmk_bary_coords do not sum to 1, so that the landmarks are not on the surface. "
                "Divide each by its sum.",
            )


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
            f"ft names texture coordinate {int(corners.max())}, but vt has {len(places):,}. Take "
            "both from one file, or subtract 1 if ft counts from 1.",
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
