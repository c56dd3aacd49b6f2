"""The model of the coefficients as least squares: one step ahead, and made stable."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.motions import Motion
from workbench.motions.soft_tissue import companion

HARDLY = 0.01  # of an input's bound: what moves less than this in the clips hardly moves


@dataclass(frozen=True, eq=False)
class TissueClip:
    """A motion, of a person with its betas, and how far their tissue was displaced in it.

    Attributes:
        motion: T frames, at the rate of the model.
        displacements: (T, N, 3) m at rest, as `simulate_tissue` gives them, or as what is left of
            registrations that were unposed.
    """

    motion: Motion
    displacements: Array


@dataclass(frozen=True, eq=False)
class OneStep:
    """The rows of the one-step model of all clips: targets = regressors @ [A_1 A_2 B]'.

    Attributes:
        regressors: (M, 2 C + X): the coefficients of the two frames before, and the inputs.
        targets: (M, C).
    """

    regressors: Array
    targets: Array

    @staticmethod
    def of(clips: list[tuple[Array, Array]]) -> "OneStep":
        """Of clips of coefficients (T, C) and inputs (T, X); no row goes over a clip's end."""
        rows, targets = [], []
        for phi, x in clips:
            rows.append(np.hstack([phi[1:-1], phi[:-2], x[2:]]))
            targets.append(phi[2:])
        return OneStep(np.concatenate(rows), np.concatenate(targets))

    def solve(self, ridge: float) -> tuple[Array, Array, Array]:
        """A_1, A_2 and B of the least squares with a penalty on the factors of the inputs.

        The penalty is `ridge` (mean square of the input + `HARDLY`^2) times the squared factor.
        So an input that hardly moves in the clips gets a small factor, and not one that explains
        noise and shakes the tissue as soon as a motion does move it.
        """
        C, Z = self.targets.shape[1], self.regressors
        size = (Z**2).mean(axis=0)
        own = np.arange(Z.shape[1]) < 2 * C
        price = np.where(own, 1e-9 * size, ridge * (size + HARDLY**2))
        found = penalised(Z, self.targets, price)
        return found[:C].T, found[C : 2 * C].T, found[2 * C :].T


def penalised(Z: Array, Y: Array, price: Array) -> Array:
    """The W (n, C) of least mean of |Z W - Y|^2 over the rows, plus price (n,) times W^2.

    That is (Z'Z / M + diag(price)) W = Z'Y / M. Columns of Z are brought to one size first, so that
    rounding does not depend on their units; a column of zeros gets zeros.
    """
    size = (Z**2).mean(axis=0)
    scale = np.sqrt(np.where(size > 0, size, 1.0))
    H = (Z / scale).T @ (Z / scale) / len(Z) + np.diag(price / scale**2)
    H[size == 0, size == 0] = 1.0
    W: Array = np.linalg.solve(H, (Z / scale).T @ Y / len(Z)) / scale[:, None]
    return W


def stabilized(first: Array, second: Array, most: float) -> tuple[Array, Array]:
    """A_1 and A_2 whose poles are all multiplied by one factor, so that none is above `most`.

    A pole z solves z^2 v = z A_1 v + A_2 v. With s A_1 and s^2 A_2 the poles are s z, with the same
    vectors v: every wobble keeps its frequency and its form, and dies away a little faster.
    """
    radius = float(np.abs(np.linalg.eigvals(companion(first, second))).max())
    s = min(1.0, most / radius)
    return s * first, s * s * second
