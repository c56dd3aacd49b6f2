"""Halves of pose directions displace, and have the derivative of, P : (R - I), at any angle."""

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from workbench.bodies.forward.halves import NUMBERS, halved, halved_features, numbers_of, slopes_of

THETA, HALVES, E = cs.SX.sym("theta", 3), cs.SX.sym("halves", 3, 9), cs.SX.sym("e", 3)
OF = cs.SX.sym("numbers", NUMBERS)
FEATURES = cs.Function("features", [THETA], [halved_features(THETA)])
NUMBERS_OF = cs.Function("numbers", [THETA], [numbers_of(THETA)])
SLOPES = cs.Function("slopes", [HALVES, E, OF], [slopes_of(HALVES, E, OF)])
AXIS = np.array([0.48, -0.6, 0.64])


def exact(theta: list, P: np.ndarray) -> list:
    """P : (R - I) for each of three matrices, by Rodrigues' formula in many digits."""
    x, y, z = theta
    t = mp.sqrt(x * x + y * y + z * z)
    K = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned = mp.sin(t) / t * K + (1 - mp.cos(t)) / t**2 * K * K if t else K
    return [
        mp.fsum(float(p) * turned[i, j] for (i, j), p in np.ndenumerate(one.reshape(3, 3)))
        for one in P
    ]


@pytest.mark.parametrize("t", [0.0, 1e-8, 0.3, 0.4999, 0.5001, np.pi, 6.28, 2 * np.pi])
def test_the_numbers_of_rodrigues(t: float) -> None:
    """Below 0.5 rad they are series, above it closed formulas."""
    P, theta = np.random.default_rng(0).uniform(-1, 1, (3, 9)), t * AXIS
    halves, features = halved(P), FEATURES(theta).full().ravel()
    e = halves[:, 3:] @ features[3:]
    slopes = SLOPES(halves, e, NUMBERS_OF(theta)).full().reshape(3, 3)  # [by, of]
    with mp.workdps(60):
        at, step = [mp.mpf(float(x)) for x in theta], mp.mpf(10) ** -25
        expected = [float(number) for number in exact(at, P)]
        np.testing.assert_allclose(halves @ features, expected, rtol=0, atol=1e-14)
        for k in range(3):
            ends = (exact([x + s * step * (i == k) for i, x in enumerate(at)], P) for s in (-1, 1))
            by = [float((b - a) / (2 * step)) for a, b in zip(*ends, strict=True)]
            np.testing.assert_allclose(slopes[k], by, rtol=0, atol=1e-14)
