"""Systems and sums of squares in which each unknown meets a few others, from published starts.

L. Lukšan, Hybrid methods in large sparse nonlinear least squares (J. Optimization Theory and
Applications 89, 1996); L. Lukšan and J. Vlček, Sparse and partially separable test problems for
unconstrained and equality constrained optimization (Institute of Computer Science, Prague, 1999);
and the CUTEst collection.
"""

from collections.abc import Mapping

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case
from benchmarks.gym.published_function import PublishedFunction
from workbench.fitting.setup import Setup


def _shifted(x: cs.MX, by: int) -> cs.MX:
    """x_(i + by), zero past the ends."""
    n, zeros = x.shape[0], cs.MX.zeros(abs(by))
    return cs.vertcat(x[by:], zeros) if by > 0 else cs.vertcat(zeros, x[: n + by])


def _blocks(x: cs.MX) -> list[cs.MX]:
    """Five neighbours of every block of three."""
    s = (x.shape[0] - 2) // 3
    return [x[[k + 3 * i for i in range(s)]] for k in range(5)]


def serpentine(x: cs.MX) -> cs.MX:
    before, after = x[:-1], x[1:]
    return cs.vertcat(20 * before / (1 + before**2) - 10 * after, before - 1)


def modified_47(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b),
        c - 1,
        (d - 1) ** 2,
        (e - 1) ** 3,
        d * a**2 + cs.sin(d - e) - 10,
        c**4 * d**2 + b - 20,
    )


def modified_48(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b),
        10 * (b**2 - c),
        (c - d) ** 2,
        (d - e) ** 2,
        a + c + b**2 - 30,
        b + d - c**2 - 10,
        a * e - 10,
    )


def modified_53(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b), b + c - 2, d - 1, e - 1, a + 3 * b, c + d - 2 * e, 10 * (b**2 - e)
    )


def trigonometric_exponential(x: cs.MX) -> cs.MX:
    before, here, after = x[: x.shape[0] - 2], x[1:-1], x[2:]
    first = 3 * x[0] ** 3 + 2 * x[1] - 5 + cs.sin(x[0] - x[1]) * cs.sin(x[0] + x[1])
    inner = (
        3 * here**3
        + 2 * after
        - 5
        + cs.sin(here - after) * cs.sin(here + after)
        + 4 * here
        - before * cs.exp(before - here)
        - 3
    )
    last = 4 * x[-1] - x[-2] * cs.exp(x[-2] - x[-1]) - 3
    return cs.vertcat(first, inner, last)


def tridiagonal(x: cs.MX) -> cs.MX:
    before, here, after = x[: x.shape[0] - 2], x[1:-1], x[2:]
    inner = 8 * here * (here**2 - before) - 2 * (1 - here) + 4 * (here - after**2)
    last = 8 * x[-1] * (x[-1] ** 2 - x[-2]) - 2 * (1 - x[-1])
    return cs.vertcat(4 * (x[0] - x[1] ** 2), inner, last)


def singular_broyden(x: cs.MX) -> cs.MX:
    return ((3 - 2 * x) * x - _shifted(x, -1) - 2 * _shifted(x, 1) + 1) ** 2


def chandrasekhar(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    mu = np.arange(1.0, n + 1) / n
    weights = mu[:, None] / (mu[:, None] + mu) / (2 * n)
    return x - 1 - x * (cs.DM(weights) @ x)


def quartic(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 1, x[0] ** 2 - x[1:] ** 2)


def large_squares(x: cs.MX) -> cs.MX:
    return cs.vertcat(2 * (x**2 - x[0]), x - 1)


def qing(x: cs.MX) -> cs.MX:
    return x**2 - cs.DM(np.arange(1.0, x.shape[0] + 1))


def chained_rosenbrock(x: cs.MX) -> cs.MX:
    return cs.vertcat(10 * (x[1:] - x[:-1] ** 2), 1 - x[:-1])


def error_in_rosenbrock(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    weights = 16 * (1.5 + np.sin(np.arange(2.0, n + 1))) ** 2
    return cs.vertcat(x[:-1] - cs.DM(weights) * x[1:] ** 2, x[1:] - 1)


def oscillating_path(x: cs.MX) -> cs.MX:
    return cs.vertcat((x[0] - 1) / 2, (x[1:] - 2 * x[:-1] ** 2 + 1) * 10)


LUKSAN = "Lukšan 1996"
VLCEK = "Lukšan and Vlček 1999"
CUTEST = "CUTEst"
CHAINED: Mapping[str, PublishedFunction] = {
    "serpentine": PublishedFunction(serpentine, np.full(20, -0.8), LUKSAN, np.ones(20)),
    "modified-47": PublishedFunction(modified_47, np.full(20, -1.0), LUKSAN),
    "modified-48": PublishedFunction(modified_48, np.full(20, -1.0), LUKSAN),
    "modified-53": PublishedFunction(modified_53, np.full(20, -1.0), LUKSAN),
    "trigonometric-exponential": PublishedFunction(
        trigonometric_exponential, np.zeros(30), VLCEK, np.ones(30)
    ),
    "tridiagonal": PublishedFunction(tridiagonal, np.full(30, 12.0), VLCEK, np.ones(30)),
    "singular-broyden": PublishedFunction(singular_broyden, np.full(30, -1.0), VLCEK),
    "chandrasekhar": PublishedFunction(chandrasekhar, np.ones(20), "Moré 1990"),
    "quartic": PublishedFunction(quartic, np.full(20, 0.1), CUTEST, np.ones(20)),
    "large-squares": PublishedFunction(large_squares, np.full(20, 4.0), CUTEST, np.ones(20)),
    "qing": PublishedFunction(qing, np.ones(20), "Qing 2006", np.sqrt(np.arange(1.0, 21))),
    "chained-rosenbrock": PublishedFunction(
        chained_rosenbrock, np.tile([-1.2, 1.0], 10), "Toint 1978", np.ones(20)
    ),
    "error-in-rosenbrock": PublishedFunction(error_in_rosenbrock, np.full(20, -1.0), "Toint 1978"),
    "oscillating-path": PublishedFunction(
        oscillating_path, np.r_[-1.0, np.ones(4)], "Nesterov; Jarre 2011", np.ones(5)
    ),
}


def chained(function: str = "serpentine") -> Setup:
    """A function of the table, begun at its published start."""
    return CHAINED[function].setup(f"chain-{function}")


CHAINS: tuple[Case, ...] = tuple(
    case(f"chain-{name}", "chains", chained, {"function": name}) for name in CHAINED
)
