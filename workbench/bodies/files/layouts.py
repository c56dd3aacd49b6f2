"""Bodies from the entries of their files: SMPL's layout, and ours of triangle bodies.

An SMPL file may be of any size, precision and age. A triangle body's has

    bs_style        "triangles", which says the kind of body; that of SMPL's files is "lbs"
    v_template      (N, 3) m
    f               (F, 3)
    shapedirs       (F, 3, 3, B)
    posedirs        (F, 3, 3, 3 J)
    near            (F, J)
    weights         (F, K), sparse: weights/data, weights/indices, weights/indptr, weights/shape
    J_regressor     (K, N), likewise

and kintree_table, joint_names, name, card and landmarks as in the files of skinned bodies.
"""

from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.body import Landmarks
from workbench.bodies.capsules import Capsules
from workbench.bodies.files.joint_names import family, joint_names
from workbench.bodies.files.pickles import Contents
from workbench.bodies.files.reading import (
    CAPSULES,
    LANDMARKS,
    MIRROR,
    OF_TRIANGLES,
    REQUIRED,
    SKINNED,
    TRIANGLES,
    Entries,
    kept_and_left_out,
)
from workbench.bodies.forward.surface import Features, rotation_elements, star_features
from workbench.bodies.readonly import locked
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles.body import TriangleBody
from workbench.errors import BadFile, shown, some
from workbench.reading.facts import parsed

LOOKALIKES = (  # keys by which other kinds of files are recognized
    ({"poses", "trans"}, "a motion (AMASS), which moves a body and is none; read_motion reads it"),
    ({"eigvec"}, "the soft-tissue directions of DMPL, which go with a body and are none"),
    ({"vertices", "faces"}, "a plain mesh; read_mesh reads mesh files"),
    ({"means", "covars"}, "a pose prior"),
)
MOST_JOINTS = 10_000  # every one of them is looked at in Python, and a body has some dozens


def body_from(raw: Contents, name: str, where: str) -> SkinnedBody:
    """The body whose entries are `raw`; `where` is the file, for messages and the card.

    Arrays become float64 (N, 3), (N, 3, B), (N, 3, P), csr (K, N) and (N, K); parents are -1 at
    the root. Nothing is normalised. Entries that a body does not compute with are its `extras`;
    those that cannot be kept are named under `left_out` in its card. Raises BadFile for entries
    that are missing or are not what their key says, BadBody if they do not fit together.
    """
    entries = Entries(raw, where)
    _check_keys(entries)
    N, parents = _vertices(entries), parents_from(entries)
    mirror, posedirs = _mirror(entries, N), entries.directions("posedirs", N)
    keys = SKINNED if mirror is None else SKINNED | {MIRROR}
    extras, left_out = kept_and_left_out(raw, keys)
    return SkinnedBody(
        template=locked(entries.reals("v_template")),
        shapedirs=locked(entries.directions("shapedirs", N)),
        posedirs=locked(posedirs),
        J_regressor=entries.matrix("J_regressor"),
        weights=locked(entries.reals("weights")),
        parents=parents,
        faces=entries.wholes("f"),
        joint_names=entries.texts("joint_names")
        if "joint_names" in entries
        else joint_names(len(parents), parents),
        mirror=mirror,
        features=_features(posedirs, len(parents)),
        landmarks=landmarks_from(entries),
        name=entries.name("name", name),
        bound_in=entries.reals("bind_pose") if "bind_pose" in entries else None,
        rest_joints=entries.reals("rest_joints") if "rest_joints" in entries else None,
        capsules=capsules_from(entries),
        card=_card(entries, _model(posedirs, parents), left_out),
        extras=extras,
    )


def _check_keys(entries: Entries) -> None:
    have = {key.partition("/")[0] for key in entries.raw}
    missing = [key for key in REQUIRED if key not in have]
    if missing:
        instead = next((f"It looks like {what}. " for keys, what in LOOKALIKES if keys <= have), "")
        contents = some(sorted(have)) if have else "nothing"
        raise BadFile(
            f"{entries.where} has no {', '.join(missing)}; it has "
            f"{contents}. {instead}A body needs {', '.join(REQUIRED)}"
        )
    style = entries.text("bs_style", "lbs")
    if style != "lbs":
        raise BadFile(
            f"{entries.where} is skinned by bs_style {shown(style)}; there is lbs, of SMPL, and "
            "triangles, of a TriangleBody"
        )


def _vertices(entries: Entries) -> int:
    """N, the number of vertices in v_template."""
    shape = entries.array("v_template").shape
    if len(shape) != 2 or shape[1] != 3 or not shape[0]:
        raise BadFile(f"{entries.where}: v_template has shape {shape}, but must be (N, 3)")
    return int(shape[0])


def parents_from(entries: Entries) -> tuple[int, ...]:
    """Row 0 of kintree_table with -1 at the root, which files mark in many ways."""
    table = entries.wholes("kintree_table")
    if table.ndim != 2 or len(table) != 2 or table.shape[1] == 0:
        raise BadFile(f"{entries.where}: kintree_table is {table.shape}, but must be (2, K)")
    if table.shape[1] > MOST_JOINTS:
        raise BadFile(
            f"{entries.where}: kintree_table has {table.shape[1]:,} joints, but a body has at most "
            f"{MOST_JOINTS:,}"
        )
    if not np.array_equal(table[1, 1:], np.arange(1, table.shape[1])):
        raise BadFile(
            f"{entries.where}: row 1 of kintree_table must number the joints 0, 1, 2, ..., "
            f"but begins {table[1, :4].tolist()}"
        )
    return (-1, *(int(parent) for parent in table[0, 1:]))


def _features(posedirs: Array, K: int) -> Features:
    """STAR's, if posedirs (N, 3, F) have as many columns: 93 on 24 joints; otherwise SMPL's."""
    return star_features if posedirs.shape[2] == 4 * (K - 1) + 1 else rotation_elements


def _mirror(entries: Entries, N: int) -> Index | None:
    """The vertex on the other side of each, if the file has them and its pairs are pairs."""
    if MIRROR not in entries:
        return None
    mirror = entries.wholes(MIRROR).ravel()
    if len(mirror) != N or mirror.min() < 0 or mirror.max() >= N:
        return None
    return mirror if np.array_equal(mirror[mirror], np.arange(N)) else None


def landmarks_from(entries: Entries) -> dict[str, Landmarks]:
    """The sets of landmarks that a file of the workbench holds. Raises BadFile."""
    names = sorted(match[1] for key in entries.raw if (match := LANDMARKS.fullmatch(key)))
    return {
        name: Landmarks(
            entries.texts(f"landmarks/{name}/names"), entries.matrix(f"landmarks/{name}")
        )
        for name in names
    }


def capsules_from(entries: Entries) -> Capsules | None:
    """The capsules that a file of the workbench holds, if it has any. Raises BadFile or BadBody."""
    if CAPSULES[0] not in entries:
        return None
    if missing := [key for key in CAPSULES if key not in entries]:
        raise BadFile(f"{entries.where} has capsules without {', '.join(missing)}")
    names, joints, ends, end_slopes, radii, radius_slopes, pairs = CAPSULES
    return Capsules(
        entries.texts(names),
        entries.wholes(joints),
        entries.reals(ends),
        entries.reals(end_slopes),
        entries.reals(radii),
        entries.reals(radius_slopes),
        entries.wholes(pairs),
    )


def _model(posedirs: Array, parents: tuple[int, ...]) -> str:
    """What a file without a card is called: its family by its joints, or STAR."""
    K = len(parents)
    return "STAR" if _features(posedirs, K) is star_features else family(K, parents)


def _card(entries: Entries, model: str, left_out: list[str]) -> dict[str, Any]:
    """The file's own card, or what can be said of a file without one; and what was left out."""
    if "card" in entries:
        return own_card(entries, left_out)
    file = Path(entries.where).name
    guessed = next((g for g in ("female", "male", "neutral") if g in file.lower()), "unknown")
    return {
        "name": file,
        "model": model,
        "gender": entries.name("gender", guessed),
        "source": file,
        "licence": "its owners'; do not pass it on without theirs",
        **({"left_out": left_out} if left_out else {}),
    }


def own_card(entries: Entries, left_out: list[str]) -> dict[str, Any]:
    """The card that a file holds, and what was left out of the file. Raises BadFile."""
    try:
        card = parsed(entries.text("card", "null"))
    except BadFile as error:
        raise BadFile(f"{entries.where}: its card is no JSON ({error})") from error
    if not isinstance(card, dict):
        raise BadFile(f"{entries.where}: its card is a {type(card).__name__}, not an object")
    before = card.get("left_out", [])
    lines = [*(before if isinstance(before, list) else [before]), *left_out]
    return card | ({"left_out": lines} if left_out else {})


STYLE = "triangles"


def is_triangle_body(raw: Contents) -> bool:
    """Whether the entries say that they are those of a triangle body."""
    return Entries(raw, "").text("bs_style", "") == STYLE


def triangle_body_from(raw: Contents, name: str, where: str) -> TriangleBody:
    """The body whose entries are `raw`; `where` is the file, for messages.

    Raises BadFile for entries that are missing or are not what their key says, BadBody if they do
    not fit together.
    """
    entries = Entries(raw, where)
    have = {key.partition("/")[0] for key in raw}
    if missing := [key for key in OF_TRIANGLES if key not in have]:
        raise BadFile(
            f"{where} has no {', '.join(missing)}; it has {some(sorted(have))}. The file of a "
            f"triangle body has {', '.join(OF_TRIANGLES)}"
        )
    parents = parents_from(entries)
    extras, left_out = kept_and_left_out(raw, TRIANGLES)
    return TriangleBody(
        template=locked(entries.reals("v_template")),
        faces=entries.wholes("f"),
        shapedirs=locked(entries.reals("shapedirs")),
        posedirs=locked(entries.reals("posedirs")),
        near=entries.wholes("near"),
        weights=entries.matrix("weights"),
        J_regressor=entries.matrix("J_regressor"),
        parents=parents,
        joint_names=entries.texts("joint_names"),
        landmarks=landmarks_from(entries),
        name=entries.name("name", name),
        card=own_card(entries, left_out),
        extras=extras,
    )
