"""A body's model card: what it is made of, where that comes from, and how it looks."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.body import why_not_skinned
from workbench.bodies.files.reading import shapes_in_words
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadBody
from workbench.plots import caption_body, caption_shape_gallery
from workbench.plots.body import body_sheet, shape_gallery_sheet, side
from workbench.reports.folder import write_folder
from workbench.reports.page import Columns, Table, page, shown

ARMS_LOWERED = 1.15  # rad, from a T-pose, so that shapes stand closer together
GALLERY_SD = 2.0  # standard deviations at which shapes are drawn
NOT_READ = "arrays of its file that its points do not depend on; save_body writes them back"
MOST_SHAPES = 5  # shape directions in the gallery


def write_card(body: SkinnedBody | TriangleBody, folder: str | Path, source: str = "") -> Path:
    """Write the folder of a card, and return its page `index.html`; whole or not at all.

    `source` is the file that the body is from. Raises BadFile if the place cannot be written or
    holds something else, the card of another file too, and BadBody for what is no body.
    """
    contents = {"index.html": card_page(body), "card.txt": card_text(body) + "\n"}
    summary = {"kind": "card", "name": body.name, "facts": facts(body), "card": dict(body.card)}
    return write_folder(folder, source, contents, summary)


def card_page(body: SkinnedBody | TriangleBody) -> str:
    """The page of a body. Raises BadBody for anything else."""
    check_kind(body)
    gallery = shapes(body)
    return page(
        "card.html",
        title=f"Body: {body.name}",
        facts=facts(body),
        portrait=shown(
            body_sheet(body.template, body.faces),
            caption_body(
                body.template,
                "The synthetic template" if "synthetic" in body.card else "The template",
            ),
        ),
        gallery=shown(shape_gallery_sheet(gallery, body.faces), caption_shape_gallery(gallery))
        if body.n_betas
        else None,
        joints=joint_table(body),
        card=dict(body.card),
    )


def card_text(body: SkinnedBody | TriangleBody) -> str:
    """The card as text for a terminal. Raises BadBody for anything but a body."""
    check_kind(body)
    rows = facts(body)
    widest = max(map(len, rows))
    lines = [body.name, *(f"  {name:{widest}}  {text}" for name, text in rows.items()), ""]
    table = joint_table(body)
    short = Table(table.head[:6], tuple(row[:6] for row in table.rows), table.numbers[:4])
    lines += [f"  {line}" for line in short.lines()]
    return "\n".join([*lines, "", *_nested(body.card, 1)]).rstrip()


def check_kind(body: object) -> None:
    """Raise BadBody for what is neither a SkinnedBody nor a TriangleBody."""
    if isinstance(body, TriangleBody):
        return
    if wrong := why_not_skinned(body, "a card", "its fields and its `card` say what it is made of"):
        raise BadBody(wrong)


def joint_table(body: SkinnedBody | TriangleBody) -> Table:
    """The joints with their parents and places."""
    skinned = isinstance(body, SkinnedBody)
    weights: Array = body.weights if isinstance(body, SkinnedBody) else body.weights.toarray()
    rest, moved = body.joints(), np.count_nonzero(weights, axis=0)
    regressed = np.diff(body.J_regressor.indptr)
    names, parents = body.joint_names, body.parents
    columns: Columns[int] = {
        "k": str,
        "joint": lambda k: names[k],
        "parent": lambda k: "–" if parents[k] < 0 else names[parents[k]],
        "x (m)": lambda k: _metres(rest[k, 0]),
        "y (m)": lambda k: _metres(rest[k, 1]),
        "z (m)": lambda k: _metres(rest[k, 2]),
        "vertices moved" if skinned else "faces moved": lambda k: f"{moved[k]:,}",
        "regressed from": lambda k: f"{regressed[k]:,}",
    }
    return Table.of(range(body.n_joints), columns, (0, 3, 4, 5, 6, 7))


def _metres(x: float) -> str:
    return f"{round(x, 3) + 0.0:.3f}"  # + 0.0: no negative zero


def _nested(card: Mapping[str, Any], depth: int) -> list[str]:
    lines = []
    for key, value in card.items():
        name = f"{'  ' * depth}{key}:"
        if isinstance(value, Mapping):
            lines += [name, *_nested(value, depth + 1)]
        elif isinstance(value, (list, tuple)) and any(isinstance(v, str) for v in value):
            lines += [name, *(f"{'  ' * (depth + 1)}- {v}" for v in value)]
        elif isinstance(value, (list, tuple)):
            lines.append(f"{name} {', '.join(map(str, value))}")
        else:
            lines.append(f"{name} {value}")
    return lines


def facts(body: SkinnedBody | TriangleBody) -> dict[str, str]:
    """Sizes and kinds, by name."""
    sets = [f"{name} ({len(marks.names)})" for name, marks in body.landmarks.items()]
    tall = float(np.ptp(body.template[:, 1]))
    return {
        **_kind(body),
        "vertices V": f"{body.n_vertices:,}",
        "faces": f"{len(body.faces):,}",
        "joints K": str(body.n_joints),
        "shape directions B": str(body.n_betas),
        "J_regressor": f"{body.J_regressor.nnz:,} nonzeros",
        "height of the template": f"{tall:.3f} m",
        "landmarks": ", ".join(["joints", *sets]),
        **({"synthetic": str(body.card["synthetic"])} if "synthetic" in body.card else {}),
        **({"carried along": f"{shapes_in_words(body.extras)}: {NOT_READ}"} if body.extras else {}),
    }


def _kind(body: SkinnedBody | TriangleBody) -> dict[str, str]:
    """What a kind of body has of its own."""
    acting = int(np.count_nonzero(body.posedirs))
    if isinstance(body, SkinnedBody):
        weights = np.count_nonzero(body.weights, axis=1)
        return {
            "type": f"SkinnedBody, {body.skinning.__name__.replace('_', ' ')} skinning",
            "pose features P": f"{body.posedirs.shape[2]} ({acting:,} nonzeros in posedirs)",
            "skinning weights": f"at most {weights.max()} per vertex, {weights.mean():.2f} on "
            "average",
        }
    weights = np.diff(body.weights.indptr)
    parts = "one part" if body.one_part_per_face else "several parts"
    return {
        "type": f"TriangleBody, each triangle with {parts}, then stitched",
        "joints that bend a face": f"{body.near.shape[1]} ({acting:,} nonzeros in posedirs)",
        "parts' weights": f"at most {weights.max()} per face, {weights.mean():.2f} on average",
    }


def shapes(body: SkinnedBody | TriangleBody) -> dict[str, Array]:
    """The mean and the first shape directions at plus, then at minus two standard deviations.

    (N, 3) m each, the arms hanging where the body is a T-pose of SMPL's joint names.
    """
    pose = _arms_down(body)
    gallery: dict[str, Array] = {}
    for sign, word in ((1, "+2 sd"), (-1, "−2 sd")):
        mean = body.vertices(pose)
        gallery |= {"mean": mean} if sign > 0 else {"mean, side": side(mean)}
        for b in range(min(MOST_SHAPES, body.n_betas)):
            betas = np.zeros(body.n_betas)
            betas[b] = sign * GALLERY_SD
            gallery[f"betas[{b}] {word}"] = body.vertices(pose, betas)
    return gallery


def _arms_down(body: SkinnedBody | TriangleBody) -> Array:
    pose = body.bind_pose.copy()
    for name, turn in (("left_shoulder", -ARMS_LOWERED), ("right_shoulder", ARMS_LOWERED)):
        if name in body.joint_names and (isinstance(body, TriangleBody) or body.bound_in is None):
            pose[body.joint_names.index(name), 2] = turn
    return pose
