"""A body's model card: what it is made of, where that comes from, and how it looks."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.skinned import not_skinned
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadBody
from workbench.plots import caption_body, caption_shape_gallery, sheets
from workbench.reports.anatomy import directions_drawn, facts, shapes
from workbench.reports.figures import shown
from workbench.reports.folder import write_folder
from workbench.reports.page import page
from workbench.reports.tables import Columns, Table


def write_card(body: SkinnedBody | TriangleBody, folder: str | Path, source: str = "") -> Path:
    """Write the folder of a card, and return its page `index.html`; whole or not at all.

    `source` is the file that the body is from. Raises BadFile if the place cannot be written or
    holds something else, the card of another file too, and BadBody for what is no body.
    """
    check_kind(body)
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
            sheets.body_sheet(body.template, body.faces),
            caption_body(body.template, f"The {template_called(body)}"),
        ),
        gallery=shown(
            sheets.shape_gallery_sheet(gallery, body.faces),
            caption_shape_gallery(gallery, drawn=directions_drawn(body)),
        )
        if body.n_betas
        else None,
        joints=joint_table(body),
        card=dict(body.card),
    )


def card_text(body: SkinnedBody | TriangleBody) -> str:
    """The card as text for a terminal. Raises BadBody for anything but a body."""
    check_kind(body)
    known = facts(body)
    widest = max(map(len, known))
    lines = [body.name, *(f"  {name:{widest}}  {text}" for name, text in known.items()), ""]
    lines += [f"  {line}" for line in joint_table(body).lines()]
    return "\n".join([*lines, "", *_nested(body.card, 1)]).rstrip()


def template_called(body: SkinnedBody | TriangleBody) -> str:
    """The words for the template in a caption."""
    return "synthetic template" if "synthetic" in body.card else "template"


def check_kind(body: object) -> None:
    """Raise BadBody for what is neither a SkinnedBody nor a TriangleBody."""
    if isinstance(body, TriangleBody):
        return
    if wrong := not_skinned(body, "a card", "its fields and its `card` say what it is made of"):
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
