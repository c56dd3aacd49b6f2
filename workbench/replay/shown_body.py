"""A body as a page shows it: its arrays, how values become its numbers, and its surface."""

import json
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.replay.arguments import Row, row_of_body
from workbench.replay.browser_bodies import skinned_data


@dataclass(frozen=True, eq=False)
class Recording:
    """A replay for a page.

    Attributes:
        body: the arrays of the body, or its faces alone where all surfaces are in the data.
        data: what else `replay.js` takes, as JSON.
        caption: what there is to see, in words.
    """

    body: dict[str, Any]
    data: dict[str, Any]
    caption: str

    @cached_property
    def key(self) -> str:
        """16 letters that are the same for the same body, whose arrays a page holds once."""
        return sha256(json.dumps(self.body).encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class ShownBody:
    """A body that a page can pose.

    Attributes:
        body: the body.
        arrays: what `smpl.js` takes of it.
    """

    body: SkinnedBody
    arrays: dict[str, Any]

    def surface(self, numbers: Array) -> Array:
        """The vertices (N, 3) m of a row of 3 K + B + 3 numbers: pose, betas and trans."""
        return np.asarray(self.body.vertices(*self.split(numbers)))

    def split(self, numbers: Array) -> tuple[Array, Array, Array]:
        """The pose (K, 3), the betas (B,) and the trans (3,) of a row of numbers."""
        K, B = self.body.n_joints, self.body.n_betas
        pose, betas, trans = np.split(numbers, [3 * K, 3 * K + B])
        return pose.reshape(K, 3), betas, trans


def shown_body(body: Body | None) -> ShownBody | None:
    """The body for a page; None for one that a page cannot pose."""
    if not isinstance(body, SkinnedBody):
        return None
    try:
        return ShownBody(body, skinned_data(body, "f4"))
    except BadArgument:
        return None


def shown_with_row(
    body: Body | None, problem: Problem, known: Values
) -> tuple[ShownBody, Row] | None:
    """The body, and how values of the problem's blocks become a row of its numbers.

    None if the values do not determine them, and for a body that a page cannot pose.
    """
    if not isinstance(body, SkinnedBody):
        return None
    row = row_of_body(body, problem, known)
    shown = None if row is None else shown_body(body)
    return None if row is None or shown is None else (shown, row)
