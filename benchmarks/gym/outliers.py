"""Regressions of data with outliers, under the robust kernels of the workbench.

A fifth of the observations lie far off. Their answers are minima next to the truth, found by
Newton's method in 40 digits from there; with a kernel such as Geman and McClure's there are others.
"""

from collections.abc import Mapping

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case, posed
from benchmarks.gym.curves import FAMILIES
from workbench.blocks import Block
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms

SHARE = 0.2
SIGMA = 0.05
KERNELS: Mapping[str, tuple[Kernel, float]] = {  # and how many sigmas count as its sigma
    "huber": (huber(), 1.0),
    "geman-mcclure": (geman_mcclure, 5.0),
}
CURVES = ("exponentials", "logistic", "damped")
SEEDS = range(3)
POINTS = 40


def robust_curve(family: str = "damped", kernel: str = "huber", seed: int = 0) -> Setup:
    """A curve of one of the families, a fifth of whose observations are off by 2 in the mean."""
    one = FAMILIES[family]
    rng = np.random.default_rng((7, CURVES.index(family), seed))
    truth = one.draw(rng)
    x = cs.DM(one.places)
    clean = np.asarray(one.curve(list(truth), x), dtype=float).ravel()
    off = np.where(rng.random(clean.size) < SHARE, 2.0, SIGMA)
    seen = np.round(clean + off * rng.standard_normal(clean.size), 9)
    start = np.round(truth * np.exp(0.3 * rng.standard_normal(truth.size)), 9)
    b = Block("b", (truth.size,), labels=tuple(f"b{i + 1}" for i in range(truth.size)))
    robust, wide = KERNELS[kernel]
    r = Residual(
        "curve", one.curve(cs.vertsplit(b.symbol), x) - cs.DM(seen), wide * SIGMA, kernel=robust
    )
    return posed(
        f"robust-{family}-{kernel}-{seed}",
        Problem((r,), ("b",), blocks=(b,)),
        {"b": start},
        "the minimum next to the truth",
        made_of={"b": truth},
    )


def robust_circle(kernel: str = "geman-mcclure", seed: int = 0) -> Setup:
    """The centre and the radius of a circle of which points are seen all around, some far off."""
    rng = np.random.default_rng((8, seed))
    truth = np.array([*rng.uniform(-1, 1, 2), rng.uniform(1, 3)])
    angles = rng.uniform(0, 2 * np.pi, POINTS)
    seen = truth[:2, None] + truth[2] * np.array([np.cos(angles), np.sin(angles)])
    off = np.where(rng.random(POINTS) < SHARE, 2.0, SIGMA)
    seen = np.round(seen + off * rng.standard_normal((2, POINTS)), 9)
    c = Block("c", (3,), labels=("x", "y", "radius"))
    robust, wide = KERNELS[kernel]
    distance = cs.sqrt(cs.sum1((cs.DM(seen) - cs.repmat(c.symbol[:2], 1, POINTS)) ** 2)).T
    r = Residual("circle", distance - c.symbol[2], wide * SIGMA, kernel=robust)
    return posed(
        f"robust-circle-{kernel}-{seed}",
        Problem((r,), ("c",), blocks=(c,)),
        {"c": np.array([*np.round(seen.mean(axis=1) + rng.uniform(-1, 1, 2), 9), 1.0])},
        "the minimum next to the truth",
        made_of={"c": truth},
    )


def robust_motion(kernel: str = "geman-mcclure", seed: int = 0) -> Setup:
    """A turn and a shift of the plane between two sets of points; norms of pairs are judged."""
    rng = np.random.default_rng((9, seed))
    turn, shift = rng.uniform(-1, 1), rng.uniform(-1, 1, 2)
    points = rng.standard_normal((2, POINTS))
    c, s = np.cos(turn), np.sin(turn)
    off = np.where(rng.random(POINTS) < SHARE, 2.0, SIGMA)
    seen = np.array([[c, -s], [s, c]]) @ points + shift[:, None]
    seen = np.round(seen + off * rng.standard_normal((2, POINTS)), 9)
    points = np.round(points, 9)
    m = Block("m", (3,), labels=("turn", "x", "y"))
    a = m.symbol[0]
    turned = cs.vertcat(
        cs.horzcat(cs.cos(a), -cs.sin(a)), cs.horzcat(cs.sin(a), cs.cos(a))
    ) @ cs.DM(points) + cs.repmat(m.symbol[1:], 1, POINTS)
    robust, wide = KERNELS[kernel]
    rows = cs.vec(turned - cs.DM(seen))
    r = Residual("pairs", rows, wide * SIGMA, kernel=of_norms(robust), rows_per_point=2)
    return posed(
        f"robust-motion-{kernel}-{seed}",
        Problem((r,), ("m",), blocks=(m,)),
        {"m": np.zeros(3)},
        "the minimum next to the truth",
        made_of={"m": np.array([turn, *shift])},
    )


ROBUST: tuple[Case, ...] = (
    *(
        case(
            f"robust-{family}-{kernel}-{seed}",
            "robust",
            robust_curve,
            {"family": family, "kernel": kernel, "seed": seed},
        )
        for family in CURVES
        for kernel in KERNELS
        for seed in SEEDS
    ),
    *(
        case(f"robust-{shape}-{kernel}-{seed}", "robust", build, {"kernel": kernel, "seed": seed})
        for shape, build in (("circle", robust_circle), ("motion", robust_motion))
        for kernel in KERNELS
        for seed in SEEDS
    ),
)
