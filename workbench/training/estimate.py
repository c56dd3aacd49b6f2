"""The unknowns of training, the sigma of each of its terms, and linear blend skinning of a few
registrations with its derivative and the adjoint of that.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property, reduce
from operator import add

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.posing import Posing
from workbench.bodies.forward.skinning import blend_matrices
from workbench.geometry.rotation import crossed

Change = dict[str, Array]
NAMES = ("templates", "posedirs", "joints", "poses", "weights")


@dataclass(frozen=True, eq=False)
class Estimate:
    """The unknowns of training: S subjects in J registrations of N vertices on K joints.

    There are F = 9 (K - 1) pose features.

    Attributes:
        templates: (S, N, 3) in metres, each subject at rest.
        joints: (S, K, 3) in metres, each subject's joints at rest.
        posedirs: (N, 3, F) in metres per unit of pose feature.
        weights: (N, K) skinning weights; rows sum to one.
        poses: (J, K, 3) in radians, the pose of each registration.
        parents: the tree of the joints.
        regressor: (K, N) joints from templates; None until it is learned.
    """

    templates: Array
    joints: Array
    posedirs: Array
    weights: Array
    poses: Array
    parents: tuple[int, ...]
    regressor: csr_array | None = None

    @cached_property
    def posing(self) -> Posing:
        """The joints' rotations in every registration."""
        return Posing.of(self.poses, self.parents)

    @cached_property
    def subtree_weights(self) -> Array:
        """Each vertex's weight at or below each joint, (N, K)."""
        return self.weights @ ancestors(self.parents)

    def of_rows(self, rows: Index | slice, subject: Index) -> "tuple[Estimate, Index]":
        """Some registrations with only the subjects that they show, and how these are numbered.

        `subject` (c,) are the subjects of the rows. The regressor is left out.
        """
        own, numbered = np.unique(subject, return_inverse=True)
        theirs = replace(
            self,
            templates=self.templates[own],
            joints=self.joints[own],
            poses=self.poses[rows],
            regressor=None,
        )
        return theirs, numbered

    def moved(self, change: Change, share: float = 1.0) -> "Estimate":
        """The estimate after a share of a step; poses are turned, everything else is added."""
        moved = {n: getattr(self, n) + share * d for n, d in change.items() if n != "poses"}
        if "poses" in change:
            moved["poses"] = self.posing.turned(share * change["poses"]).poses
        return replace(self, **moved)

    def zero_change(self, names: tuple[str, ...]) -> Change:
        """A step of length zero in these names."""
        return {name: np.zeros_like(getattr(self, name)) for name in names}

    def arrays(self) -> dict[str, Array]:
        """The arrays by name, as a checkpoint stores them."""
        arrays = {name: getattr(self, name) for name in NAMES}
        return (
            arrays if self.regressor is None else arrays | {"regressor": self.regressor.toarray()}
        )


@dataclass(frozen=True)
class Sigmas:
    """The standard deviation that each term expects; infinity switches a term off.

    The weights of the lectures are ratios of variances: lambda_P = (data / posedirs)^2 and so on,
    so that E = E_D + lambda_Y E_Y + lambda_J E_J + lambda_P E_P + lambda_W E_W is 2 data^2 times
    the cost.

    Attributes:
        data: in metres (E_D), of a registration from the model.
        symmetry: in metres (E_Y), of a template from its mirror image.
        joint_symmetry: in metres (E_Y), of the joints from their mirror image.
        rings: in metres (E_J), of the joints from the mean of the ring of vertices around them,
            and from the regressor once it is learned.
        posedirs: in metres per unit of pose feature (E_P), of posedirs from zero.
        weights: of the weights from the initial ones (E_W).
        subjects: in metres (E_T), of a subject's template from the first template.
    """

    data: float = 0.002
    symmetry: float = 0.01
    joint_symmetry: float = 0.01
    rings: float = 0.01
    posedirs: float = 0.01
    weights: float = 0.3
    subjects: float = 0.03

    @property
    def lambdas(self) -> dict[str, float]:
        """The weights of the lectures, by term."""
        return {name: (self.data / getattr(self, name)) ** 2 for name in TERMS}


TERMS = tuple(f.name for f in fields(Sigmas) if f.name != "data")


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
            shifts.append(_times(self.posing.levers, change["joints"][self.subject]))
        if "poses" in change:
            d_world, d_local = self.posing.turning(change["poses"][self.some])
            blended.append(blend_matrices(self.estimate.weights, d_world))
            d_levers = -d_world
            d_levers[:, 1:] += d_world[:, list(self.estimate.parents[1:])]
            shifts.append(_times(d_levers, self.estimate.joints[self.subject]))
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

    def adjoint(self, cotangent: Array, into: Change) -> None:
        """Add the gradients of sum(cotangent * points), cotangent (c, N, 3), to those of `into`."""
        names, c = into.keys(), len(cotangent)
        if names & {"templates", "posedirs", "poses"}:
            on_rest = np.einsum("jnab,jna->jnb", self.blended, cotangent, optimize=False)
        if "templates" in into:
            for s in np.unique(self.subject):
                into["templates"][s] += on_rest[self.subject == s].sum(axis=0)
        if "posedirs" in into:
            flat = on_rest.reshape(c, -1).T @ self.features
            into["posedirs"] += flat.reshape(into["posedirs"].shape)
        if names & {"joints", "poses"}:
            on_shifts = self.estimate.subtree_weights.T @ cotangent  # (c, K, 3)
        if "joints" in into:
            on_joints = _times(self.posing.levers.swapaxes(-1, -2), on_shifts)
            np.add.at(into["joints"], self.subject, on_joints)
        if names & {"poses", "weights"}:
            outer = (cotangent[..., :, None] * self.rest[..., None, :]).reshape(c, -1, 9)
        if "poses" in into:
            into["poses"][self.some] += self._on_poses(outer, on_shifts, on_rest)
        if "weights" in into:
            world = self.posing.world.reshape(c, -1, 9)
            into["weights"] += _gram(outer, world)
            below = _gram(cotangent, self.shifts) @ ancestors(self.estimate.parents).T
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

    def by_joint(self) -> Array:
        """Where each joint alone would take each vertex, (c, N, K, 3) m."""
        moved = np.einsum("jkab,jnb->jnka", self.posing.world, self.rest, optimize=True)
        moved += (ancestors(self.estimate.parents) @ self.shifts)[:, None]
        return np.asarray(moved)

    def lever_arms(self) -> Array:
        """The vectors from each posed joint to the vertices below it, weighted, (c, N, K, 3) m.

        A small turn u of joint k in the world moves vertex i by u x arm_ik.
        """
        A = ancestors(self.estimate.parents)
        offsets = A @ self.shifts  # of the binding motions
        posed = self.by_joint() * self.estimate.weights[..., None]
        joints = _times(self.posing.world, self.estimate.joints[self.subject]) + offsets
        below = np.einsum("km,jnka->jnma", A, posed, optimize=True)
        return np.asarray(below - self.estimate.subtree_weights[..., None] * joints[:, None])

    def blend_shape_turn_derivatives(self) -> Array:
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


def _times(matrices: Array, vectors: Array) -> Array:
    """Matrices (..., 3, 3), each times its vector (..., 3), by matrix products."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _apply(matrices: Array, points: Array) -> Array:
    return np.asarray(np.einsum("jnab,jnb->jna", matrices, points))


def _gram(left: Array, right: Array) -> Array:
    """sum over j and d of left (c, N, d) right (c, K, d): (N, K)."""
    N, K = left.shape[1], right.shape[1]
    flat_left = left.transpose(1, 0, 2).reshape(N, -1)
    return flat_left @ right.transpose(1, 0, 2).reshape(K, -1).T
