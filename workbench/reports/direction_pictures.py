"""Directions of a diagnosis as pictures of the body moved along them."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.forward.sources import arguments_from_values
from workbench.diagnostics import Diagnosis, Direction
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots import caption_direction
from workbench.plots.body import direction_sheet
from workbench.reports.page import Shown, shown
from workbench.reports.replay.runs import LEAST, reach_along

PICTURES = 4  # of directions that are not seen, and as many of hardly seen ones


def pictures(d: Diagnosis, found: Sequence[Direction], body: Body | None) -> list[Shown]:
    """The body moved along the first directions that move it; no pictures for several frames.

    The three entries of one joint are one picture, of the first of them.
    """
    several = any(block.framed for block in d.problem.known.values())
    if body is None or several or _arguments(d, body, d.values) is None:
        return []
    drawn: list[Shown] = []
    turned: set[tuple[str, ...]] = set()
    for direction in sorted(found, key=lambda x: x.kind == "entry"):
        if len(drawn) == PICTURES:
            break
        amount = reach_along(direction, d.tolerance)
        moved = _moved(d, direction, body, amount)
        here = moved["here"]
        if max(float(np.abs(s - here).max()) for s in moved.values()) < LEAST:
            continue
        if direction.kind == "entry" and direction.joints:
            if direction.joints in turned:
                continue
            turned.add(direction.joints)
        unit = d.free.unit(int(np.argmax(abs(direction.vector))))
        figure = direction_sheet(moved, body.faces)
        drawn.append(shown(figure, caption_direction(direction.name, moved, amount, unit)))
    return drawn


def _moved(d: Diagnosis, direction: Direction, body: Body, amount: float) -> dict[str, Array]:
    """Surfaces (N, 3) m by label, the person upright whatever the world's axes are."""
    free = d.free
    x = free.pack(d.values)
    surfaces, upright = {}, np.eye(3)
    for label, step in (("here", 0.0), ("−", -amount), ("+", amount)):
        values = dict(d.values) | free.unpack(x + step * direction.vector, d.values)
        arguments = _arguments(d, body, values)
        assert arguments is not None  # asked before
        upright = matrix_from_vector(arguments[0][0]) if label == "here" else upright
        surfaces[label] = body.vertices(*arguments) @ upright
    return {label: surfaces[label] for label in ("−", "here", "+")}


def _arguments(d: Diagnosis, body: Body, values: Values) -> tuple[Array, Array, Array] | None:
    return arguments_from_values(body, d.problem.points, values)
