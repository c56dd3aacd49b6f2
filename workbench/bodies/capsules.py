"""Capsules: a body as a few tubes with round ends, which follow its shape and its pose.

A capsule is all that is nearer than a radius to a segment. Each is on one joint, and at rest its
two ends and its radius are linear in betas, so that self-contact is a matter of a few points
(Bogo et al., Keep it SMPL, 2016, whose capsules are regressed from betas as well).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array, Index
from workbench.blocks import Points
from workbench.blocks.checks import reals, texts
from workbench.bodies.body import Given, arguments, why_not_skinned
from workbench.bodies.forward import surface
from workbench.bodies.forward.few_points import RestPoints
from workbench.bodies.forward.named_points import BlockPoints, Maps
from workbench.bodies.forward.sources import Arguments, BodySource
from workbench.bodies.readonly import readonly, readonly_index
from workbench.errors import BadBody

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

KEYS = ("names", "joints", "ends", "end_slopes", "radii", "radius_slopes", "pairs")


@dataclass(frozen=True, eq=False)
class Capsules:
    """C capsules of a body at rest, linear in its betas, and which pairs of them may touch.

    The arrays are read-only copies. Raises BadBody if they do not fit together.

    Attributes:
        names: the name of each capsule, such as left_hand.
        joints: (C,) the number of the joint that each capsule moves with.
        ends: (C, 2, 3) m, the ends of each segment of the mean person at rest.
        end_slopes: (C, 2, 3, B) m per unit of betas.
        radii: (C,) m, of the mean person.
        radius_slopes: (C, B) m per unit of betas.
        pairs: (P, 2) the capsules that may touch; neighbours always overlap and are left out.
    """

    names: tuple[str, ...]
    joints: Index
    ends: Array
    end_slopes: Array
    radii: Array
    radius_slopes: Array
    pairs: Index

    def __post_init__(self) -> None:
        names = texts("the names of capsules", self.names, BadBody)
        parts: dict[str, Any] = {"names": names}
        for key in ("ends", "end_slopes", "radii", "radius_slopes"):
            parts[key] = readonly(f"{key} of capsules", getattr(self, key))
        for key in ("joints", "pairs"):
            parts[key] = readonly_index(f"{key} of capsules", getattr(self, key))
        self.__dict__.update(parts)
        C, B = len(names), self.radius_slopes.shape[-1] if self.radius_slopes.ndim == 2 else 0
        shapes = {
            "joints": (C,),
            "ends": (C, 2, 3),
            "end_slopes": (C, 2, 3, B),
            "radii": (C,),
            "radius_slopes": (C, B),
            "pairs": (len(self.pairs), 2),
        }
        for key, shape in shapes.items():
            array = getattr(self, key)
            if array.shape != shape:
                raise BadBody(f"capsules: {key} has shape {array.shape}, but must be {shape}")
            if not np.isfinite(array).all():
                raise BadBody(f"capsules: {key} holds numbers that are not finite")
        if self.pairs.size and not 0 <= self.pairs.min() <= self.pairs.max() < C:
            raise BadBody(f"capsules: pairs must be of capsules 0 to {C - 1}")
        if C and not (self.radii > 0).all():
            raise BadBody("capsules: radii of the mean person must be above zero")

    def __reduce__(self) -> tuple[Any, ...]:
        return Capsules, tuple(getattr(self, key) for key in KEYS)  # a copy is read-only as well

    @property
    def pair_names(self) -> tuple[str, ...]:
        """What each pair is called: `left_hand and chest`."""
        return tuple(f"{self.names[i]} and {self.names[j]}" for i, j in self.pairs)

    @property
    def end_names(self) -> tuple[str, ...]:
        """The names of the 2 C ends: `left_hand, start` and `left_hand, end`."""
        return tuple(f"{name}, {which}" for name in self.names for which in ("start", "end"))

    def ends_of(self, betas: ArrayLike) -> Array:
        """The ends (C, 2, 3) m at rest of the person with these betas (B,)."""
        return np.asarray(self.ends + self.end_slopes @ reals("betas", betas))

    def radii_of(self, betas: ArrayLike) -> Array:
        """The radii (..., C) m of people with betas (..., B)."""
        return np.asarray(self.radii + reals("betas", betas) @ self.radius_slopes.T)

    def radii_in(self, betas: cs.MX) -> cs.MX:
        """The radii (C, 1) m in symbols, for betas (B, 1)."""
        return cs.DM(self.radii) + cs.DM(self.radius_slopes) @ betas

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Its parts for a file, by key."""
        return {key: np.asarray(getattr(self, key)) for key in KEYS}

    @staticmethod
    def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> Capsules:
        """The capsules whose parts a file holds; see `arrays`."""
        names = tuple(str(name) for name in arrays["names"])
        return Capsules(names, *(arrays[key] for key in KEYS[1:]))


def segment_distances(starts: Array, ends: Array, pairs: Index) -> Array:
    """The distances (..., P) m of segments (..., C, 3) to (..., C, 3), pair by pair."""
    places = closest_places(starts, ends, pairs)
    return np.asarray(np.linalg.norm(places[..., 1, :] - places[..., 0, :], axis=-1))


def closest_places(starts: Array, ends: Array, pairs: Index) -> Array:
    """The places (..., P, 2, 3) m of two segments that are closest to each other, pair by pair.

    The squared distance of two points is a convex quadratic on the square of both positions: its
    minimum is inside of the square, or on an edge, where it is the distance of an end from the
    other segment. All of these are feasible, so that the smallest is the minimum, for parallel
    segments and for points as well.
    """
    i, j = pairs.T
    p, q = starts[..., i, :], starts[..., j, :]
    u, v, w = ends[..., i, :] - p, ends[..., j, :] - q, starts[..., i, :] - starts[..., j, :]

    def dot(x: Array, y: Array) -> Array:
        return np.asarray((x * y).sum(axis=-1))

    a, b, c, d, e = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    safe_a, safe_c = np.maximum(a, 1e-18), np.maximum(c, 1e-18)
    det = a * c - b * b
    lines = det > 1e-10 * a * c
    det = np.where(lines, det, 1.0)
    s0, t0 = (np.clip(np.where(lines, x / det, 0), 0, 1) for x in (b * e - c * d, a * e - b * d))
    zero, one = np.zeros_like(a), np.ones_like(a)
    places = [
        (s0, t0),
        (zero, np.clip(e / safe_c, 0, 1)),
        (one, np.clip((e + b) / safe_c, 0, 1)),
        (np.clip(-d / safe_a, 0, 1), zero),
        (np.clip((b - d) / safe_a, 0, 1), one),
    ]
    on_one = np.stack([p + s[..., None] * u for s, _ in places])
    on_other = np.stack([q + t[..., None] * v for _, t in places])
    least = dot(on_other - on_one, on_other - on_one).argmin(axis=0)[None, ..., None]
    one, other = (np.take_along_axis(x, least, axis=0)[0] for x in (on_one, on_other))
    return np.stack([one, other], axis=-2)


def capsules_of(body: SkinnedBody) -> Capsules:
    """The capsules of a body. Raises BadBody for a body that has none, or is no SkinnedBody."""
    if reason := why_not_skinned(body, "capsules", "take one"):
        raise BadBody(reason)
    if body.capsules is None:
        raise BadBody(
            f"body {body.name!r} has no capsules; make them with "
            "dataclasses.replace(body, capsules=fit_capsules(body))"
        )
    return body.capsules


def capsule_points(body: SkinnedBody, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
    """Start and end of each capsule in turn, posed, (3, 2 C) m: rest points, each on one joint.

    Their radii are `body.capsules.radii_in(betas)`. Raises BadBody for a body without capsules, or
    with free arrays, from which the rest pose is made.
    """
    symbols, capsules = Arguments(body, pose, betas, trans), capsules_of(body)
    if body.free:
        raise BadBody(
            f"body {body.name!r} has free arrays ({', '.join(body.free)}), but its capsules were "
            "fitted to fixed ones; take the body with values, and fit capsules to it"
        )

    def express() -> cs.MX:
        G, _ = surface.motions(body, surface.posture(body, pose, betas))
        ends = RestPoints.of_capsules(capsules).expression(G, cs.MX(0, 1), betas)
        return ends + cs.repmat(trans, 1, 2 * len(capsules.names))

    def compute(maps: Maps) -> BlockPoints:
        return BlockPoints(body.numeric.capsules(capsules), maps)

    names = capsules.end_names
    return Points.of(BodySource(symbols, len(names), names, (), express, compute), "capsules")


def capsule_ends(
    body: SkinnedBody, pose: Given = None, betas: Given = None, trans: Given = None
) -> Array:
    """Start and end of each capsule, posed, (..., C, 2, 3) m. Raises BadBody without any."""
    capsules = capsules_of(body)
    batch, (theta, beta, move) = arguments(body, pose, betas, trans)
    points = body.numeric.capsules(capsules).evaluate_batch(theta, beta, move)
    return points.reshape(*batch, len(capsules.names), 2, 3)


@dataclass(frozen=True, eq=False)
class PosedCapsules:
    """The C capsules of one body in one pose, and the gaps (P,) m of pairs, below zero in overlaps.

    `deepest` is the pair with the smallest gap, None if there is no pair, and `places` (2, 3) m are
    where the axes of these two are closest to each other. `ends` are (C, 2, 3) m, `radii` (C,) m.
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
    _, (_, beta, _) = arguments(body, pose, betas, trans)
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
    _, (_, beta, _) = arguments(body, pose, betas, trans)
    radii = capsules.radii_of(beta).reshape(*ends.shape[:-2])
    i, j = capsules.pairs.T
    apart = segment_distances(ends[..., 0, :], ends[..., 1, :], capsules.pairs)
    return np.asarray(apart - radii[..., i] - radii[..., j])
