"""The surface of a body whose arrays are unknowns, and its sparse derivative by each of them.

With turns Q_k and features f of the pose, c_im the weight of vertex i at or below joint m, and
D_m = Q_parent(m) - Q_m (the identity for the root's parent),

    v'_i = A_i v_i + sum over m of c_im D_m j_m + trans,    A_i = sum over k of w_ik Q_k,
    v_i = T_i + S_i beta + P_i f,                           j = J_regressor (T + S beta)

so that the points are linear in T, S, P, in the joints j and in the weights, each alone. Only the
derivative by the pose needs more than products of these; it is that of `mesh`.

Derivatives by arrays are sparse: a vertex moves with its own numbers and with the joints at and
above which it hangs, and through the regressor with the vertices that these are means of.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array, kron

from workbench.arrays import Array, Index
from workbench.blocks.points import NumericPoints, PointsAt
from workbench.bodies.forward.motion import JointMotion, Kinematics
from workbench.bodies.forward.skinning import blend_matrices

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

BLOCKS = "pose", "betas", "trans"


@dataclass(frozen=True, eq=False)
class FreedSurface(NumericPoints):
    """Vertices of an SMPL body, some of whose arrays are blocks of a problem.

    Attributes:
        body: the body, whose other arrays are used.
        kinematics: only its rotations and features are used, which do not depend on the joints.
        chosen: (n,) the numbers of the vertices.
        names: the problem's blocks by the names `pose`, `betas`, `trans` and those of arrays.
    """

    body: SkinnedBody
    kinematics: Kinematics
    chosen: Index
    names: Mapping[str, str]

    @property
    def reads(self) -> tuple[str, ...]:
        """The blocks of pose, betas, trans and the free arrays, by their names in the problem."""
        return tuple(self.names.values())

    @cached_property
    def own_names(self) -> dict[str, str]:
        """The names of the blocks in the body, by their names in the problem."""
        return {block: own for own, block in self.names.items()}

    def pattern(self, name: str) -> csc_array | None:
        """Where the derivative (3 n, size) by a block can be nonzero; None where it is dense.

        It is that at random values of all blocks, at which no other entry is zero.
        """
        array = self.own_names[name]
        if array in BLOCKS or ("J_regressor" in self.names and array in ("template", "shapedirs")):
            return None
        if "weights" in self.names and array in ("joints", "J_regressor"):
            return None
        J = self._at_random.jacobian(name)
        return csc_array((np.ones(J.nnz), J.indices, J.indptr), shape=J.shape)

    @cached_property
    def _at_random(self) -> FreedSurfaceAt:
        rng, (K, _, B) = np.random.default_rng(0), self.kinematics.skeleton.by_betas.shape
        shapes = {"pose": (K, 3), "betas": (B,), "trans": (3,), "joints": (K, 3)}
        return self.evaluate(
            {
                block: rng.uniform(0.1, 1.0, shapes.get(own) or getattr(self.body, own).shape)
                for own, block in self.names.items()
            }
        )

    def evaluate(self, values: Mapping[str, Array]) -> FreedSurfaceAt:
        """The vertices where the blocks have these values."""
        arrays = {own: values[block] for own, block in self.names.items()}
        pose, betas, trans = (arrays.pop(name) for name in BLOCKS)
        return FreedSurfaceAt(self, arrays, pose, betas, trans)


@dataclass(frozen=True, eq=False)
class FreedSurfaceAt(PointsAt):
    """The vertices at one set of arrays, pose (K, 3) rad, betas (B,) and trans (3,) m.

    `arrays` stand in for the body's own.
    """

    of: FreedSurface
    arrays: Mapping[str, Array]
    pose: Array
    betas: Array
    trans: Array

    @cached_property
    def motion(self) -> JointMotion:
        """The motion of the joints, of which turns and features are read."""
        return self.of.kinematics.motion(self.pose, self.betas)

    @cached_property
    def turns(self) -> Array:
        """Q: the rotation of each joint in the world, (K, 3, 3)."""
        return self.motion.G[:, :, :3]

    @cached_property
    def levers(self) -> Array:
        """D: the rotation above each joint less its own, (K, 3, 3)."""
        above = np.concatenate([np.eye(3)[None], self.turns[list(self.of.body.parents[1:])]])
        return above - self.turns

    @cached_property
    def person(self) -> Array:
        """T + S beta of every vertex, (N, 3) m."""
        return self._array("template") + self._array("shapedirs") @ self.betas

    @property
    def regressed(self) -> bool:
        """Whether the regressor finds the joints."""
        return "joints" not in self.arrays and self.of.body.rest_joints is None

    @cached_property
    def joints(self) -> Array:
        """j: the joints at rest, (K, 3) m."""
        if "joints" in self.arrays:
            return self.arrays["joints"]
        fixed = self.of.body.rest_joints
        return np.asarray(self._regressor @ self.person) if fixed is None else fixed

    @cached_property
    def shifts(self) -> Array:
        """The last column of each joint's motion, (K, 3) m."""
        steps = (self.levers @ self.joints[:, :, None])[:, :, 0]
        return np.asarray(self.of.kinematics.ancestors @ steps)

    @cached_property
    def weights(self) -> Array:
        """The skinning weights of the chosen vertices, (n, K)."""
        return self._array("weights")[self.of.chosen]

    @cached_property
    def below(self) -> Array:
        """c: the weight that each joint and those below it carry, (n, K)."""
        return np.asarray(self.weights @ self.of.kinematics.ancestors)

    @cached_property
    def blended(self) -> Array:
        """A: the blended rotation of each chosen vertex, (n, 3, 3)."""
        return blend_matrices(self.weights, self.turns)

    @cached_property
    def rest(self) -> Array:
        """v: the chosen vertices at rest, with all blend shapes, (n, 3) m."""
        corrections = self._array("posedirs")[self.of.chosen] @ self.motion.features
        return np.asarray(self.person[self.of.chosen] + corrections)

    @cached_property
    def carried(self) -> Array:
        """Where each joint alone would take each vertex, (n, K, 3) m."""
        turned: Array = np.einsum("kdc,nc->nkd", self.turns, self.rest)
        return turned + self.shifts

    @cached_property
    def points(self) -> Array:
        """v' + trans: the posed vertices, (n, 3) m."""
        blended: Array = np.einsum("nk,nkd->nd", self.weights, self.carried)
        return blended + self.trans

    def jacobian(self, name: str) -> csc_array:
        """The points' derivative (3 n, size) by a block.

        Rows are x, y, z of vertex after vertex, and columns the block's numbers in NumPy's order.
        """
        return self._jacobians[self.of.own_names[name]]()

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the transposed derivative into[block] (size, 3 n)."""
        for name, array in into.items():
            np.multiply(self.jacobian(name).T.toarray(), 1.0 if scale is None else scale, out=array)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """Gradients of cotangent . points by the blocks, from their Jacobians."""
        return {name: self.jacobian(name).T @ cotangent for name in self.of.reads}

    @property
    def _jacobians(self) -> dict[str, Callable[[], csc_array]]:
        return {
            "pose": self._by_pose,
            "betas": self._by_betas,
            "trans": lambda: csc_array(np.tile(np.eye(3), (len(self.of.chosen), 1))),
            "template": lambda: csc_array(self._by_person),
            "shapedirs": lambda: csc_array(kron(self._by_person, self.betas[None])),
            "posedirs": lambda: csc_array(kron(self._by_rest, self.motion.features[None])),
            "joints": lambda: csc_array(self._by_joints),
            "weights": self._by_weights,
            "J_regressor": self._by_regressor,
        }

    @cached_property
    def _by_rest(self) -> csr_array:
        """A in blocks, by the rest vertices: (3 n, 3 N)."""
        columns = 3 * self.of.chosen[:, None, None] + np.arange(3)  # (n, 1, 3)
        return self._rows(self.blended, np.broadcast_to(columns, self.blended.shape), 3)

    @cached_property
    def _by_joints(self) -> Array:
        """The derivative c_im D_m of the points by the joints at rest, (3 n, 3 K)."""
        blocks: Array = np.einsum("nm,mdc->ndmc", self.below, self.levers)
        return blocks.reshape(3 * len(self.of.chosen), -1)

    @cached_property
    def _by_person(self) -> csr_array:
        """The derivative by T + S beta, (3 n, 3 N): directly, and through the joints."""
        if not self.regressed:
            return self._by_rest
        onto_joints = kron(self._regressor, np.eye(3), format="csr")
        return csr_array(self._by_rest + csr_array(self._by_joints) @ onto_joints)

    def _by_weights(self) -> csc_array:
        K = self.weights.shape[1]
        columns = K * self.of.chosen[:, None, None] + np.arange(K)  # (n, 1, K)
        blocks = self.carried.transpose(0, 2, 1)  # (n, 3, K)
        return csc_array(self._rows(blocks, np.broadcast_to(columns, blocks.shape), K))

    def _by_regressor(self) -> csc_array:
        on_all = kron(eye_array(len(self.joints)), self.person.T, format="csr")  # (3 K, K N)
        return csc_array(csr_array(self._by_joints) @ on_all)

    def _by_betas(self) -> csc_array:
        N, _, B = self._array("shapedirs").shape
        return csc_array(self._by_person @ self._array("shapedirs").reshape(3 * N, B))

    def _by_pose(self) -> csc_array:
        by = self.motion.derivatives
        (n, K), A = self.weights.shape, self.of.kinematics.ancestors
        centres = np.einsum("kdc,kc->kd", self.turns, self.joints) + self.shifts  # the posed joints
        subtrees = np.tensordot(
            A, self.weights[:, :, None] * self.carried, axes=(0, 1)
        )  # (K, n, 3)
        subtrees -= self.below.T[:, :, None] * centres[:, None]
        by_angle = np.einsum("kadu,knu->ndka", by.turns.reshape(K, 3, 3, 3), subtrees)
        if K > 1:
            P = self._array("posedirs")[self.of.chosen].reshape(n, 3, K - 1, 9)
            d_rest = np.einsum("nckf,kfa->ncka", P, by.d_features[1:])
            by_angle[:, :, 1:] += np.einsum("ndc,ncka->ndka", self.blended, d_rest)
        return csc_array(by_angle.reshape(3 * n, 3 * K))

    def _rows(self, blocks: Array, columns: Index, width: int) -> csr_array:
        """A matrix of blocks (n, 3, .), vertex by vertex, for `width` numbers of every vertex."""
        starts = np.arange(0, blocks.size + 1, blocks.shape[2])
        shape = (3 * len(blocks), width * self.of.body.n_vertices)
        return csr_array((blocks.ravel(), columns.ravel(), starts), shape=shape)

    @cached_property
    def _regressor(self) -> csr_array:
        if "J_regressor" in self.arrays:
            return csr_array(self.arrays["J_regressor"])
        return self.of.body.J_regressor

    def _array(self, name: str) -> Array:
        array: Array = self.arrays[name] if name in self.arrays else getattr(self.of.body, name)
        return array
