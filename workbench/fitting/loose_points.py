"""Points that hang together with few others: dust, flying pixels, what is strewn about."""

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Mask
from workbench.fitting.scan import Scan

NEIGHBOURS = 8  # nearest points that are asked
SPACING = 4  # the number of the neighbour whose distance, in the median, says how dense a scan is
AROUND = 2.0  # times that distance: neighbours that are nearer hang together
ALIKE = 0.5  # cosine of the largest angle between the normals of points that hang together
LEAST = 3  # such neighbours of a point that is not loose


def loose_points(scan: Scan) -> Mask:
    """Which points (M,) hang together with fewer than three of their eight nearest neighbours.

    Two points hang together if they are nearer to each other than twice the spacing of the scan,
    and, where normals are known, if these are less than 60 degrees apart. The spacing is the median
    distance of the fourth neighbour. Points of a surface lie side by side and face the same way.
    Rusu and others remove points by the distances of their neighbours alone (Towards 3D point cloud
    based object maps for household environments, 2008). Of fewer than nine points, none is loose.

    >>> import numpy as np
    >>> grid = np.stack(np.meshgrid(*[np.arange(10.0)] * 2, [0.0]), axis=-1).reshape(-1, 3)
    >>> loose_points(Scan(np.vstack([grid, [[4.5, 4.5, 30.0]]]))).nonzero()[0].tolist()
    [100]
    """
    if scan.n_points <= NEIGHBOURS:
        return np.zeros(scan.n_points, dtype=bool)
    found = cKDTree(scan.points).query(scan.points, k=NEIGHBOURS + 1)
    off, at = np.asarray(found[0])[:, 1:], np.asarray(found[1])[:, 1:]  # without the point itself
    together = off <= AROUND * np.median(off[:, SPACING - 1])
    if scan.normals is not None:
        together &= np.einsum("nki,ni->nk", scan.normals[at], scan.normals) > ALIKE
    return np.asarray(together.sum(axis=1) < LEAST)
