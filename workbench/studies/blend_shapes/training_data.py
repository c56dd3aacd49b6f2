"""The training and validation data of all predictors, and how blend shapes are fitted to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.features import Features, rotation_vectors
from workbench.bodies.forward.kernel_features import (
    Examples,
    GaussianKernels,
    NormalisedKernels,
    as_posedirs,
)
from workbench.bodies.forward.polynomial_features import unskinned
from workbench.studies.blend_shapes.posed_surfaces import (
    PosedSurfaces,
    correctives,
    feature_matrix,
    rms_error,
    with_blend_shapes,
)
from workbench.training.ridge import Sums, solve_ridge

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
    sums = Sums.of([(training, wanted.training)])
    every = np.ones((wanted.training.shape[1], training.shape[1]), dtype=bool)
    found = {ridge: solve_ridge(sums, every, ridge) for ridge in RIDGES}
    best = min(found, key=lambda ridge: rms_error(validation, wanted.validation, found[ridge]))
    return found[best], best
