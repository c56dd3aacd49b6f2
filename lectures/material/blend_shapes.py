"""The training and validation data of all predictors, and how blend shapes are fitted to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import surface as symbolic
from workbench.bodies.forward.skinning import unskinned
from workbench.bodies.forward.surface import Features, Posture, rotation_vectors
from workbench.training.blend_shapes import MaskedCholesky
from workbench.training.estimate import bent

from .kernel_features import (
    Examples,
    GaussianKernels,
    NormalisedKernels,
    as_posedirs,
)
from .teacher import Teacher

RIDGES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # that are tried, per pose
WIDTHS = (0.15, 0.25, 0.5, 1.0, 2.0, 4.0)  # of kernels, in median distances between two poses
Kernel = TypeVar("Kernel", NormalisedKernels, GaussianKernels)


@dataclass(frozen=True, eq=False)
class Correctives:
    """What blend shapes have to predict at rest.

    Attributes:
        training: (n, N, 3) in metres, of the training poses.
        validation: (m, N, 3) in metres, of the validation poses.
    """

    training: Array
    validation: Array


@dataclass(frozen=True, eq=False)
class TrainingData:
    """What predictors are fitted to; nothing is ever tested on it.

    Attributes:
        body: the body with linear blending and no pose blend shapes.
        training: the poses and surfaces that predictors are fitted to.
        validation: further ones, on which ridges and kernel widths are chosen.
    """

    body: SkinnedBody
    training: PosedSurfaces
    validation: PosedSurfaces

    def features(self, features: Features) -> tuple[Array, Array]:
        """The feature matrices (n, F) of the training poses and of the validation poses."""
        training, validation = (
            feature_matrix(self.body, features, posed.poses)
            for posed in (self.training, self.validation)
        )
        return training, validation

    def correctives(self, body: SkinnedBody) -> Correctives:
        """What a body's skinning gets wrong, at rest."""
        return Correctives(correctives(body, self.training), correctives(body, self.validation))

    def fit(self, features: Features, wanted: Correctives) -> tuple[Array, float]:
        """Posedirs (N, 3, F) m by ridge regression, and its ridge, chosen by validation."""
        return _ridge_regression(*self.features(features), wanted)

    def fit_without_bones(self, features: Features) -> SkinnedBody:
        """The body v = c + P f(theta), which has no bones."""
        A, A_validation = self.features(features)
        middle, mean = A.mean(axis=0), self.training.vertices.mean(axis=0)
        centred = Correctives(self.training.vertices - mean, self.validation.vertices - mean)
        posedirs, _ = _ridge_regression(A - middle, A_validation - middle, centred)
        body = replace(self.body, template=mean - posedirs @ middle, skinning=unskinned)
        return with_blend_shapes(body, features, posedirs)

    def blended_examples(self, n: int, wanted: Correctives) -> tuple[NormalisedKernels, Array]:
        """Normalised kernels of the first n examples, and the examples' correctives (N, 3, n) m."""
        posedirs = as_posedirs(wanted.training[:n])
        kernels = [NormalisedKernels(examples) for examples in self._examples(n)]
        return self._best_width(kernels, lambda _: posedirs, wanted)

    def interpolation(self, n: int, wanted: Correctives) -> tuple[GaussianKernels, Array]:
        """Kernels of the first n examples, and posedirs (N, 3, n) m that reproduce them exactly."""
        kernels = [GaussianKernels(examples) for examples in self._examples(n)]
        return self._best_width(
            kernels, lambda kernel: kernel.interpolating(wanted.training[:n]), wanted
        )

    def _examples(self, n: int) -> list[Examples]:
        places = self.features(rotation_vectors)[0][:n]
        away = np.linalg.norm(places[:300, None] - places[:300], axis=2)
        unit = float(np.median(away[np.triu_indices(len(away), 1)]))
        return [Examples(places, width * unit) for width in WIDTHS]

    def _best_width(
        self, kernels: list[Kernel], fitted: Callable[[Kernel], Array], wanted: Correctives
    ) -> tuple[Kernel, Array]:
        """The kernels that predict the validation set best, with their posedirs (N, 3, n) m."""

        def error(pair: tuple[Kernel, Array]) -> float:
            A = feature_matrix(self.body, pair[0], self.validation.poses)
            return rms_error(A, wanted.validation, pair[1])

        return min(((kernel, fitted(kernel)) for kernel in kernels), key=error)


def _ridge_regression(
    training: Array, validation: Array, wanted: Correctives
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m from feature matrices (n, F), and the ridge that validates best."""
    (n, F), N = training.shape, wanted.training.shape[1]
    gram, right = training.T @ training, np.tensordot(wanted.training, training, (0, 0))
    every = np.ones((N, F), dtype=bool)
    found = {
        ridge: MaskedCholesky.of(gram + ridge * n * np.eye(F), every).solved(right)
        for ridge in RIDGES
    }
    best = min(found, key=lambda ridge: rms_error(validation, wanted.validation, found[ridge]))
    return found[best], best


@dataclass(frozen=True, eq=False)
class PosedSurfaces:
    """The mean person in n poses.

    Attributes:
        poses: (n, K, 3) in radians.
        vertices: (n, N, 3) in metres, the teacher's surface in each pose.
    """

    poses: Array
    vertices: Array

    @staticmethod
    def of(teacher: Teacher, poses: Array) -> PosedSurfaces:
        """The surfaces of a teacher in poses (n, K, 3) rad."""
        return PosedSurfaces(poses, np.stack([teacher.vertices(pose) for pose in poses]))

    def __len__(self) -> int:
        return len(self.poses)

    def some(self, chosen: slice | Index) -> PosedSurfaces:
        """The chosen poses and their surfaces alone."""
        return PosedSurfaces(self.poses[chosen], self.vertices[chosen])


def correctives(body: SkinnedBody, posed: PosedSurfaces) -> Array:
    """What must be added to the rest surface so that the body's skinning gives the posed surface.

    (n, N, 3) m: M_i^-1 (v_i - m_i) - T_i, where skinning takes every vertex v to M_i v + m_i.
    """
    motions = _vertex_motions(body)
    found = np.empty_like(posed.vertices)
    for i, pose in enumerate(posed.poses):
        at = np.asarray(motions(pose.T)).T.reshape(4, body.n_vertices, 3)
        M, m = (at[1:] - at[0]).transpose(1, 2, 0), at[0]
        found[i] = np.linalg.solve(M, (posed.vertices[i] - m)[..., None])[..., 0] - body.template
    return found


def feature_matrix(body: SkinnedBody, features: Features, poses: Array) -> Array:
    """The features of the mean person in poses (n, K, 3) rad, one row for each pose: (n, F)."""
    pose = cs.MX.sym("pose", 3, body.n_joints)
    column = features(Posture.of(pose, cs.DM(body.bind_pose.T), cs.MX.zeros(body.n_betas)))
    f = cs.Function("features", [pose], [cs.densify(column)])
    return np.array([np.asarray(f(theta.T)).ravel() for theta in poses])


def with_blend_shapes(body: SkinnedBody, features: Features, posedirs: Array) -> SkinnedBody:
    """The body with other features and their pose blend shapes (N, 3, F) m."""
    return replace(body, features=features, posedirs=posedirs)


def rms_error(features: Array, wanted: Array, posedirs: Array) -> float:
    """Root mean square length, in m, of the part of correctives (n, N, 3) not explained.

    The explained part is `posedirs` (N, 3, F) times `features` (n, F).
    """
    return rms_length(wanted - bent(posedirs, features))


def rms_length(vectors: Array) -> float:
    """Root mean square length of vectors (..., 3), in their unit."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))


def _vertex_motions(body: SkinnedBody) -> cs.Function:
    """pose -> (3, 4 N): where skinning takes the origin and the three unit vectors."""
    pose, N = cs.MX.sym("pose", 3, body.n_joints), body.n_vertices
    at = symbolic.posture(body, pose, cs.MX.zeros(body.n_betas))
    G, _ = symbolic.motions(body, at)
    weights = symbolic.weights(body)
    corners = np.vstack([np.zeros(3), np.eye(3)])
    moved = [
        body.skinning(cs.MX(cs.DM(np.tile(corner, (N, 1)).T)), G, weights) for corner in corners
    ]
    return cs.Function("vertex_motions", [pose], [cs.horzcat(*moved)])
