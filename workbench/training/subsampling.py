"""Fewer vertices of a mesh, spread evenly, and the coarse mesh of them.

A pose has only 72 numbers, which two thousand vertices determine as well as all do. Templates,
blend shapes and weights need every vertex.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, eye_array, hstack
from scipy.sparse.csgraph import dijkstra

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.geometry.mirror import Mirror
from workbench.geometry.solids import mesh_edges
from workbench.training.estimate import Estimate
from workbench.training.registrations import Registrations, RegistrationSubset

POSE_VERTICES = 2000  # vertices that a pose is found from


@dataclass(frozen=True, eq=False)
class Subsample:
    """Some of the vertices of a mesh, and triangles between them.

    Attributes:
        vertices: (n,) their numbers, increasing.
        faces: (F, 3) the places of the triangles' corners in `vertices`.
    """

    vertices: Index
    faces: Index

    def estimate(self, estimate: Estimate) -> Estimate:
        """The estimate of these vertices, with the same joints and poses but no regressor."""
        v = self.vertices
        return replace(
            estimate,
            templates=estimate.templates[:, v],
            posedirs=estimate.posedirs[v],
            weights=estimate.weights[v],
            regressor=None,
        )

    def body(self, body: SkinnedBody) -> SkinnedBody:
        """The body of these vertices, followed by its joints as additional vertices."""
        v, K, R = self.vertices, body.n_joints, body.J_regressor
        n, B = len(v), body.n_betas
        of_joints = (R @ body.shapedirs.reshape(len(body.template), -1)).reshape(K, 3, B)
        return SkinnedBody(
            template=np.concatenate([body.template[v], R @ body.template]),
            shapedirs=np.concatenate([body.shapedirs[v], of_joints]),
            posedirs=np.concatenate([body.posedirs[v], np.zeros((K, *body.posedirs.shape[1:]))]),
            J_regressor=csr_array(hstack([csr_array((K, n)), eye_array(K)])),
            weights=np.concatenate([body.weights[v], np.eye(K)]),
            parents=body.parents,
            faces=self.faces,
            joint_names=body.joint_names,
            name=body.name,
        )

    def mirror(self, mirror: Mirror) -> Mirror:
        """The mirror of these vertices, which must have been chosen with it."""
        place = np.full(len(mirror.vertices), -1)
        place[self.vertices] = np.arange(len(self.vertices))
        return Mirror(place[mirror.vertices[self.vertices]], mirror.joints)

    def registrations(self, registrations: Registrations) -> RegistrationSubset:
        """These vertices of every registration."""
        return RegistrationSubset(registrations, vertices=self.vertices)


def subsample(
    template: Array, faces: Index, most: int = POSE_VERTICES, mirror: Index | None = None
) -> Subsample:
    """At most `most` vertices, each the farthest from those chosen before it.

    With a `mirror` (N,), each vertex is chosen together with its mirror image. The other vertices
    belong to the cell of the chosen vertex that is nearest along the edges. Three chosen vertices
    form a triangle where their cells meet in one of `faces`.
    """
    N = len(template)
    if most >= N:
        return Subsample(np.arange(N), faces)
    vertices = np.unique(
        _farthest_points(template, most, np.arange(N) if mirror is None else mirror)
    )
    ends = mesh_edges(faces)
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
    return Subsample(vertices, np.unique(turned, axis=0))


def _farthest_points(points: Array, count: int, mirror: Index) -> list[int]:
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
