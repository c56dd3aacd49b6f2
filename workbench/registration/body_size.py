"""How large what was fitted is at rest: the height of a person, the length of a hand."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.hands import is_hand

HEIGHT, LENGTH = "height", "length"


@dataclass(frozen=True)
class BodySize:
    """The size of a body in its bind pose.

    Attributes:
        name: `height` of a person, from the lowest to the highest vertex; `length` of a hand, from
            the wrist's joint to the vertex that is farthest from it, a finger's tip.
        metres: how much it is.
    """

    name: str
    metres: float


def body_size(body: Body, betas: Array) -> BodySize:
    """The size of a body with the shape betas (B,).

    >>> from workbench import load_body
    >>> hand = load_body("hand")
    >>> size = body_size(hand, np.zeros(hand.n_betas))
    >>> size.name, round(size.metres, 2)
    ('length', 0.19)
    """
    surface = body.vertices(body.bind_pose, betas, np.zeros(3))
    if not is_hand(body):
        return BodySize(HEIGHT, float(np.ptp(surface[:, 1])))
    wrist = body.joints(body.bind_pose, betas, np.zeros(3))[0]
    return BodySize(LENGTH, float(np.linalg.norm(surface - wrist, axis=1).max()))
