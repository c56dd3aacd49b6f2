"""Every way of skinning and every kind of features, for tests that all of them must pass."""

from dataclasses import replace

import numpy as np

from tests.bodies_made_up import random_body
from workbench import SkinnedBody
from workbench.bodies.forward.features import (
    Features,
    count_features,
    no_features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
    star_features,
)
from workbench.bodies.forward.skinning import dual_quaternion_blend, linear_blend

SKINNINGS = (linear_blend, dual_quaternion_blend)
FEATURES: tuple[Features, ...] = (
    rotation_elements,
    rotation_vectors,
    quaternion_elements,
    star_features,
    no_features,
)


def varied(body: SkinnedBody, features: Features, seed: int = 0) -> SkinnedBody:
    """The body with other features, and random directions for them."""
    F = count_features(features, body.n_joints, body.n_betas)
    made = np.random.default_rng(seed).normal(scale=0.01, size=(body.n_vertices, 3, F))
    return replace(body, features=features, posedirs=made)


def variants(**sizes: int) -> dict[str, SkinnedBody]:
    """One small body skinned in every way, with every kind of features, and bound otherwise."""
    found = {}
    for bound in (False, True):
        body = random_body(3, bound=bound, **sizes)  # type: ignore[arg-type]
        for features in FEATURES:
            for skinning in SKINNINGS:
                name = f"{skinning.__name__} of {features.__name__}{', bound' * bound}"
                found[name] = replace(varied(body, features), skinning=skinning)
    return found
