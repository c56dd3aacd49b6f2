"""How deep parts of a posed body are within each other, measured on its mesh.

The mesh is cut into parts, each part is closed to a solid, a place is inside if its winding number
is above one half, and the deepest place is found by branch and bound (`deepest`). Triangles on the
border of two parts may be long; each place on one belongs to the part of the nearest corner.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index, Mask
from workbench.bodies.parts import BONES, owners, part_joints, solid_of
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.surface_tree import SurfaceTree

PAIRS = 1_000_000  # of a point and a triangle at once
TOGETHER = 2_000  # triangles that are looked at in one round


def winding_numbers(points: Array, vertices: Array, faces: Index) -> Array:
    """How often a surface of triangles (F, 3) goes around each of points (M, 3), (M,).

        w(p) = 1 / (4 pi) sum over triangles of their solid angle at p

    Inside of a closed surface that faces outwards it is 1, and outside 0; it is 2 where two of its
    parts overlap. If the surface has holes, w is a smooth function between, and 1/2 is taken as the
    border of its inside (Jacobson, Kavan and Sorkine-Hornung, Robust Inside-Outside Segmentation
    using Generalized Winding Numbers, 2013). The solid angle is that of van Oosterom and Strackee
    (The Solid Angle of a Plane Triangle, 1983); a point in the plane of a triangle sees none of it.
    """
    found = np.empty(len(points))
    step = max(1, PAIRS // max(len(faces), 1))
    for start in range(0, len(points), step):
        some = slice(start, start + step)
        a, b, c = (vertices[faces[:, i]] - points[some, None] for i in range(3))  # (m, F, 3)
        A, B, C = (np.sqrt(np.einsum("mfi,mfi->mf", x, x)) for x in (a, b, c))
        volume = np.einsum("mfi,mfi->mf", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("mfi,mfi->mf", x, y) for x, y in ((a, b), (b, c), (c, a)))
        angles = 2 * np.arctan2(volume, A * B * C + ab * C + bc * A + ca * B)
        found[some] = angles.sum(axis=1) / (4 * np.pi)
    return found


INSIDE = 0.5  # winding number


@dataclass(frozen=True, eq=False)
class Patch:
    """A piece of a surface, such as the skin of a hand, and what closes it to a solid.

    Attributes:
        skin: (F, 3) its triangles, by the numbers of the whole surface's vertices.
        rims: for each opening, the edges (E, 2) around it.
    """

    skin: Index
    rims: tuple[Index, ...]

    @staticmethod
    def of(skin: Index) -> Patch:
        """The patch of triangles (F, 3) of an oriented surface."""
        F = len(skin)
        corners = np.arange(3 * F).reshape(F, 3)
        halves, at = (x[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2) for x in (skin, corners))
        one, other = _opposite(halves)
        alone = np.setdiff1d(np.arange(len(halves)), one)
        # corners in one vertex are one point of the rim only if edges join their triangles there
        joined = np.column_stack([at[one].ravel(), at[other][:, ::-1].ravel()])
        joined = np.concatenate([joined, at[alone]])  # and edges of one opening follow each other
        opening = _components(joined, 3 * F)[at[alone, 0]]
        return Patch(skin, tuple(halves[alone[opening == k]] for k in np.unique(opening)))

    def solid(self, vertices: Array) -> Solid:
        """The patch with vertices (N, 3) m, each opening closed by a cone from its rim's mean."""
        places, faces = vertices, [self.skin]
        for rim in self.rims:
            middle = np.full(len(rim), len(places))
            places = np.vstack([places, vertices[rim[:, 0]].mean(axis=0)])
            faces.append(np.column_stack([rim[:, ::-1], middle]))
        return Solid(places, self.skin, np.vstack(faces))


@dataclass(frozen=True, eq=False)
class Solid:
    """What a patch encloses once its openings are closed.

    Attributes:
        vertices: (N', 3) m, with those that close openings.
        skin: (F, 3) the triangles of the patch.
        faces: (F', 3) these, and those that close openings.
    """

    vertices: Array
    skin: Index
    faces: Index

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The lowest and the highest x, y, z (3,) m."""
        corners = self.vertices[self.skin.ravel()]
        return corners.min(axis=0), corners.max(axis=0)

    def holds(self, points: Array) -> Mask:
        """Which of points (M, 3) m are inside: their winding number is above one half."""
        low, high = self.box
        found = np.asarray(((points >= low) & (points <= high)).all(axis=1))
        found[found] = winding_numbers(points[found], self.vertices, self.faces) > INSIDE
        return found

    @cached_property
    def surface(self) -> SurfaceTree:
        """The skin, to be asked for its closest places."""
        return SurfaceTree(self.vertices, self.skin)

    @cached_property
    def border(self) -> SurfaceTree:
        """The same of all that closes the solid."""
        return SurfaceTree(self.vertices, self.faces)


@dataclass(frozen=True, eq=False)
class Deepest:
    """The place of a surface that is deepest within a solid.

    Attributes:
        depth: m from the skin of the solid; 0 if no place is inside.
        place: (3,) m; NaN if no place is inside.
        face: the triangle of the solid's skin that is closest to the place; -1 if there is none.
    """

    depth: float
    place: Array
    face: int


def deepest(triangles: Array, within: Solid, tolerance: float = 5e-4) -> Deepest:
    """Where triangles (F, 3 corners, 3) m are deepest within a solid.

    The depth of a place inside is its distance from the skin of the solid. It is right to
    `tolerance` m, if not only a spot smaller than this is deeper: triangles are divided into four,
    the most promising first, until none can hold a place that is deeper by more. No place of a
    triangle is deeper than its middle by more than their distance, and none is farther from the
    skin than a corner is from any one place of it.
    """
    low, high = within.box
    near = ((triangles.max(axis=1) >= low) & (triangles.min(axis=1) <= high)).all(axis=1)
    triangles = triangles[near]
    limits = np.full(len(triangles), np.inf)  # no place of the triangle is deeper
    best = Deepest(0.0, np.full(3, np.nan), -1)
    while len(triangles):
        first = np.argsort(-limits, kind="stable")
        now, later = first[:TOGETHER], first[TOGETHER:]
        looked, waiting = triangles[now], (triangles[later], limits[later])
        middles = looked.mean(axis=1)
        reach = np.linalg.norm(looked - middles[:, None], axis=2).max(axis=1)
        skin = within.surface.closest(middles)
        distances = abs(skin.distances)
        farthest = np.linalg.norm(looked - skin.points[:, None], axis=2).max(axis=1)
        inside = within.holds(middles)
        k = int(np.argmax(np.where(inside, distances, -1.0)))
        if inside[k] and distances[k] > best.depth:
            best = Deepest(float(distances[k]), middles[k], int(skin.faces[k]))
        own = np.minimum(np.minimum(distances + reach, farthest), limits[now])
        open_ = (own > best.depth + tolerance) & (reach > tolerance / 2)
        off = abs(within.border.closest(middles[open_]).distances)
        open_[open_] = inside[open_] | (off <= reach[open_])
        triangles = np.concatenate([_quartered(looked[open_]), waiting[0]])
        limits = np.concatenate([np.tile(own[open_], 4), waiting[1]])
        promising = limits > best.depth + tolerance
        triangles, limits = triangles[promising], limits[promising]
    return best


def _opposite(halves: Index) -> tuple[Index, Index]:
    """Which of the directed edges (E, 2) run opposite to which, (n,) and (n,)."""
    n = int(halves.max(initial=0)) + 1
    key, wanted = halves[:, 0] * n + halves[:, 1], halves[:, 1] * n + halves[:, 0]
    order = np.argsort(key, kind="stable")
    place = np.minimum(np.searchsorted(key, wanted, sorter=order), len(order) - 1)
    other = order[place]
    one = np.flatnonzero(key[other] == wanted)
    return one, other[one]


def _components(pairs: Index, n: int) -> Index:
    """The number of the connected component of each of n things that pairs (P, 2) join."""
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _quartered(triangles: Array) -> Array:
    """Each triangle (F, 3 corners, 3) as four, (4 F, 3, 3)."""
    a, b, c = triangles.transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(corners, axis=1) for corners in four])


FOLDS = 0.1  # m around a joint in which skin folds into itself
TORSO = "torso"  # the solid to which a limb is joined over its width


@dataclass(frozen=True, eq=False)
class Penetration:
    """A part of a body that is within another part.

    Attributes:
        part: the part whose skin is inside, such as left_hand.
        within: the part that it is inside of, such as chest.
        depth: m, the distance of the deepest place from the skin that it went through.
        place: (3,) m, that place.
    """

    part: str
    within: str
    depth: float
    place: Array


def penetrations(
    body: SkinnedBody, vertices: Array, tolerance: float = 5e-4
) -> tuple[Penetration, ...]:
    """What is inside of what in a posed body with vertices (N, 3) m, the deepest first.

    The mesh is cut into parts (`parts.BONES`). The torso, each hand with its fingers, and every
    other part is closed to a solid, and a place is inside if its winding number there is above one
    half. For each part and each other solid the deepest place is found, to `tolerance` m. On a mesh
    of few vertices a triangle may be 10 cm long and lie on the border of two parts;
    there, the corners nearest to the place decide which part is inside of which. Skin
    folds into itself around every joint. Two limbs that are joined, such as a thigh and its shin,
    are therefore not compared, and of limbs that are joined to the torso only the triangles that
    are at least 10 cm from it in the template, and the torso's triangles as far from the limb.

    Raises BadBody for a body without SMPL's joints, and for vertices of another shape. To measure
    many poses, make `BodySolids.of(body)` once.
    """
    return BodySolids.of(body).penetrations(vertices, tolerance)


@dataclass(frozen=True, eq=False)
class BodySolids:
    """The solids that the mesh of a body is cut into, and which triangles may go into which.

    Attributes:
        shape: of the body's vertices, (N, 3).
        parts: the name of each part.
        faces: (F, 3) all triangles.
        part_of: (F,) the number of each triangle's part.
        corner_of: (N,) the number of each vertex' part.
        joined: pairs of solids that are joined, or the same.
        patches: each solid's skin and openings.
        skins: for each solid, the numbers of its triangles.
        looked: for each solid and each part that may go into it, the part's triangles that count,
            those on its border by themselves.
    """

    shape: tuple[int, ...]
    parts: tuple[str, ...]
    faces: Index
    part_of: Index
    corner_of: Index
    joined: frozenset[frozenset[str]]
    patches: tuple[Patch, ...]
    skins: tuple[Index, ...]
    looked: tuple[tuple[Index, ...], ...]

    @staticmethod
    def of(body: SkinnedBody) -> BodySolids:
        """Those of a body. Raises BadBody for one without SMPL's joints."""
        joints = part_joints(body)
        parts = tuple(BONES[body.joint_names[k]] for k in joints)
        corner_of = np.searchsorted(joints, owners(body))
        part_of = np.searchsorted(joints, _of_faces(body))
        solids = np.array([solid_of(part) for part in parts])
        patches, skins, looked = [], [], []
        for solid in dict.fromkeys(solids[np.unique(part_of)].tolist()):
            skin = np.flatnonzero(solids[part_of] == solid)
            patches.append(Patch.of(body.faces[skin]))
            skins.append(skin)
            looked.append(_looked_at(body, skin, part_of, corner_of, solids))
        return BodySolids(
            body.template.shape,
            parts,
            body.faces,
            part_of,
            corner_of,
            _joined(body.faces, corner_of, solids),
            tuple(patches),
            tuple(skins),
            tuple(looked),
        )

    def penetrations(self, vertices: Array, tolerance: float = 5e-4) -> tuple[Penetration, ...]:
        """What is inside of what, the deepest first; see the function `penetrations`."""
        if np.shape(vertices) != self.shape:
            raise BadBody(f"vertices have shape {np.shape(vertices)}, but must be {self.shape}")
        found: dict[tuple[str, str], Penetration] = {}
        for patch, skin, looked in zip(self.patches, self.skins, self.looked, strict=True):
            solid = patch.solid(vertices)
            for chosen in looked:
                at = deepest(vertices[self.faces[chosen]], solid, tolerance)
                if at.face < 0:
                    continue
                part = self._part_at(vertices, at.place, self.faces[chosen])
                within = self._part_at(vertices, at.place, self.faces[skin[[at.face]]])
                one = Penetration(part, within, at.depth, at.place)
                pair = frozenset((solid_of(part), solid_of(within)))
                if len(pair) == 1 or (pair in self.joined and TORSO not in pair):
                    continue  # a triangle of two parts that folds where they are joined
                if (part, within) not in found or found[part, within].depth < at.depth:
                    found[part, within] = one
        return tuple(sorted(found.values(), key=lambda one: -one.depth))

    def _part_at(self, vertices: Array, place: Array, faces: Index) -> str:
        """The part of that corner of triangles (F, 3) which is nearest to a place."""
        corners = np.unique(faces)
        nearest = int(np.argmin(np.linalg.norm(vertices[corners] - place, axis=1)))
        return self.parts[int(self.corner_of[corners[nearest]])]


def _joined(faces: Index, corner_of: Index, solids: Array) -> frozenset[frozenset[str]]:
    """Pairs of solids that an edge joins, the same one twice included."""
    edges = solids[corner_of[faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)]]
    return frozenset(frozenset((str(a), str(b))) for a, b in np.unique(edges, axis=0))


def _looked_at(
    body: SkinnedBody, skin: Index, part_of: Index, corner_of: Index, solids: Array
) -> tuple[Index, ...]:
    """For each part the triangles that may go into the solid with this skin: those that are the
    part's with all three corners, and those on its border.

    Of joined solids, one of which is the torso, they are those far from each other; of others none.
    """
    own, joined = str(solids[part_of[skin[0]]]), _joined(body.faces, corner_of, solids)
    outside = np.flatnonzero(solids[part_of] != own)
    beside = np.array([frozenset((own, str(solid))) in joined for solid in solids])
    corners = np.unique(body.faces[outside])
    away = np.zeros(len(body.template))
    away[corners] = abs(
        SurfaceTree(body.template, body.faces[skin]).closest(body.template[corners]).distances
    )
    far = (away[body.faces[outside]] > FOLDS).all(axis=1)
    torso = (solids[part_of[outside]] == TORSO) | (own == TORSO)
    reaching = beside[corner_of[body.faces[outside]]].any(axis=1)
    chosen = outside[np.where(torso, far | ~beside[part_of[outside]], ~reaching)]
    whole = (corner_of[body.faces[chosen]] == part_of[chosen, None]).all(axis=1)
    kinds = 2 * part_of[chosen] + whole  # of triangles on a border the deepest place counts as well
    return tuple(chosen[kinds == kind] for kind in np.unique(kinds))


def _of_faces(body: SkinnedBody) -> Index:
    """The joint (F,) of the part that each face belongs to: that of two or three of its corners."""
    a, b, c = owners(body)[body.faces].T
    return np.asarray(np.where(b == c, b, a), dtype=np.int64)
