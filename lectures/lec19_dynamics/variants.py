"""Exercises of lecture 19 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "wobble",
    points=2,
    minutes=12,
    draw=lambda rng: {"SHARE": rounded(rng, 0.11, 0.39, digits=3)},
    arguments=lambda rng, numbers: _swing(
        rng.uniform(0.7, 0.98), rng.uniform(0.2, 1.4), float(rng.integers(20, 130))
    ),
)
def wobble(a1: float, a2: float, fps: float, *, SHARE: float) -> tuple[float, float]:
    """How fast phi[t] = a1 phi[t - 1] + a2 phi[t - 2] swings, and when only SHARE of the swing is left.

    The poles are complex, r exp(i w) and r exp(-i w), with r below 1.

    a1, a2; fps frames a second -> the time in s of one whole swing, and the time in s until SHARE is left
    """
    r = np.sqrt(-a2)
    w = np.arccos(a1 / (2 * r))
    return 2 * np.pi / (w * fps), np.log(SHARE) / (np.log(r) * fps)


def _swing(r: float, w: float, fps: float) -> tuple[float, float, float]:
    return 2 * r * np.cos(w), -(r**2), fps


@mistake("wobble", "the product of the poles is -a2, so r is its square root")
def wobble_with_the_square(a1, a2, fps, *, SHARE):
    right = wobble.solution(a1, a2, fps, SHARE=SHARE)
    return right[0], right[1] / 2


@mistake("wobble", "a whole swing is an angle of 2 pi, and times are in seconds")
def wobble_in_frames(a1, a2, fps, *, SHARE):
    right = wobble.solution(a1, a2, fps, SHARE=SHARE)
    return right[0] * fps, right[1] * fps


@mistake("wobble", "until SHARE is left, and not until SHARE is gone")
def wobble_until_it_is_gone(a1, a2, fps, *, SHARE):
    right = wobble.solution(a1, a2, fps, SHARE=SHARE)
    return right[0], wobble.solution(a1, a2, fps, SHARE=1 - SHARE)[1]


@variant(
    "free_run",
    points=2,
    minutes=10,
    draw=lambda rng: {"HELD": rounded(rng, 0.13, 0.87, digits=3)},
    arguments=lambda rng, numbers: (
        rng.uniform(0.5, 1.2),
        rng.uniform(-0.9, -0.5),
        rng.standard_normal(int(rng.integers(5, 12))),
    ),
)
def free_run(a1: float, a2: float, driven: Array, *, HELD: float) -> Array:
    """phi[t] = a1 phi[t - 1] + a2 phi[t - 2] + driven[t] from the first frame on, let go after being held.

    Before the first frame somebody held the tissue, so that phi was HELD in all frames until then.

    driven (T,) -> phi (T,)
    """
    phi = [HELD, HELD]
    for push in driven:
        phi.append(a1 * phi[-1] + a2 * phi[-2] + push)
    return np.array(phi[2:])


@mistake("free_run", "before the first frame phi is HELD, and not zero")
def free_run_from_zero(a1, a2, driven, *, HELD):
    return free_run.solution(a1, a2, driven, HELD=0.0)


@mistake("free_run", "both of the two frames before the first one are HELD")
def free_run_from_one(a1, a2, driven, *, HELD):
    phi = [0.0, HELD]
    for push in driven:
        phi.append(a1 * phi[-1] + a2 * phi[-2] + push)
    return np.array(phi[2:])


@mistake("free_run", "phi is returned from the first frame on")
def free_run_too_early(a1, a2, driven, *, HELD):
    right = free_run.solution(a1, a2, driven, HELD=HELD)
    return np.concatenate([[HELD, HELD], right])[: len(driven)]
