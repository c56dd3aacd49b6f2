"""The reflection x -> -x of a body, its vertices and joints changing sides.

A rotation R of a joint becomes S R S of the joint on the other side, S = diag(-1, 1, 1);
a rotation vector, being axial, keeps its x and turns its y and z.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import WorkbenchError

REFLECTION = np.array([-1.0, 1.0, 1.0])  # what becomes of a position (x, y, z)
AXIAL = np.array([1.0, -1.0, -1.0])  # what becomes of a rotation vector
MOST_TRIED = 200  # faces that the first one is tried to be the mirror image of
MIRROR_TOLERANCE = 0.1  # of the mesh's spread: the mean distance of vertices from their images


class NoMirror(WorkbenchError):
    """The mesh is not connected alike on both sides of x = 0."""


def opposite(name: str) -> str:
    """The name on the other side: left_knee -> right_knee, head -> head."""
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)


def opposites(names: Sequence[str]) -> Index:
    """For each name the index of its opposite."""
    return np.array([list(names).index(opposite(name)) for name in names])


@dataclass(frozen=True, eq=False)
class Mirror:
    """For each vertex (N,) and each joint (K,), the one on the other side of the body."""

    vertices: Index
    joints: Index

    @cached_property
    def features(self) -> Index:
        """For each pose feature, the one on the other side of the body, (9 (K - 1),).

        Feature 9 (k - 1) + 3 r + c belongs to entry (r, c) of the rotation matrix of joint k.
        """
        return (9 * (self.joints[1:, None] - 1) + np.arange(9)).ravel()

    @cached_property
    def feature_signs(self) -> Array:
        """S R S changes the sign of the entries with one index x: (9 (K - 1),)."""
        return np.tile(np.outer(REFLECTION, REFLECTION).ravel(), len(self.joints) - 1)

    def points(self, points: Array) -> Array:
        """Points (..., N, 3) reflected."""
        reflected: Array = points[..., self.vertices, :] * REFLECTION
        return reflected

    def directions(self, directions: Array) -> Array:
        """Directions (N, 3, B) reflected."""
        reflected: Array = directions[self.vertices] * REFLECTION[:, None]
        return reflected

    def weights(self, weights: Array) -> Array:
        """Skinning weights (N, K) reflected."""
        return weights[self.vertices][:, self.joints]

    def posedirs(self, posedirs: Array) -> Array:
        """Pose blend shapes (N, 3, 9 (K - 1)) reflected."""
        return self.directions(posedirs)[:, :, self.features] * self.feature_signs


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
        images = next(
            (
                image
                for other in np.argsort(distances, kind="stable")[:MOST_TRIED]
                for turn in range(3)
                if (image := _spread(faces[seed], np.roll(faces[other][::-1], turn), beyond))
                and _fits(image, centred)
            ),
            None,
        )
        if images is None:
            raise NoMirror(
                f"no face can be the mirror image of face {seed}: the mesh is not connected alike "
                "on both sides; train without symmetry"
            )
        for vertex, opposite in images.items():
            mirror[vertex] = opposite
    mirror = np.where(mirror < 0, np.arange(len(mirror)), mirror)  # in no face
    if not np.array_equal(mirror[mirror], np.arange(len(mirror))):
        raise NoMirror("the mesh turns into itself, but not by a reflection; its sides differ")
    return mirror


def _spread(
    face: Index, image: Index, beyond: Mapping[tuple[int, int], int]
) -> dict[int, int] | None:
    """The images of all vertices that hang together with a face, or None where they disagree."""
    images = dict(zip(map(int, face), map(int, image), strict=True))
    waiting = deque([tuple(map(int, face))])
    done = {frozenset(map(int, face))}
    while waiting:
        a, b, c = waiting.popleft()
        if beyond.get((images[b], images[a])) != images[c]:
            return None
        for p, q in ((b, a), (c, b), (a, c)):
            across, other = beyond.get((p, q)), beyond.get((images[q], images[p]))
            if (across is None) != (other is None):
                return None
            if across is None or other is None:
                continue
            if images.setdefault(across, other) != other:
                return None
            if frozenset((p, q, across)) not in done:
                done.add(frozenset((p, q, across)))
                waiting.append((p, q, across))
    return images


def _fits(image: Mapping[int, int], centred: Array) -> bool:
    vertices = np.fromiter(image.keys(), int)
    opposites = np.fromiter(image.values(), int)
    distances = np.linalg.norm(centred[vertices] - centred[opposites] * REFLECTION, axis=1)
    return bool(distances.mean() < MIRROR_TOLERANCE * np.linalg.norm(centred.std(axis=0)))
