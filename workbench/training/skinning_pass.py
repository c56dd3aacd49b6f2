"""Linear blend skinning of a few registrations, its derivative and the adjoint of that."""

from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.posing import Posing
from workbench.bodies.forward.skinning import blend_matrices
from workbench.geometry.rotation import crossed
from workbench.training.estimate import Change, Estimate


@dataclass(frozen=True, eq=False)
class SkinningPass:
    """c registrations as an estimate poses them, before translation.

    Attributes:
        estimate: the templates, joints, posedirs, weights and poses.
        some: the rows of these registrations.
        subject: (c,) the number of each registration's subject.
        posing: their joints' rotations.
        rest: (c, N, 3) in metres, T_s + P f.
        blended: (c, N, 3, 3) sum_k w_ik R_k.
        shifts: (c, K, 3) in metres, D_m j_m.
    """

    estimate: Estimate
    some: slice
    subject: Index
    posing: Posing
    rest: Array
    blended: Array
    shifts: Array

    @classmethod
    def of(cls, estimate: Estimate, some: slice, subject: Index) -> "SkinningPass":
        """The pass over the registrations of these rows, whose subjects are given."""
        posing = estimate.posing.only(some)
        return cls(
            estimate,
            some,
            subject,
            posing,
            estimate.templates[subject] + bent(estimate.posedirs, posing.features),
            blend_matrices(estimate.weights, posing.world),
            _apply(posing.levers, estimate.joints[subject]),
        )

    @property
    def features(self) -> Array:
        """The pose features, (c, F)."""
        return self.posing.features

    @property
    def points(self) -> Array:
        """The posed vertices, (c, N, 3) m, computed anew each time."""
        return _apply(self.blended, self.rest) + self.estimate.subtree_weights @ self.shifts

    def at_rest(self, away: Array) -> Array:
        """The displacement at rest (c, N, 3) m that moves the posed vertices by `away`."""
        return np.asarray(np.linalg.solve(self.blended, away[..., None])[..., 0])

    def tangent(self, change: Change) -> Array:
        """How the points move with a small change of the estimate, (c, N, 3) m."""
        rest: list[Array] = []
        shifts: list[Array] = []
        blended: list[Array] = []
        if "templates" in change:
            rest.append(change["templates"][self.subject])
        if "posedirs" in change:
            rest.append(bent(change["posedirs"], self.features))
        if "joints" in change:
            shifts.append(_each(self.posing.levers, change["joints"][self.subject]))
        if "poses" in change:
            d_world, d_local = self.posing.turning(change["poses"][self.some])
            blended.append(blend_matrices(self.estimate.weights, d_world))
            d_levers = -d_world
            d_levers[:, 1:] += d_world[:, list(self.estimate.parents[1:])]
            shifts.append(_each(d_levers, self.estimate.joints[self.subject]))
            d_features = d_local[:, 1:].reshape(len(d_local), -1)
            rest.append(bent(self.estimate.posedirs, d_features))
        if "weights" in change:
            blended.append(blend_matrices(change["weights"], self.posing.world))
        moved = np.zeros((len(self.subject), len(self.estimate.weights), 3))
        if rest:
            moved += _apply(self.blended, reduce(add, rest))
        if blended:
            moved += _apply(reduce(add, blended), self.rest)
        if shifts:
            moved += self.estimate.subtree_weights @ reduce(add, shifts)
        if "weights" in change:
            moved += change["weights"] @ ancestors(self.estimate.parents) @ self.shifts
        return moved

    def adjoint(self, pull: Array, into: Change) -> None:
        """Add the gradients of sum(pull * points), for pull (c, N, 3), to the names of `into`."""
        names, c = into.keys(), len(pull)
        if names & {"templates", "posedirs", "poses"}:
            on_rest = np.einsum("jnab,jna->jnb", self.blended, pull, optimize=False)
        if "templates" in into:
            for s in np.unique(self.subject):
                into["templates"][s] += on_rest[self.subject == s].sum(axis=0)
        if "posedirs" in into:
            flat = on_rest.reshape(c, -1).T @ self.features
            into["posedirs"] += flat.reshape(into["posedirs"].shape)
        if names & {"joints", "poses"}:
            on_shifts = self.estimate.subtree_weights.T @ pull  # (c, K, 3)
        if "joints" in into:
            on_joints = _each(self.posing.levers.swapaxes(-1, -2), on_shifts)
            np.add.at(into["joints"], self.subject, on_joints)
        if names & {"poses", "weights"}:
            outer = (pull[..., :, None] * self.rest[..., None, :]).reshape(c, -1, 9)
        if "poses" in into:
            into["poses"][self.some] += self._on_poses(outer, on_shifts, on_rest)
        if "weights" in into:
            world = self.posing.world.reshape(c, -1, 9)
            into["weights"] += _summed(outer, world)
            below = _summed(pull, self.shifts) @ ancestors(self.estimate.parents).T
            into["weights"] += below

    def _on_poses(self, outer: Array, on_shifts: Array, on_rest: Array) -> Array:
        c, K = on_shifts.shape[:2]
        on_world = (self.estimate.weights.T @ outer).reshape(c, K, 3, 3)
        on_levers = on_shifts[..., :, None] * self.estimate.joints[self.subject][..., None, :]
        on_world -= on_levers
        for k, parent in enumerate(self.estimate.parents[1:], start=1):
            on_world[:, parent] += on_levers[:, k]
        on_local = np.zeros_like(on_world)
        P = self.estimate.posedirs
        if not P.shape[2]:
            return self.posing.turning_back(on_world, on_local)
        on_features = on_rest.reshape(c, -1) @ P.reshape(-1, P.shape[2])
        on_local[:, 1:] = on_features.reshape(c, K - 1, 3, 3)
        return self.posing.turning_back(on_world, on_local)

    def by_each(self) -> Array:
        """Where each joint alone would take each vertex, (c, N, K, 3) m."""
        moved = np.einsum("jkab,jnb->jnka", self.posing.world, self.rest, optimize=True)
        moved += (ancestors(self.estimate.parents) @ self.shifts)[:, None]
        return np.asarray(moved)

    def arms(self) -> Array:
        """The vectors from each posed joint to the vertices below it, weighted, (c, N, K, 3) m.

        A small turn u of joint k in the world moves vertex i by u x arm_ik.
        """
        A = ancestors(self.estimate.parents)
        offsets = A @ self.shifts  # of the binding motions
        posed = self.by_each() * self.estimate.weights[..., None]
        at = _each(self.posing.world, self.estimate.joints[self.subject]) + offsets
        below = np.einsum("km,jnka->jnma", A, posed, optimize=True)
        return np.asarray(below - self.estimate.subtree_weights[..., None] * at[:, None])

    def bulging(self) -> Array:
        """How small turns of all joints but the root move vertices by pose blend shapes.

        The shape is (c, N, K - 1, 3, 3) in metres per radian; the last axis is that of the turn.
        """
        local, P = self.posing.local[:, 1:], self.estimate.posedirs
        (c, m), N = local.shape[:2], len(P)
        if not P.shape[2]:
            return np.zeros((c, N, m, 3, 3))
        slopes = (crossed(np.eye(3)) @ local[:, :, None]).reshape(c, m, 3, 9)  # of the features
        at_rest = np.einsum("nbmf,cmdf->cnmbd", P.reshape(N, 3, m, 9), slopes, optimize=True)
        return np.asarray(self.blended[:, :, None] @ at_rest)


def bent(posedirs: Array, features: Array) -> Array:
    """P f, (c, N, 3) m, of posedirs (N, 3, F) and features (c, F); zero if there are no posedirs.

    Posedirs (N, 3, 0) stand for those of a body without blend shapes, which are not multiplied.
    """
    N = len(posedirs)
    if not posedirs.shape[2]:
        return np.zeros((len(features), N, 3))
    return np.asarray(features @ posedirs.reshape(3 * N, -1).T).reshape(-1, N, 3)


def _each(matrices: Array, vectors: Array) -> Array:
    """Matrices (..., 3, 3), each times its vector (..., 3), by matrix products."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _apply(matrices: Array, points: Array) -> Array:
    return np.asarray(np.einsum("jnab,jnb->jna", matrices, points))


def _summed(left: Array, right: Array) -> Array:
    """sum over j and d of left (c, N, d) right (c, K, d): (N, K)."""
    N, K = left.shape[1], right.shape[1]
    flat_left = left.transpose(1, 0, 2).reshape(N, -1)
    return flat_left @ right.transpose(1, 0, 2).reshape(K, -1).T
