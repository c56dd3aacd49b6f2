"""What a body is measured by: distances to meshes, creases between parts, and time."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.geometry.triangles import gradients
from workbench.problem import Problem
from workbench.residuals import vertices as on_vertices
from workbench.training.triangles.fitting import AnyBody, Fits, strangers_fitted
from workbench.training.triangles.stitched_fit import neighbour_differences

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Held:
    """A body beside meshes of people whom it has never seen, pose and shape sought."""

    fits: Fits
    distances: Array  # (M, N) mm

    @classmethod
    def of(cls, body: AnyBody, first: SkinnedBody, meshes: Array) -> "Held":
        """In meshes (M, N, 3) m; see strangers_fitted."""
        fits = strangers_fitted(body, first, meshes)
        return cls(fits, np.asarray(1e3 * np.linalg.norm(fits.surfaces - meshes, axis=-1)))

    def only(self, some: list[int]) -> "Held":
        """Some of the meshes."""
        f = self.fits
        return Held(Fits(f.poses[some], f.betas[some], f.surfaces[some]), self.distances[some])

    @property
    def rms(self) -> float:
        """mm."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def mean(self) -> float:
        """mm."""
        return float(self.distances.mean())

    @property
    def largest(self) -> float:
        """mm."""
        return float(self.distances.max())


def crease(template: Array, faces: Index, part: Index, surfaces: Array) -> float:
    """How much deformation jumps where one part meets another.

    The rms of |X_f - X_g| over neighbouring faces of different parts (F,), in surfaces (M, N, 3).
    """
    tied = neighbour_differences(faces)
    seams = tied[np.flatnonzero(tied @ part)]
    X = np.moveaxis(gradients(template, surfaces, faces), 0, -1).reshape(len(faces), -1)
    jumps = (seams @ X).reshape(seams.shape[0], 9, -1)
    return float(np.sqrt((jumps**2).sum(axis=1).mean()))


def n_seams(faces: Index, part: Index) -> int:
    """Pairs of neighbouring faces of different parts (F,)."""
    return int(np.count_nonzero(neighbour_differences(faces) @ part))


@dataclass(frozen=True)
class Cost:
    """What one body costs on one core, once everything is made that is made once."""

    mesh: str
    model: str
    n_vertices: int
    n_faces: int
    vertices_ms: float  # the surface at one pose and shape, the least of several
    jacobian_ms: float  # residual and Jacobian of all vertices on pose, betas and trans
    density: float  # share of that Jacobian's entries that are not zero


def cost(mesh: str, model: str, body: AnyBody, repeats: int = 7) -> Cost:
    """Measured here and now, in a pose where every joint is bent."""
    rng = np.random.default_rng(0)
    at = {
        "pose": rng.normal(scale=0.3, size=(body.n_joints, 3)),
        "betas": rng.normal(size=body.n_betas),
        "trans": rng.normal(size=3),
    }
    points = body.points(*(block.symbol for block in body.blocks()))
    residual = on_vertices(points, np.zeros((body.n_vertices, 3)), sigma=1.0)
    problem = Problem([residual], tuple(at))
    J = problem.linearize(at).dense
    return Cost(
        mesh,
        model,
        body.n_vertices,
        len(body.faces),
        _least(lambda: body.vertices(*at.values()), repeats),
        _least(lambda: problem.linearize(at), repeats),
        float(np.count_nonzero(J) / J.size),
    )


def _least(do: Callable[[], object], repeats: int) -> float:
    """ms, the first time apart."""
    do()
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        do()
        taken.append(time.perf_counter() - began)
    return 1e3 * min(taken)
