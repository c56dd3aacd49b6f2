"""How deep parts of a posed body are within each other, measured on its mesh.

The mesh is cut into parts, each part is closed to a solid, a place is inside if its winding number
is above one half, and the deepest place is found by branch and bound (`geometry/penetration.py`).
Triangles on the border of two parts may be long; each place on one belongs to the part of the
nearest corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.parts import BONES, owners, part_joints, solid_of
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.penetration import Patch, deepest
from workbench.geometry.surface_tree import SurfaceTree

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
