"""Points drawn at random from a surface."""

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import BadMesh


def random_surface_points(
    vertices: Array, faces: Index, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Points (count, 3) m spread evenly over a mesh's area, and the unit normals there.

    vertices (N, 3) m; faces (F, 3). Raises BadMesh if the mesh has no area.
    """
    a, b, c = (np.asarray(vertices, dtype=float)[faces[:, i]] for i in range(3))
    doubled = np.cross(b - a, c - a)  # m^2, along the normal
    areas = np.linalg.norm(doubled, axis=1)
    if not areas.sum() > 0:
        raise BadMesh("the faces have no area from which points could be drawn")
    chosen = rng.choice(len(faces), count, p=areas / areas.sum())
    s, t = rng.uniform(size=(2, count, 1))
    root = np.sqrt(s)  # (1 - root, root (1 - t), root t) is uniform on a triangle
    points = (1 - root) * a[chosen] + root * (1 - t) * b[chosen] + root * t * c[chosen]
    return points, doubled[chosen] / areas[chosen, None]
