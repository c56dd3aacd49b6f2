"""Small sums of squares from books and papers, each from its published start.

Collected in A. R. Buckley, Test functions for unconstrained minimization (TR 1989CS-3, Dalhousie
University, 1989) and in the CUTEst collection (Gould, Orban and Toint, CUTEst: a constrained and
unconstrained testing environment with safe threads, Computational Optimization and Applications 60,
2015). The observations are in `data/published.json`.
"""

import json
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case
from benchmarks.gym.published_function import PublishedFunction
from workbench.arrays import Array
from workbench.fitting.setup import Setup

FILE = Path(__file__).parent / "data" / "published.json"
Residuals = Callable[[cs.MX], cs.MX]


@cache
def observed(problem: str) -> Array:
    """The rows of observations of a problem."""
    return np.array(json.loads(FILE.read_text())[problem], dtype=float)


def dennis_schnabel_a(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2, x[0] + x[1], cs.exp(x[1]) - 1)


def dennis_schnabel_b(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 2, (x[0] - 2) * x[1], x[1] + 1)


def dennis_schnabel_c(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2 + x[1] ** 2 - 2, cs.exp(x[0] - 1) + x[1] ** 3 - 2)


def dennis_schnabel_d(x: cs.MX) -> cs.MX:
    a, b, c = cs.vertsplit(x)
    return cs.vertcat(a**2 + b**3 - c**4, 2 * a * b * c, 2 * a * b - 3 * b * c + a * c)


def dennis_schnabel_e(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0], x[1] + x[1] ** 2, cs.exp(x[2]) - 1)


def dennis_schnabel_f(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(2 * (a + b) ** 2 + (a - b) ** 2 - 8, 5 * a**2 + (b - 3) ** 2 - 9)


def _growing(t: Array, z: Array) -> Residuals:
    """exp(t x3) - x1 exp(t x2) + z, the fits of the OPTIMA manual."""
    return lambda x: cs.exp(cs.DM(t) * x[2]) - x[0] * cs.exp(cs.DM(t) * x[1]) + cs.DM(z)


HATFIELD_D = np.array(
    [
        (0.2, 1.751),
        (0.3, 1.561),
        (0.4, 1.391),
        (0.5, 1.239),
        (0.6, 1.103),
        (0.7, 0.981),
        (0.75, 0.925),
        (0.8, 0.8721),
        (0.85, 0.8221),
        (0.9, 0.7748),
    ]
)


def hatfield_f(x: cs.MX) -> cs.MX:
    t = cs.DM([1.0, 2.0, 3.0])
    return x[0] + x[1] * cs.exp(t * x[2]) - cs.DM([0.032, 0.056, 0.099])


def hatfield_g(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    inner = (x[1 : n - 1] + 1) * (x[: n - 2] + 1 - x[2:])
    products = cs.vertcat(-x[0] * x[1], inner, x[n - 2] * x[n - 1])
    return x - x[12] - 1 + products


def exponential_growth(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(1.0, 11) / 4)
    return x[0] * cs.exp(t * x[1]) - t


def engvall(x: cs.MX) -> cs.MX:
    a, b, c = cs.vertsplit(x)
    return cs.vertcat(
        a**2 + b**2 + c**2 - 1,
        a**2 + b**2 + (c - 2) ** 2 - 1,
        a + b + c - 1,
        a + b - c + 1,
        3 * b**2 + a**3 + (5 * c - a + 1) ** 2 - 36,
    )


def gottfried(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a - 0.1136 * (a + 3 * b) * (1 - a), b + 7.5 * (2 * a - b) * (1 - b))


def hyperbola_circle(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] * x[1] - 1, x[0] ** 2 + x[1] ** 2 - 4)


def recipe(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 5, x[1] ** 2, x[2] / (x[1] - x[0]))


def cluster(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat((a - b**2) * (a - cs.sin(b)), (cs.cos(b) - a) * (b - cs.cos(a)))


def powell_square(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2, 10 * x[0] / (x[0] + 0.1) + 2 * x[1] ** 2)


def heart_6(x: cs.MX) -> cs.MX:
    """The first moments of the two dipoles are eliminated: sums of a and of c are given."""
    a, c, t, u, v, w = cs.vertsplit(x)
    real, imaginary = cs.vertcat(a, -0.816 - a), cs.vertcat(c, -0.017 - c)
    t, v = cs.vertcat(t, u), cs.vertcat(v, w)
    rows = []
    for _ in range(3):
        real, imaginary = real * t - imaginary * v, real * v + imaginary * t
        rows += [cs.sum1(real), cs.sum1(imaginary)]
    return cs.vertcat(*rows) - cs.DM([-1.826, -0.754, -4.839, -3.259, -14.023, 15.467])


def beam(x: cs.MX) -> cs.MX:
    place, angle, speed = (cs.DM(column) for column in observed("beam").T)
    powers = cs.horzcat(*(place**k for k in range(4)))
    return (powers @ x[:4]) * cs.cos(powers @ x[4:] - angle) - speed


def himmelblau(x: cs.MX) -> cs.MX:
    a, b = (cs.DM(column) for column in observed("himmelblau").T)
    above = x[0] ** 2 + a * x[1] ** 2 + a**2 * x[2] ** 2
    return 100 * (above / (b * (1 + a * x[3] ** 2)) - 1)


def judge(x: cs.MX) -> cs.MX:
    a, b, y = (cs.DM(column) for column in observed("judge").T)
    return x[0] + a * x[1] + b * x[1] ** 2 - y


def devilliers_glasser_1(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(24.0) / 10)

    def model(b: list[cs.MX]) -> cs.MX:
        return b[0] * b[1] ** t * cs.sin(t * b[2] + b[3])

    return model(cs.vertsplit(x)) - model([60.137, 1.371, 3.112, 1.761])


def devilliers_glasser_2(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(16.0) / 10)

    def model(b: list[cs.MX]) -> cs.MX:
        wave = cs.tanh(t * b[2] + cs.sin(t * b[3]))
        return b[0] * b[1] ** t * wave * cs.cos(t * cs.exp(b[4]))

    return model(cs.vertsplit(x)) - model([53.81, 1.27, 3.012, 2.13, 0.507])


def exponentials_of_two(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(10.0) / 10)
    return cs.exp(-t * x[0]) - 5 * cs.exp(-t * x[1]) - cs.exp(-t) + 5 * cs.exp(-10 * t)


def schittkowski_308(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a**2 + a * b + b**2, cs.sin(a), cs.cos(b))


def cragg_levy(x: cs.MX) -> cs.MX:
    a, b, c, d = cs.vertsplit(x)
    return cs.vertcat((cs.exp(a) - b) ** 2, 10 * (b - c) ** 3, cs.tan(c - d) ** 2, a**4, d - 1)


def sine_valley(x: cs.MX) -> cs.MX:
    return cs.vertcat(100 * (x[1] - cs.sin(x[0])), x[0] / 2)


def egg_crate(x: cs.MX) -> cs.MX:
    return cs.vertcat(x, 5 * cs.sin(x))


def el_attar(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a**2 + b - 10, a + b**2 - 7, a**2 + b**3 - 1)


def pole_fit(x: cs.MX) -> cs.MX:
    """Value and two derivatives of a function with a pole; the answer is (1, 3, 2)."""
    a, r, h = cs.vertsplit(x)
    first, second = a * r * h, a * (a + 1) * r * h**2
    return cs.vertcat(
        -second / 2 + first - r * (1 - (1 + h) ** -a) + 8,
        -second + first * (1 - (1 + h) ** (-a - 1)) + 56 / 3,
        -second * (1 - (1 + h) ** (-a - 2)) + 208 / 9,
    )


DENNIS = "Dennis and Schnabel 1983"
OPTIMA = "The OPTIMA user manual, Hatfield Polytechnic 1989"
BUCKLEY = "Buckley 1989"
GLASSER = "De Villiers and Glasser 1981"
PUBLISHED_FUNCTIONS: Mapping[str, PublishedFunction] = {
    "dennis-schnabel-a": PublishedFunction(dennis_schnabel_a, (1, 1), DENNIS, (0, 0)),
    "dennis-schnabel-b": PublishedFunction(dennis_schnabel_b, (1, 1), DENNIS, (2, -1)),
    "dennis-schnabel-c": PublishedFunction(dennis_schnabel_c, (2, 3), DENNIS, (1, 1)),
    "dennis-schnabel-d": PublishedFunction(dennis_schnabel_d, (10, 10, 10), DENNIS, (0, 0, 0)),
    "dennis-schnabel-e": PublishedFunction(dennis_schnabel_e, (2, 3, -8), DENNIS, (0, 0, 0)),
    "dennis-schnabel-f": PublishedFunction(dennis_schnabel_f, (2, 0), DENNIS),
    "hatfield-d": PublishedFunction(_growing(*HATFIELD_D.T), (1, -1, 0), OPTIMA),
    "hatfield-f": PublishedFunction(hatfield_f, (0.1,) * 3, OPTIMA),
    "hatfield-g": PublishedFunction(hatfield_g, (1,) * 25, OPTIMA),
    "exponential-growth": PublishedFunction(exponential_growth, (0, 0), BUCKLEY),
    "engvall": PublishedFunction(engvall, (1, 2, 0), BUCKLEY, (0, 0, 1)),
    "gottfried": PublishedFunction(gottfried, (0.5, 0.5), BUCKLEY, (0, 0)),
    "hyperbola-circle": PublishedFunction(hyperbola_circle, (0, 1), BUCKLEY),
    "recipe": PublishedFunction(recipe, (2, 5, 1), BUCKLEY, (5, 0, 0)),
    "cluster": PublishedFunction(cluster, (0, 0), BUCKLEY),
    "powell-square": PublishedFunction(powell_square, (3, 1), "Powell 1970", (0, 0)),
    "heart-6": PublishedFunction(heart_6, (0, 0, 1, 1, 1, 1), "Dennis, Gay and Vu 1985"),
    "vibrating-beam": PublishedFunction(
        beam, (-3.5, 1, 0, 0, 1.7, 0, 0, 0), "Toint and Montgomery 1993"
    ),
    "himmelblau-32": PublishedFunction(himmelblau, (2.7, 90, 1500, 10), "Himmelblau 1972"),
    "judge": PublishedFunction(judge, (1, 5), "Judge et al. 1985"),
    "devilliers-glasser-1": PublishedFunction(
        devilliers_glasser_1, (2, 2, 2, 2), GLASSER, (60.137, 1.371, 3.112, 1.761)
    ),
    "devilliers-glasser-2": PublishedFunction(
        devilliers_glasser_2, (20, 2, 2, 2, 0.2), GLASSER, (53.81, 1.27, 3.012, 2.13, 0.507)
    ),
    "exponentials-of-two": PublishedFunction(
        exponentials_of_two, (1, 5), "Ampgo benchmark, Gavana 2013", (1, 10)
    ),
    "schittkowski-308": PublishedFunction(schittkowski_308, (3, 0.1), "Schittkowski 1987"),
    "cragg-levy": PublishedFunction(cragg_levy, (1, 2, 2, 2), "Cragg and Levy 1969", (0, 1, 1, 1)),
    "sine-valley": PublishedFunction(sine_valley, (4.712389, -1), "Xiao and Zhou 1992", (0, 0)),
    "egg-crate": PublishedFunction(egg_crate, (1, 2), "Ampgo benchmark, Gavana 2013", (0, 0)),
    "el-attar": PublishedFunction(el_attar, (1, 5), "El-Attar, Vidyasagar and Dutta 1979"),
    "pole-fit": PublishedFunction(pole_fit, (1, 0, 1), "Toint 1993", (1, 3, 2)),
}


def published(function: str = "engvall") -> Setup:
    """A function of the table, begun at its published start."""
    return PUBLISHED_FUNCTIONS[function].setup(function)


PUBLISHED: tuple[Case, ...] = tuple(
    case(name, "published", published, {"function": name}) for name in PUBLISHED_FUNCTIONS
)
