"""Exercises of lecture 4 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "radius_left",
    points=3,
    minutes=15,
    draw=lambda rng: {"BACK": rounded(rng, 0.21, 0.78, digits=3)},
    arguments=lambda rng, numbers: (rng.uniform(0.1, 0.9), rng.uniform(0.5, 2.5)),
    edges=lambda numbers: [(0.0, 1.3), (1.0, 1.3)],
)
def radius_left(weight: float, angle: float, *, BACK: float) -> float:
    """What linear blending leaves of the radius of a ring between two bones that both turn.

    One bone is twisted by `angle` about the limb, and the other one at the same time by BACK times `angle`
    the other way round. The ring follows the first with `weight`, and the second with the rest.

    weight from 0 to 1; angle rad -> a share
    """
    return np.sqrt(1 - 4 * weight * (1 - weight) * np.sin((1 + BACK) * angle / 2) ** 2)


@mistake("radius_left", "the bones turn against each other: they are (1 + BACK) angle apart")
def radius_left_the_same_way(weight, angle, *, BACK):
    return radius_left.solution(weight, angle, BACK=-BACK)


@mistake("radius_left", "this is the square: how the area shrinks. The radius is its root")
def radius_left_squared(weight, angle, *, BACK):
    return radius_left.solution(weight, angle, BACK=BACK) ** 2


@variant(
    "volume_lost",
    points=3,
    minutes=25,
    draw=lambda rng: {
        "LOW": rounded(rng, 0.05, 0.35, digits=3),
        "HIGH": rounded(rng, 0.6, 0.95, digits=3),
    },
    arguments=lambda rng, numbers: (
        rng.uniform(0.002, 0.02),
        rng.uniform(0.05, 0.3),
        rng.uniform(0.4, 3.1),
    ),
    edges=lambda numbers: [(0.01, 0.2, 0.0), (0.01, 0.2, np.pi)],
)
def volume_lost(area: float, zone: float, angle: float, *, LOW: float, HIGH: float) -> float:
    """The volume that linear blending takes from a twisted tube of cross-section `area`.

    The weight goes in a straight line from LOW to HIGH over a length `zone`; only this zone counts. One
    bone stays, and the other one is twisted by `angle`.

    area m^2; zone m; angle rad -> m^3
    """
    mean = ((HIGH**2 - LOW**2) / 2 - (HIGH**3 - LOW**3) / 3) / (HIGH - LOW)  # of w (1 - w)
    return 4 * area * zone * mean * np.sin(angle / 2) ** 2


@mistake(
    "volume_lost", "the weight varies along the zone: take the mean of w (1 - w), not its middle"
)
def volume_lost_of_the_middle(area, zone, angle, *, LOW, HIGH):
    w = (LOW + HIGH) / 2
    return 4 * area * zone * w * (1 - w) * np.sin(angle / 2) ** 2


@mistake("volume_lost", "the mean over the zone has to be divided by HIGH - LOW")
def volume_lost_without_the_mean(area, zone, angle, *, LOW, HIGH):
    return (HIGH - LOW) * volume_lost.solution(area, zone, angle, LOW=LOW, HIGH=HIGH)


@variant(
    "blended_turn",
    points=3,
    minutes=20,
    draw=lambda rng: {"AGAINST": rounded(rng, 0.11, 0.69, digits=3)},
    arguments=lambda rng, numbers: (rng.uniform(0.1, 0.9), rng.uniform(0.4, 1.8)),
    edges=lambda numbers: [(0.0, 1.2), (1.0, 1.2)],
)
def blended_turn(weight: float, angle: float, *, AGAINST: float) -> float:
    """By which angle a vertex is turned by blended quaternions, between two bones that both turn.

    One bone turns by `angle` about an axis, with `weight`, and the other one, with the rest, by
    AGAINST times `angle` the other way. The quaternions are averaged and brought to length one.

    weight from 0 to 1; angle rad, from 0 to pi / 2 -> rad about the same axis, negative if backwards
    """
    halves = np.array([-AGAINST * angle / 2, angle / 2])
    shares = np.array([1 - weight, weight])
    return 2 * np.arctan2(shares @ np.sin(halves), shares @ np.cos(halves))


@mistake("blended_turn", "this blends the angles, and not the quaternions")
def blended_turn_of_angles(weight, angle, *, AGAINST):
    return weight * angle - (1 - weight) * AGAINST * angle


@mistake("blended_turn", "this blends rotations: take half of the angles in cos and sin")
def blended_turn_of_rotations(weight, angle, *, AGAINST):
    return blended_turn.solution(weight, 2 * angle, AGAINST=AGAINST) / 2
