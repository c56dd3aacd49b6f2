"""How free vertices are coupled to those of a model: by edges, or by vertices."""

from collections.abc import Callable

import casadi as cs

from workbench.arrays import Index
from workbench.blocks import Points
from workbench.geometry.solids import mesh_edges
from workbench.residuals import Residual, edges, vertices

Coupling = Callable[[cs.MX, Points, Index, float], Residual]
"""From the vertices' symbol (3, N), the model's points, faces (F, 3) and a sigma in m."""


def by_edges(free: cs.MX, model: Points, faces: Index, sigma: float) -> Residual:
    """E_C = |A V - A M|^2, where A takes the differences along all edges.

    V are the free vertices and M the model's (SMPL, section 4.1; Hirshberg et al., Coregistration,
    2012, take the differences along two edges of each triangle).

    The sigma is in m. The term is a membrane: what the scan moves takes its surroundings along,
    also where nothing was seen. It is blind to translation. On a surface its sum does not depend on
    the mesh's resolution.
    """
    return edges(model, free, mesh_edges(faces), sigma=sigma, name="coupling")


def by_vertices(free: cs.MX, model: Points, faces: Index, sigma: float) -> Residual:
    """E_C = |V - M|^2: each free vertex is drawn to its place on the model, whatever others do.

    The sigma is in m. A vertex that was not seen stays where the model puts it, even if all around
    it are elsewhere.
    """
    return vertices(model, free, sigma=sigma, name="coupling")
