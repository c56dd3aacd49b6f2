"""The capsules of a body where a pose takes them, in symbols and in numbers, and their gaps."""

from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Points
from workbench.bodies.body import Given
from workbench.bodies.capsules import Capsules, closest_places, segment_distances
from workbench.bodies.forward import evaluation, sources
from workbench.bodies.forward.sources import Arguments
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.skinned_only import not_skinned
from workbench.errors import BadBody


def capsules_of(body: SkinnedBody) -> Capsules:
    """The capsules of a body. Raises BadBody for a body that has none, or is no SkinnedBody."""
    if reason := not_skinned(body, "capsules", "take one"):
        raise BadBody(reason)
    if body.capsules is None:
        raise BadBody(
            f"body {body.name!r} has no capsules; make them with "
            "dataclasses.replace(body, capsules=fit_capsules(body))"
        )
    return body.capsules


def capsule_points(body: SkinnedBody, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
    """Start and end of each capsule in turn, posed, (3, 2 C) m.

    Their radii are `body.capsules.radii_in(betas)`. Raises BadBody for a body without capsules.
    """
    at, capsules = Arguments(body, pose, betas, trans), capsules_of(body)
    return Points.of(sources.capsule_points(body, at, body.numeric, capsules), "capsules")


def capsule_ends(
    body: SkinnedBody, pose: Given = None, betas: Given = None, trans: Given = None
) -> Array:
    """Start and end of each capsule, posed, (..., C, 2, 3) m. Raises BadBody without any."""
    capsules = capsules_of(body)
    batch, theta, beta, move = evaluation.arguments(body, pose, betas, trans)
    points = body.numeric.capsules(capsules).evaluate_batch(theta, beta, move)
    return points.reshape(*batch, len(capsules.names), 2, 3)


@dataclass(frozen=True, eq=False)
class PosedCapsules:
    """The capsules of one body in one pose, and which two of them are nearest or overlap most.

    Attributes:
        names: the name of each capsule.
        ends: (C, 2, 3) m.
        radii: (C,) m.
        pairs: (P, 2) the capsules that are kept apart.
        gaps: (P,) m, the distances of their surfaces; below zero they overlap.
        deepest: the pair with the smallest gap; None if there is no pair.
        places: (2, 3) m, where the axes of these two are closest to each other.
    """

    names: tuple[str, ...]
    ends: Array
    radii: Array
    pairs: Index
    gaps: Array
    deepest: int | None
    places: Array


def posed_capsules(
    body: SkinnedBody, pose: Given = None, betas: Given = None, trans: Given = None
) -> PosedCapsules:
    """The capsules of a body in one pose (K, 3). Raises BadBody for a body without capsules."""
    capsules, ends = capsules_of(body), capsule_ends(body, pose, betas, trans)
    _, _, beta, _ = evaluation.arguments(body, pose, betas, trans)
    gaps = capsule_gaps(body, pose, betas, trans)
    deepest = int(np.argmin(gaps)) if gaps.size else None
    pair = capsules.pairs[[] if deepest is None else [deepest]]
    places = closest_places(ends[:, 0], ends[:, 1], pair).reshape(-1, 3)
    radii = capsules.radii_of(beta).reshape(-1)
    return PosedCapsules(capsules.names, ends, radii, capsules.pairs, gaps, deepest, places)


def capsule_gaps(
    body: SkinnedBody, pose: Given = None, betas: Given = None, trans: Given = None
) -> Array:
    """The distances (..., P) m of the surfaces of `capsules.pairs`; below zero they overlap.

    Raises BadBody for a body without capsules.
    """
    capsules, ends = capsules_of(body), capsule_ends(body, pose, betas, trans)
    _, _, beta, _ = evaluation.arguments(body, pose, betas, trans)
    radii = capsules.radii_of(beta).reshape(*ends.shape[:-2])
    i, j = capsules.pairs.T
    apart = segment_distances(ends[..., 0, :], ends[..., 1, :], capsules.pairs)
    return np.asarray(apart - radii[..., i] - radii[..., j])
