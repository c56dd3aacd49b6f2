"""Which landmarks a body hides from a camera that looks at it."""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.geometry.solids import ray_crossings

THICK = 0.15  # m of the body in front of a landmark: a joint is hardly ever as deep under the skin


def hidden_landmarks(body: SkinnedBody, name: str, values: Values, eye: Array) -> Mask:
    """Which landmarks of a set the body hides from an eye (3,) m, where the values put it, (M,).

    A landmark is hidden where the way to it leaves the body again, as behind another limb, or is
    for more than 0.15 m inside of it. Joints lie inside, so that a way that only enters says
    nothing. Detectors often guess hidden landmarks, so this is the strict case.
    """
    at = [values[block.name] for block in body.blocks()]
    points, skin = body.landmark(name, *at), body.vertices(*at)
    exits, inside = ray_crossings(eye, points, skin, body.faces)
    return np.asarray((exits > 0) | (inside > THICK))
