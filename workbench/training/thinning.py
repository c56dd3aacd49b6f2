"""Fewer vertices of a mesh, spread out evenly, and the coarse mesh of them.

A pose is 72 numbers. What thousands of vertices say of it, two thousand say as well; templates,
blend shapes and weights are what every vertex is needed for.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, hstack
from scipy.sparse.csgraph import dijkstra

from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.training.estimate import Estimate
from workbench.training.mesh_graph import edges_of
from workbench.training.mirror import Mirror
from workbench.training.registrations import Batch, Registrations

Array = NDArray[np.float64]
Index = NDArray[np.int64]
ENOUGH = 2000  # vertices that a pose is found from


@dataclass(frozen=True, eq=False)
class Thinned:
    """Some of the vertices of a mesh, and triangles between them."""

    vertices: Index  # (n,): their numbers, rising
    faces: Index  # (F, 3), by their places in `vertices`

    def estimate(self, estimate: Estimate) -> Estimate:
        """What is known of these vertices; joints and poses stay, the regressor does not."""
        v = self.vertices
        return replace(
            estimate,
            templates=estimate.templates[:, v],
            posedirs=estimate.posedirs[v],
            weights=estimate.weights[v],
            regressor=None,
        )

    def body(self, body: SkinnedBody) -> SkinnedBody:
        """A body's, and after them its joints as vertices of their own, where the body has them."""
        v, K, R = self.vertices, body.n_joints, body.J_regressor
        n = len(v)
        return SkinnedBody(
            template=np.concatenate([body.template[v], R @ body.template]),
            shapedirs=np.concatenate([body.shapedirs[v], _regressed(R, body.shapedirs)]),
            posedirs=np.concatenate([body.posedirs[v], np.zeros((K, *body.posedirs.shape[1:]))]),
            J_regressor=csr_array(hstack([csr_array((K, n)), eye_array(K)])),
            weights=np.concatenate([body.weights[v], np.eye(K)]),
            parents=body.parents,
            faces=self.faces,
            joint_names=body.joint_names,
            name=body.name,
        )

    def mirror(self, mirror: Mirror) -> Mirror:
        """Of these vertices, which must have been chosen with it."""
        place = np.full(len(mirror.vertices), -1)
        place[self.vertices] = np.arange(len(self.vertices))
        return Mirror(place[mirror.vertices[self.vertices]], mirror.joints)

    def registrations(self, registrations: Registrations) -> "OfThese":
        """These vertices of every registration."""
        return OfThese(registrations, self.vertices)


@dataclass(frozen=True, eq=False)
class OfThese:
    """Registrations of which only some vertices are looked at."""

    of: Registrations
    vertices: Index

    @property
    def subject(self) -> Index:
        """Whose each is."""
        return self.of.subject

    @property
    def n_vertices(self) -> int:
        """How many are looked at."""
        return len(self.vertices)

    def read(self, some: slice) -> Batch:
        """Copies of these. Raises BadArgument if nothing of a registration is among them."""
        batch = self.of.read(some)
        seen = batch.seen[:, self.vertices]
        for j in np.flatnonzero(~seen.any(axis=1)):
            raise BadArgument(
                f"registration {batch.some.start + j} shows so little of its mesh that none of "
                f"{self.n_vertices} vertices spread over it is seen; leave it out"
            )
        return replace(batch, vertices=batch.vertices[:, self.vertices], seen=seen)


def thinned(
    template: Array, faces: Index, most: int = ENOUGH, mirror: Index | None = None
) -> Thinned:
    """At most so many vertices, each the farthest from those before it; all, if they are fewer.

    With a `mirror` (N,) each comes with the one on its other side. Every other vertex belongs to
    the one that it is nearest to along the edges. Where three cells meet in a triangle of
    `faces`, their vertices make one.
    """
    N = len(template)
    if most >= N:
        return Thinned(np.arange(N), faces)
    vertices = np.unique(_spread_out(template, most, np.arange(N) if mirror is None else mirror))
    ends = edges_of(faces)
    lengths = np.linalg.norm(np.subtract(*template[ends].transpose(1, 0, 2)), axis=1)
    graph = csr_array((np.maximum(lengths, 1e-9), (ends[:, 0], ends[:, 1])), shape=(N, N))
    _, _, nearest = dijkstra(
        graph, directed=False, indices=vertices, return_predecessors=True, min_only=True
    )
    place = np.full(N + 1, -1)  # the last entry: what no cell reaches
    place[vertices] = np.arange(len(vertices))
    corners = place[np.where(nearest < 0, N, nearest)][faces]
    a, b, c = corners.T
    apart = (a != b) & (b != c) & (c != a) & (corners.min(axis=1) >= 0)
    first = corners[apart].argmin(axis=1)[:, None]
    turned = np.take_along_axis(corners[apart], (first + np.arange(3)) % 3, axis=1)
    return Thinned(vertices, np.unique(turned, axis=0))


def _regressed(R: csr_array, directions: Array) -> Array:
    return (R @ directions.reshape(len(directions), -1)).reshape(-1, *directions.shape[1:])


def _spread_out(points: Array, count: int, mirror: Index) -> list[int]:
    chosen: list[int] = []
    away = np.full(len(points), np.inf)
    latest = 0
    while True:
        both = sorted({latest, int(mirror[latest])})
        if len(chosen) + len(both) > count:
            return chosen
        chosen += both
        for v in both:
            away = np.minimum(away, np.sum((points - points[v]) ** 2, axis=1))
        latest = int(away.argmax())
