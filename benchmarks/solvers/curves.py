"""Regressions: NIST's, curves drawn at random, and data with outliers.

- `nist-`: NIST's fifteen regressions that the suite `nist` lacks, from both published starts,
  certified to eleven digits; and those of the suite from farther starts.
- Curves: six families, with and without noise, from starts far from the truth. Each seed draws the
  true parameters, the noise and the start. Data without noise have the truth as their answer, with
  a cost of 0; the answer of noisy data is the minimum next to the truth. Starts are the truth with
  each parameter multiplied by exp(0.7 z), z standard normal, and with offsets and phases moved by
  0.5 z; far starts have 1.5 and 1 instead.
- `robust-`: a fifth of the observations lie far off, under the robust kernels of the workbench. The
  answer is the minimum next to the truth; with a kernel such as Geman-McClure's there are others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np

from benchmarks.solvers.case import Case, case, data, entries, one_block
from workbench.arrays import Array
from workbench.blocks import Block
from workbench.experiments.nist import MODELS as SUITE
from workbench.experiments.nist import Model, nist, regression
from workbench.fitting.setup import Setup
from workbench.residuals import Residual
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms

# NIST

YEAR = 2 * np.pi / 12


def _wave(even: cs.MX, odd: cs.MX, angle: cs.MX) -> cs.MX:
    return even * cs.cos(angle) + odd * cs.sin(angle)


def _enso(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    long, short = (2 * np.pi * x / b[k] for k in (3, 6))
    return b[0] + _wave(b[1], b[2], YEAR * x) + _wave(b[4], b[5], long) + _wave(b[7], b[8], short)


def _peak(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    return b[0] * cs.exp(-((x - b[1]) ** 2) / b[2] ** 2)


def _cubics(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    above = b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3
    return above / (1 + b[4] * x + b[5] * x**2 + b[6] * x**3)


MODELS: Mapping[str, Model] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - cs.exp(-b[1] * x)),
    "Chwirut1": lambda b, x: cs.exp(-b[0] * x) / (b[1] + b[2] * x),
    "ENSO": _enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * cs.exp(-(((x - b[2]) / b[1]) ** 2) / 2),
    "Gauss2": lambda b, x: b[0] * cs.exp(-b[1] * x) + _peak(b[2:5], x) + _peak(b[5:], x),
    "Hahn1": _cubics,
    "Lanczos2": lambda b, x: sum(b[k] * cs.exp(-b[k + 1] * x) for k in (0, 2, 4)),
    "MGH10": lambda b, x: b[0] * cs.exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * cs.exp(-x * b[3]) + b[2] * cs.exp(-x * b[4]),
    "Misra1c": lambda b, x: b[0] * (1 - 1 / cs.sqrt(1 + 2 * b[1] * x)),
    "Nelson": lambda b, x: b[0] - b[1] * x[:, 0] * cs.exp(-b[2] * x[:, 1]),  # of log y
    "Rat43": lambda b, x: b[0] / (1 + cs.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - cs.atan(b[2] / (x - b[3])) / np.pi,
    "Thurber": _cubics,
}


def added_regression(problem: str = "MGH17", start: int = 1) -> Setup:
    """A regression that the suite `nist` lacks, from NIST's start 1 (far) or 2 (near)."""
    facts = data("nist")[problem]
    if problem == "Nelson":  # what is fitted is log y
        facts = {**facts, "data": [[np.log(y), *x] for y, *x in facts["data"]]}
    return regression(problem, facts, MODELS[problem], start)


def farther(problem: str = "Misra1a", power: int = 2) -> Setup:
    """A regression of the suite, begun `power` times as far off as NIST's first start.

    The start is b (s / b)^power for the certified b and NIST's first start s.
    """
    setup = nist(problem)
    assert setup.known is not None
    assert setup.known.values is not None
    b, s = setup.known.values["b"], setup.start["b"]
    return replace(setup, start={"b": np.array([float(f"{x:.12g}") for x in b * (s / b) ** power])})


ADDED: tuple[Case, ...] = tuple(
    case(f"nist-{n.lower()}", "nist", added_regression, {"problem": n, "start": k}, f"start {k}")
    for n in MODELS
    for k in (1, 2)
)
FARTHER: tuple[Case, ...] = tuple(
    case(
        f"nist-{name.lower()}",
        "nist, tuned",
        farther,
        {"problem": name, "power": power},
        f"{power} times as far",
    )
    for name in SUITE
    for power in (2, 3)
)

# Curves

STARTS = {"": (0.7, 0.5), "far": (1.5, 1.0)}  # factors of z: of logarithms, and of what is added
NOISE = 0.02  # of the root mean square of the data


@dataclass(frozen=True)
class Family:
    """Curves of one formula.

    Attributes:
        curve: y (m, 1) from the parameters (entries) and the places x (m, 1).
        draw: the true parameters (n,) from a random generator.
        places: (m,) where it is observed.
        additive: which parameters a start moves by adding.
    """

    curve: Callable[[Sequence[Any], Any], Any]
    draw: Callable[[np.random.Generator], Array]
    places: Array
    additive: tuple[int, ...] = ()


def exponentials(b: Sequence[Any], x: Any) -> Any:
    """A sum of decays, amplitude and rate each."""
    return sum(b[k] * cs.exp(-b[k + 1] * x) for k in range(0, len(b), 2))


def peaks(b: Sequence[Any], x: Any) -> Any:
    """A floor, and Gaussian peaks: height, centre and width each."""
    bumps = (b[k] * cs.exp(-(((x - b[k + 1]) / b[k + 2]) ** 2) / 2) for k in range(1, len(b), 3))
    return b[0] + sum(bumps)


def logistic(b: Sequence[Any], x: Any) -> Any:
    """Growth between two plateaus."""
    return b[3] + b[0] / (1 + cs.exp(b[1] - b[2] * x))


def saturation(b: Sequence[Any], x: Any) -> Any:
    """Michaelis and Menten's law with Hill's exponent; the second is the log of the half place."""
    return b[0] / (1 + cs.exp(b[2] * (b[1] - cs.log(x))))


def damped(b: Sequence[Any], x: Any) -> Any:
    """A damped oscillation: amplitude, decay, angular frequency, phase, offset."""
    return b[0] * cs.exp(-b[1] * x) * cs.cos(b[2] * x + b[3]) + b[4]


def rational(b: Sequence[Any], x: Any) -> Any:
    """A quadratic over a quadratic."""
    return (b[0] + b[1] * x + b[2] * x**2) / (1 + b[3] * x + b[4] * x**2)


def _exponentials(rng: np.random.Generator) -> Array:
    rates = np.cumprod([rng.uniform(0.1, 0.4), rng.uniform(3, 5), rng.uniform(3, 5)])
    return np.column_stack([rng.uniform(1, 3, 3), rates]).ravel()


def _peaks(rng: np.random.Generator) -> Array:
    centres = np.array([2.5, 7.0]) + rng.uniform(-0.5, 0.5, 2)
    each = np.column_stack([rng.uniform(1, 4, 2), centres, rng.uniform(0.4, 1.0, 2)])
    return np.append(rng.uniform(0.2, 1), each.ravel())


def _uniform(*ranges: tuple[float, float]) -> Callable[[np.random.Generator], Array]:
    return lambda rng: np.array([rng.uniform(*between) for between in ranges])


FAMILIES: Mapping[str, Family] = {
    "exponentials": Family(exponentials, _exponentials, np.linspace(0, 10, 60)),
    "peaks": Family(peaks, _peaks, np.linspace(0, 10, 80), (2, 5)),
    "logistic": Family(
        logistic, _uniform((2, 9), (3, 6), (0.7, 1.5), (0.2, 1)), np.linspace(0, 10, 30)
    ),
    "saturation": Family(
        saturation, _uniform((2, 9), (0, 1.4), (0.8, 2.5)), np.geomspace(0.1, 20, 20), (1,)
    ),
    "damped": Family(
        damped,
        _uniform((1, 4), (0.1, 0.4), (1.5, 4), (-1, 1), (-1, 1)),
        np.linspace(0, 10, 60),
        (3, 4),
    ),
    "rational": Family(
        rational,
        _uniform((1, 3), (-1, 1), (0.1, 0.5), (0.1, 0.6), (0.1, 0.5)),
        np.linspace(0, 8, 40),
        (1,),
    ),
}


def curve(family: str = "damped", seed: int = 0, noise: float = 0.0, start: str = "") -> Setup:
    """A curve of a family; the noise is a share of the root mean square of the data."""
    one = FAMILIES[family]
    rng = np.random.default_rng((sorted(FAMILIES).index(family), seed))
    truth = one.draw(rng)
    x = cs.DM(one.places)
    clean = np.asarray(one.curve(list(truth), x), dtype=float).ravel()
    errors = rng.standard_normal(clean.size)
    moved = rng.standard_normal(truth.size)
    factor, shift = STARTS[start]
    begin = truth * np.exp(factor * moved)
    additive = list(one.additive)
    begin[additive] = truth[additive] + shift * moved[additive]
    # rounded, so that another library's exp gives the same data
    seen = np.round(clean + noise * np.sqrt(np.mean(clean**2)) * errors, 9) if noise else clean
    b = entries("b", truth.size)
    rows = one.curve(cs.vertsplit(b.symbol), x) - cs.DM(seen)
    source = f"the {'minimum next to the ' if noise else ''}truth that the data were made of"
    exact = None if noise else truth
    name = name_of(family, seed, noise)
    return one_block(name, rows, b, np.round(begin, 9), source, exact, truth)


def name_of(family: str, seed: int, noise: float) -> str:
    """`damped-noisy-3`."""
    return f"{family}-{'noisy' if noise else 'exact'}-{seed}"


CURVES: tuple[Case, ...] = tuple(
    case(
        name_of(family, seed, noise),
        family,
        curve,
        {"family": family, "seed": seed, "noise": noise, "start": start},
        f"start {start}" if start else "",
    )
    for family in FAMILIES
    for noise in (0.0, NOISE)
    for seed in range(6)
    for start in STARTS
)


# Outliers

SHARE = 0.2
SIGMA = 0.05
KERNELS: Mapping[str, tuple[Kernel, float]] = {  # and how many sigmas count as its sigma
    "huber": (huber(), 1.0),
    "geman-mcclure": (geman_mcclure, 5.0),
}
OUTLYING = ("exponentials", "logistic", "damped")
POINTS = 40  # of a circle, and of a motion
ANSWER = "the minimum next to the truth"


def robust_curve(family: str = "damped", kernel: str = "huber", seed: int = 0) -> Setup:
    """A curve of one of the families, a fifth of whose observations are off by 2 in the mean."""
    one = FAMILIES[family]
    rng = np.random.default_rng((7, OUTLYING.index(family), seed))
    truth = one.draw(rng)
    x = cs.DM(one.places)
    clean = np.asarray(one.curve(list(truth), x), dtype=float).ravel()
    off = np.where(rng.random(clean.size) < SHARE, 2.0, SIGMA)
    seen = np.round(clean + off * rng.standard_normal(clean.size), 9)
    start = np.round(truth * np.exp(0.3 * rng.standard_normal(truth.size)), 9)
    b = entries("b", truth.size)
    robust, wide = KERNELS[kernel]
    r = Residual(
        "curve", one.curve(cs.vertsplit(b.symbol), x) - cs.DM(seen), wide * SIGMA, kernel=robust
    )
    return one_block(f"robust-{family}-{kernel}-{seed}", r, b, start, ANSWER, made_of=truth)


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
    start = np.array([*np.round(seen.mean(axis=1) + rng.uniform(-1, 1, 2), 9), 1.0])
    return one_block(f"robust-circle-{kernel}-{seed}", r, c, start, ANSWER, made_of=truth)


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
    truth = np.array([turn, *shift])
    return one_block(f"robust-motion-{kernel}-{seed}", r, m, np.zeros(3), ANSWER, made_of=truth)


ROBUST: tuple[Case, ...] = (
    *(
        case(
            f"robust-{family}-{kernel}-{seed}",
            "robust",
            robust_curve,
            {"family": family, "kernel": kernel, "seed": seed},
        )
        for family in OUTLYING
        for kernel in KERNELS
        for seed in range(3)
    ),
    *(
        case(f"robust-{shape}-{kernel}-{seed}", "robust", build, {"kernel": kernel, "seed": seed})
        for shape, build in (("circle", robust_circle), ("motion", robust_motion))
        for kernel in KERNELS
        for seed in range(3)
    ),
)
