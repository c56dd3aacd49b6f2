"""A mesh as a graph: its edges, and the permutation that turns it into its mirror image."""

from collections import deque
from collections.abc import Mapping

import numpy as np
import scipy.sparse.linalg
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import dijkstra

from workbench.arrays import Array, Index
from workbench.errors import WorkbenchError
from workbench.geometry.mirror import REFLECTION
from workbench.geometry.solids import lengths, mesh_edges

TRIED = 200  # faces that the first one is tried to be the mirror image of
UNEVEN = 0.1  # of the mesh's spread: how far a vertex may be from its mirror image, in the mean


class NoMirror(WorkbenchError):
    """The mesh is not connected alike on both sides of x = 0."""


def heat(vertices: Array, faces: Index, spread: float) -> scipy.sparse.linalg.SuperLU:
    """One implicit step of the graph's heat equation, I + spread^2 L / 2, ready to be solved.

    Solving with it spreads each column by about `spread` metres over the mesh, and keeps its sum.
    """
    edges, N = mesh_edges(faces), len(vertices)
    lengths = np.linalg.norm(np.subtract(*vertices[edges].transpose(1, 0, 2)), axis=1)
    pairs = np.concatenate([edges, edges[:, ::-1]])
    flow = np.tile(1 / np.maximum(lengths, 1e-6) ** 2, 2)
    A = csr_array((flow, (pairs[:, 0], pairs[:, 1])), shape=(N, N))
    L = diags_array(np.asarray(A.sum(axis=1)).ravel()) - A
    return scipy.sparse.linalg.splu(csc_array(diags_array(np.ones(N)) + 0.5 * spread**2 * L))


def find_mirror(vertices: Array, faces: Index) -> Index:
    """For each vertex the one on the other side, (N,), found from the connections of the mesh.

    The mirror image of one triangle determines that of its neighbours. The `vertices` (N, 3) only
    say which triangles to try first, so noise in them does no harm. It is verified that every face
    becomes a face with the other orientation, that vertices are exchanged in pairs, and that the
    result is nearly a reflection in x. Raises NoMirror.
    """
    beyond = {
        (int(a), int(b)): int(c) for f in faces for a, b, c in (f, np.roll(f, -1), np.roll(f, -2))
    }
    if len(beyond) != 3 * len(faces):
        raise NoMirror("two faces look different ways along one edge; mend the mesh first")
    centred = vertices - vertices.mean(axis=0)
    middles = centred[faces].mean(axis=1)
    mirror = np.full(len(vertices), -1)
    while (mirror[faces] < 0).any():
        seed = int(np.argmax((mirror[faces] < 0).any(axis=1)))
        distances = np.linalg.norm(middles - middles[seed] * REFLECTION, axis=1)
        found = next(
            (
                image
                for other in np.argsort(distances, kind="stable")[:TRIED]
                for turn in range(3)
                if (image := _spread(faces[seed], np.roll(faces[other][::-1], turn), beyond))
                and _fits(image, centred)
            ),
            None,
        )
        if found is None:
            raise NoMirror(
                f"no face can be the mirror image of face {seed}: the mesh is not connected alike "
                "on both sides; train without symmetry"
            )
        for vertex, opposite in found.items():
            mirror[vertex] = opposite
    mirror = np.where(mirror < 0, np.arange(len(mirror)), mirror)  # in no face
    if not np.array_equal(mirror[mirror], np.arange(len(mirror))):
        raise NoMirror("the mesh turns into itself, but not by a reflection; its sides differ")
    return mirror


def _spread(
    face: Index, image: Index, beyond: Mapping[tuple[int, int], int]
) -> dict[int, int] | None:
    """The images of all vertices that hang together with a face, or None where they disagree."""
    found = dict(zip(map(int, face), map(int, image), strict=True))
    waiting = deque([tuple(map(int, face))])
    done = {frozenset(map(int, face))}
    while waiting:
        a, b, c = waiting.popleft()
        if beyond.get((found[b], found[a])) != found[c]:
            return None
        for p, q in ((b, a), (c, b), (a, c)):
            across, other = beyond.get((p, q)), beyond.get((found[q], found[p]))
            if (across is None) != (other is None):
                return None
            if across is None or other is None:
                continue
            if found.setdefault(across, other) != other:
                return None
            if frozenset((p, q, across)) not in done:
                done.add(frozenset((p, q, across)))
                waiting.append((p, q, across))
    return found


def _fits(image: Mapping[int, int], centred: Array) -> bool:
    here = np.fromiter(image.keys(), int)
    there = np.fromiter(image.values(), int)
    away = np.linalg.norm(centred[here] - centred[there] * REFLECTION, axis=1)
    return bool(away.mean() < UNEVEN * np.linalg.norm(centred.std(axis=0)))


def along_edges(vertices: Array, triangles: Index, sources: list[Index]) -> Array:
    """From each set of vertices to every vertex along the mesh's edges, (len(sources), N) m.

    Dijkstra's shortest paths: never shorter than the surface's own, and longer where edges zigzag.
    Infinite where there is no way.
    """
    pairs = mesh_edges(triangles)
    N, weights = len(vertices), lengths(vertices, pairs)
    graph = csr_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(N, N))
    return np.array(
        [dijkstra(graph, directed=False, indices=some, min_only=True) for some in sources]
    ).reshape(len(sources), N)
