"""Which pose, shape and place of a body named values stand for."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Points
from workbench.bodies.arguments import Arguments
from workbench.bodies.body import Body

Array = NDArray[np.float64]


def arguments_behind(
    body: Body, points: Iterable[Points], values: Mapping[str, ArrayLike]
) -> tuple[Array, Array, Array] | None:
    """Pose (K, 3) rad, betas (B,) and trans (3,) m; None if the values do not tell them.

    They are those of the body's own blocks, where these have values. Otherwise they are what points
    of this body are made from, which may be pieces or coefficients.
    """
    own = [block.name for block in body.blocks()]
    if all(name in values for name in own):
        pose, betas, trans = (np.asarray(values[name], dtype=float) for name in own)
        return pose, betas, trans
    for one in points:
        source = getattr(one.source, "surface", one.source)  # means of a surface have its arguments
        at = getattr(source, "at", None)
        if not isinstance(at, Arguments) or at.body is not body or at.maps is None:
            continue
        if all(name in values for part in at.maps for name in part.reads):
            numbers = {name: np.asarray(value, dtype=float) for name, value in values.items()}
            pose, betas, trans = (part.value(numbers) for part in at.maps)
            return pose, betas, trans
    return None
