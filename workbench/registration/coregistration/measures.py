"""What a coregistration changed: distances from the scans, and shapes that betas do not reach."""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration.coregistration.folder import RegisteredScans

WITHIN, FACING = 0.05, 0.5  # m, and the cosine of the normals: points that are compared


def distances(scans: RegisteredScans, body: SkinnedBody, together: Array) -> dict[str, Array]:
    """For each scan (J,) the median distance in m of its points from the surface, for the scan's
    registration by itself (`apart`) and for those found `together` (J, N, 3) m; and the mean
    distance in m between the vertices of both (`moved`).
    """
    rows = []
    for j, vertices in enumerate(together):
        scan, apart = scans.read(j), scans.registration(j, body)
        near = []
        for surface in (apart, vertices):
            tree = SurfaceTree(surface, body.faces)
            at = tree.closest(scan.points, WITHIN, scan.normals, FACING)
            near.append(float(np.median(np.abs(at.distances[at.faces >= 0]))))
        rows.append([*near, float(np.linalg.norm(vertices - apart, axis=1).mean())])
    apart_m, together_m, moved = np.array(rows).T
    return {"apart": apart_m, "together": together_m, "moved": moved}


def beyond_betas(body: SkinnedBody, templates: Array) -> Array:
    """(S, N) m, how far templates (S, N, 3) m are from the nearest shape that betas reach.

    A template may also stand elsewhere than that shape.
    """
    places = np.tile(np.eye(3), (body.n_vertices, 1))
    reached = np.concatenate([body.shapedirs.reshape(-1, body.n_betas), places], axis=1)
    away = (templates - body.template).reshape(len(templates), -1)
    known, *_ = np.linalg.lstsq(reached, away.T, rcond=None)
    left = away - (reached @ known).T
    return np.asarray(np.linalg.norm(left.reshape(templates.shape), axis=2))
