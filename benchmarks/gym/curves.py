"""Curves drawn at random: six families, with and without noise, from starts far from the truth.

Each seed draws the true parameters, the places of the observations, the noise and the start. Data
without noise have the truth as their answer, with a cost of 0. The answer of noisy data is the
minimum next to the truth, which Newton's method in 40 digits finds from there. Starts are the truth
with each parameter multiplied by exp(0.7 z), z standard normal, and with offsets and phases moved
by 0.5 z; far starts have 1.5 and 1 instead.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case, setup
from workbench.arrays import Array
from workbench.blocks import Block
from workbench.fitting.setup import Setup

STARTS = {"": (0.7, 0.5), "far": (1.5, 1.0)}  # factors of z: of logarithms, and of what is added
SEEDS = range(6)
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
    b = Block("b", (truth.size,), labels=tuple(f"b{i + 1}" for i in range(truth.size)))
    model = one.curve(cs.vertsplit(b.symbol), x)
    name = name_of(family, seed, noise)
    if noise:
        source = "the minimum next to the truth that the data were made of"
        return setup(name, model - cs.DM(seen), b, np.round(begin, 9), source, made_of=truth)
    source = "the truth that the data were made of"
    return setup(name, model - cs.DM(seen), b, np.round(begin, 9), source, truth)


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
    for seed in SEEDS
    for start in STARTS
)
