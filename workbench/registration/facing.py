"""Which way a body faces."""

import numpy as np

from workbench.arrays import Array
from workbench.geometry.rotation import matrix_from_vector


def facing(root: Array, bind: Array) -> Array:
    """The horizontal unit vector (3,) along which a body faces whose root is turned by `root`
    (3,) rad, and which faces +z in the bind pose, where the root is turned by `bind` (3,) rad.

    A body that lies on its back or its front faces up or down: that vector is returned then.
    """
    forward = (matrix_from_vector(root) @ matrix_from_vector(bind).T)[:, 2]
    level = forward * [1.0, 0.0, 1.0]
    length = float(np.linalg.norm(level))
    return np.asarray(level / length if length > 0 else forward)
