"""What of a fitted body the scan supports, and how far the rest may be from where it was put."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.errors import NotFinite
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration.model_fit import ModelFit

NEAR = 0.03  # m: a vertex without a point of the scan as near as this was not seen
FACING = 0.5  # cosine of the largest angle between normals in contact


@dataclass(frozen=True, eq=False)
class Support:
    """Which vertices of a fit the scan says something about.

    Attributes:
        distances: (M,) m, signed, from each point of the scan to the surface; infinite where none
            faces its way.
        touching: (M,) which points are within the reach of the fit.
        contacts: (N,) how many of them touch a triangle of each vertex.
        seen: (N,) which vertices have a touching point nearby, within 3 cm unless `support` is told
            otherwise; the others rest on the prior.
        sd: (N,) m, the posterior standard deviation of the place of each vertex, in Laplace's
            approximation: the root of the trace of its covariance, with contacts held.
    """

    distances: Array
    touching: Mask
    contacts: Index
    seen: Mask
    sd: Array

    @property
    def expected_error(self) -> float:
        """The root mean square of `sd`, in m, if noise and priors are as the fit assumes."""
        return float(np.sqrt(np.mean(self.sd**2)))

    @property
    def mean_sd(self) -> float:
        """The mean of `sd`, in m: a single hand that may be anywhere counts less than above."""
        return float(np.mean(self.sd))


def support(fit: ModelFit, hypothesis: int = 0, *, near: float = NEAR) -> Support:
    """What of a hypothesis of a fit the scan supports.

    The standard deviations are those of the linearized problem: J'J of the last stage, whose
    derivatives are those with contacts held, pushed through to the vertices. They hold near this
    hypothesis and say nothing about others. A vertex without a touching point within `near` m was
    not seen. Raises NotFinite where the priors given leave a
    direction open.
    """
    vertices = fit.vertices(hypothesis)
    faces, scan = fit.body.faces, fit.scan
    tree = SurfaceTree(vertices, faces)
    at = tree.closest(scan.points, 10 * fit.reach, scan.normals, FACING)
    distances = np.where(at.faces >= 0, at.distances, np.inf)
    touching = np.abs(distances) < fit.reach
    contacts = np.bincount(faces[at.faces[touching]].ravel(), minlength=len(vertices))
    seen: Mask = contacts > 0
    if touching.any():
        seen = seen & (np.asarray(cKDTree(scan.points[touching]).query(vertices)[0]) < near)
    return Support(distances, touching, contacts, seen, _spread(fit, hypothesis))


def _spread(fit: ModelFit, hypothesis: int) -> Array:
    """(N,) m, the posterior standard deviation of each vertex."""
    values = fit.hypotheses[hypothesis].values
    problem = fit.problem
    here = problem.linearize(values)
    points = fit.body.points(*(block.symbol for block in fit.body.blocks()))
    arithmetic = points.source.numeric
    assert arithmetic is not None  # of every body
    names = [block.name for block in problem.free.blocks]
    into = {b.name: np.zeros((b.size, 3 * fit.body.n_vertices)) for b in problem.free.blocks}
    arithmetic.evaluate(values).write_jacobian(into, None)
    J = np.concatenate([into[name] for name in names])  # (n, 3 N), transposed
    found = here.inverse_times(J)
    if found is None or not np.isfinite(found).all():
        raise NotFinite(
            "the scan and the priors leave a direction of the body open, so that its vertices "
            "have no posterior; give priors on pose and betas"
        )
    return np.asarray(np.sqrt(np.sum(J * found, axis=0).reshape(-1, 3).sum(axis=1)))
