"""What a triangle body computes with, made from its arrays when it is first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.geometry.triangles import edges


@dataclass(frozen=True, eq=False)
class Limb:
    """What joint k turns: the faces with a weight on it or below, and those that feel its twist.

    Attributes:
        joints: k and all below it.
        faces: the n faces with a weight on one of these.
        weights: of these faces on those joints.
        onto_vertices: (N, 2 n) from the edges of these faces to vertices.
        bent: the m faces near k.
        slot: (m,) which of their near joints k is.
        bent_onto_vertices: (N, 2 m) from the edges of these to vertices.
    """

    joints: Index
    faces: Index
    weights: csr_array
    onto_vertices: csr_array
    bent: Index
    slot: Index
    bent_onto_vertices: csr_array


class PackedTriangles:
    """The arrays of a triangle body, in the order that arithmetic needs."""

    def __init__(self, body: TriangleArrays) -> None:
        self.stitching, self.weights = body.stitching, body.weights
        self.template = body.template
        self.shapedirs, self.posedirs, self.near = body.shapedirs, body.posedirs, body.near
        self.shape_columns = body.shapedirs.reshape(9 * body.n_faces, body.n_betas)
        nowhere = Skeleton(np.zeros((len(body.parents), 3)), np.zeros((len(body.parents), 3, 0)))
        self.kinematics = Kinematics(nowhere, body.bind_pose, body.parents)  # for its rotations
        self.root_row = body.J_regressor[[0]]
        self.root = np.asarray(self.root_row @ body.template).ravel()  # (3,) m
        self.edges = edges(body.template, body.faces)  # (F, 2, 3) m
        # posedirs on the edges: what a radian of each twist adds to Q e, (F, 2, 3, 3 J)
        self.bends = np.einsum("facj,fic->fiaj", body.posedirs, self.edges, optimize=True)
        self.parents = body.parents

    @cached_property
    def limbs(self) -> list[Limb]:
        """What each joint turns."""
        K = len(self.parents)
        below: list[list[int]] = [[k] for k in range(K)]
        for k in range(K - 1, 0, -1):
            below[self.parents[k]] += below[k]
        A_t, columns, found = self.stitching.A.T.tocsc(), self.weights.tocsc(), []
        for k in range(K):
            faces = np.unique(columns[:, sorted(below[k])].indices).astype(np.int64)
            bent, slot = np.nonzero(self.near == k)
            sides = (csr_array(A_t[:, _edges_of(some)].tocsr()) for some in (faces, bent))
            joints = np.array(sorted(below[k]))
            weights = csr_array(self.weights[faces][:, joints])
            found.append(Limb(joints, faces, weights, next(sides), bent, slot, next(sides)))
        return found

    @cached_property
    def shape_slopes(self) -> Array:
        """What betas add to D, (9 F, B), in the rows (r, c, f)."""
        F, _, _, B = self.shapedirs.shape
        return np.ascontiguousarray(self.shapedirs.transpose(1, 2, 0, 3)).reshape(9 * F, B)

    @cached_property
    def bend_slopes(self) -> csr_array:
        """What the pose adds to Q e, (6 F, 3 K), in the rows (i, a, f)."""
        F, J = self.near.shape
        slopes = self.bends.reshape(F, 2, 3, J, 3)
        f, i, a, j, axis = np.indices(slopes.shape)
        rows, columns = (3 * i + a) * F + f, 3 * self.near[f, j] + axis
        shape = (6 * F, 3 * len(self.parents))
        return csr_array((slopes.ravel(), (rows.ravel(), columns.ravel())), shape=shape)

    def placed(self, cotangents: Array) -> Array:
        """The vertices (N, k) that answer to cotangents (N, k), the root joint at zero."""
        V = self.stitching.solve(cotangents)
        return np.asarray(V - self.root_row @ V)


def _edges_of(faces: Index) -> Index:
    return (2 * faces[:, None] + np.arange(2)).ravel()
