"""Points on bodies for many values at once: the kinematics in one call, the surface by BLAS.

A landmark is a weighted mean of vertices, and a vertex a weighted mean of what each joint makes of
it. Landmark m, sum_i r_mi sum_j w_ij G_j (v_i; 1), is therefore a sum over joints of

    G_j (sum_i r_mi w_ij v_i; sum_i r_mi w_ij),

so that each pair of a landmark and a joint that moves it needs one rest point, whatever the
number of vertices. This is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from workbench.blocks import PointSource
from workbench.blocks.many import Many, Mapped
from workbench.bodies import surface
from workbench.bodies.motion import Motion
from workbench.bodies.numeric import SurfaceArrays, chunks_of, many_points
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.sources import JointPoints, LandmarkPoints, SurfacePoints
from workbench.geometry.rotation import matrix_from_vector

Array = NDArray[np.float64]
ManyPoints = Callable[[Mapping[str, Array]], Array]  # values (M, *shape) by block -> (M, N, 3) m
TOGETHER = 32  # bodies in one matrix product: measured, more would leave the cache


@singledispatch
def batched(source: PointSource) -> ManyPoints | None:
    """A source's points for many values at once; None if it has only its graph."""
    return None


@batched.register
def _(source: SurfacePoints) -> ManyPoints | None:
    if source.numeric is None:
        return None
    body, names = source.at.body, source.numeric.reads
    whole = isinstance(source.vertices, slice) and source.vertices == slice(None)
    vertices = source.vertices if isinstance(source.vertices, slice) else list(source.vertices)
    chunks = body.chunks if whole else chunks_of(body, vertices)
    motions = ManyMotions.of(body)

    def points(values: Mapping[str, Array]) -> Array:
        pose, betas, trans = (values[name] for name in names)
        found = np.empty((len(betas), source.count, 3))
        for first in range(0, len(betas), TOGETHER):
            some = slice(first, first + TOGETHER)
            pairs = zip(*motions(pose[some], betas[some]), strict=True)
            each = [Motion(G, features, np.empty((0, 3))) for G, features in pairs]
            found[some] = many_points(chunks, each, betas[some])
        return found + trans[:, None]

    return points


@batched.register
def _(source: LandmarkPoints) -> ManyPoints | None:
    if source.numeric is None:
        return None
    body, names = source.at.body, source.numeric.reads
    pairs = Pairs.of(body, source.landmarks.regressor)
    motions = ManyMotions.of(body)

    def points(values: Mapping[str, Array]) -> Array:
        pose, betas, trans = (values[name] for name in names)
        return pairs.points(*motions(pose, betas), betas) + trans[:, None]

    return points


@batched.register
def _(source: JointPoints) -> ManyPoints | None:
    body, names = source.at.body, source.at.names
    if names is None or body.free:
        return None
    joints = ManyJoints.of(body)

    def points(values: Mapping[str, Array]) -> Array:
        pose, betas, trans = (values[name] for name in names)
        return joints(pose, betas) + trans[:, None]

    return points


def in_full(source: PointSource) -> cs.MX:
    """A source's expression (3, N) as it is."""
    return source.expression


def lean(source: PointSource) -> cs.MX:
    """A source's expression (3, N) in as few numbers as it takes: landmarks by pairs."""
    if not isinstance(source, LandmarkPoints) or source.numeric is None:
        return source.expression
    pose, betas, trans = source.at.symbols
    features, G, _ = surface.motions(source.at.body, pose, betas)
    pairs = Pairs.of(source.at.body, source.landmarks.regressor)
    return pairs.expression(G, features, betas) + cs.repmat(trans, 1, source.count)


@dataclass(frozen=True, eq=False)
class ManyJoints:
    """A body's posed joints alone: `world_motions` of kinematics, all of a generation at once."""

    mean: Array  # (K - 1, 3) m, each bone in its parent's frame
    moves: Array  # (B, 3 (K - 1)) m
    root: tuple[Array, Array]  # (3,) and (B, 3) m
    generations: list[tuple[NDArray[np.int64], NDArray[np.int64]]]  # joints, and their parents

    @staticmethod
    def of(body: SkinnedBody) -> ManyJoints:
        """The bones, linear in betas: J(betas) is."""
        K, B = body.n_joints, body.n_betas
        at = body.J_regressor @ body.template  # (K, 3)
        flat = body.J_regressor @ body.shapedirs.reshape(body.n_vertices, -1)
        by_betas = np.asarray(flat).reshape(K, 3, B)
        local, parents = matrix_from_vector(body.bind_pose), np.array(body.parents)
        bound = [local[0]]
        for k in range(1, K):
            bound.append(bound[parents[k]] @ local[k])
        up = parents[1:]
        turned = np.array(bound)[up].reshape(-1, 3, 3)
        mean = np.einsum("kdc,kd->kc", turned, at[1:] - at[up])
        moves = np.einsum("kdc,kdb->bkc", turned, by_betas[1:] - by_betas[up])
        depth = np.zeros(K, dtype=int)
        for k in range(1, K):
            depth[k] = depth[parents[k]] + 1
        each = (np.flatnonzero(depth == d) for d in range(1, int(depth.max(initial=0)) + 1))
        return ManyJoints(
            mean, moves.reshape(B, -1), (at[0], by_betas[0].T), [(k, parents[k]) for k in each]
        )

    def __call__(self, pose: Array, betas: Array) -> Array:
        """(M, K, 3) m for pose (M, K, 3) rad and betas (M, B), before translation."""
        M, K = pose.shape[:2]
        # SciPy's, for many: CasADi's own takes most of the time to convert its arguments
        R = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix().reshape(M, K, 3, 3)
        bones = self.mean + (betas @ self.moves).reshape(M, K - 1, 3)
        joints = np.empty((M, K, 3))
        joints[:, 0] = self.root[0] + betas @ self.root[1]
        for k, up in self.generations:
            above = R[:, up]  # in the world by now
            joints[:, k] = joints[:, up] + np.einsum("mkdc,mkc->mkd", above, bones[:, k - 1])
            R[:, k] = above @ R[:, k]
        return joints


@dataclass(frozen=True, eq=False)
class ManyMotions:
    """A body's kinematics for many poses (M, K, 3) rad and betas (M, B)."""

    function: Many
    joints: int

    @staticmethod
    def of(body: SkinnedBody) -> ManyMotions:
        """The kinematics' own function, evaluated another way."""
        function = body.kinematics._motion.function
        return ManyMotions(Mapped(function, (False, False)), body.n_joints)

    def __call__(self, pose: Array, betas: Array) -> tuple[Array, Array]:
        """G (M, K, 3, 4) and features (M, 9 (K - 1))."""
        M = len(pose)
        G, features, _ = self.function(pose.reshape(M, -1), betas)
        return G.reshape(M, self.joints, 3, 4), features


@dataclass(frozen=True, eq=False)
class Pairs:
    """Rest points for each pair of a landmark and a joint that moves it, P of them, planar."""

    joint: NDArray[np.int64]  # (P,)
    first: NDArray[np.int64]  # (L,) where each landmark's pairs begin
    used: NDArray[np.int64]  # the features that move any of them
    template: Array  # (3 P,) m
    shapedirs: Array  # (B, 3 P)
    posedirs: Array  # (used, 3 P)
    mass: Array  # (P,)

    @staticmethod
    def of(body: SurfaceArrays, regressor: csr_array) -> Pairs:
        """regressor (L, N)."""
        r = regressor.toarray()
        mixed = np.einsum("li,ij->lji", r, body.weights)  # (L, K, N)
        landmark, joint = np.nonzero(abs(mixed).sum(axis=2))
        # a landmark without weight still has a place
        empty = np.setdiff1d(np.arange(len(r)), landmark)
        landmark, joint = np.append(landmark, empty), np.append(joint, 0 * empty)
        order = np.argsort(landmark, kind="stable")
        landmark, joint = landmark[order], joint[order]
        A = mixed[landmark, joint]  # (P, N)
        P = len(A)

        def summed(arrays: Array) -> Array:  # (N, 3, b) -> (b, 3 P)
            return np.ascontiguousarray(
                np.tensordot(A, arrays, axes=(1, 0)).transpose(2, 1, 0)
            ).reshape(-1, 3 * P)

        posedirs = summed(body.posedirs)
        used = np.flatnonzero(abs(posedirs).max(axis=1, initial=0))
        return Pairs(
            joint, np.searchsorted(landmark, np.arange(len(r))), used,
            summed(body.template[:, :, None])[0], summed(body.shapedirs),
            np.ascontiguousarray(posedirs[used]), A.sum(axis=1),
        )  # fmt: skip

    def points(self, G: Array, features: Array, betas: Array) -> Array:
        """(M, L, 3) m, before translation."""
        M, P = len(G), len(self.joint)
        flat = betas @ self.shapedirs + features[:, self.used] @ self.posedirs + self.template
        rest = flat.reshape(M, 3, P)
        turns = G.transpose(0, 2, 3, 1)[..., self.joint]  # (M, 3, 4, P)
        moved = np.einsum("mdcp,mcp->mdp", turns[:, :, :3], rest) + turns[:, :, 3] * self.mass
        return np.asarray(np.add.reduceat(moved, self.first, axis=2).transpose(0, 2, 1))

    def expression(self, G: Sequence[cs.MX], features: cs.MX, betas: cs.MX) -> cs.MX:
        """(3, L) m in symbols, before translation."""
        P = len(self.joint)
        shaped = cs.sparsify(cs.DM(self.shapedirs.T)) @ betas
        bent = cs.sparsify(cs.DM(self.posedirs.T)) @ features[self.used.tolist()]
        rest = cs.reshape(cs.DM(self.template) + shaped + bent, P, 3).T  # (3, P)
        moved = [
            G[joint][:, :3] @ rest[:, p] + G[joint][:, 3] * self.mass[p]
            for p, joint in enumerate(self.joint.tolist())
        ]
        edges = [*self.first.tolist(), P]
        return cs.horzcat(*[sum(moved[i:j][1:], moved[i]) for i, j in pairwise(edges)])
