r"""What is sampled of a problem's unknowns, and what becomes of the rest.

    x(z, w) = origin + along (z - centre) + rest w

z (k,) is sampled. The rest is fixed (`rest` has no columns), or moves with z along the ridge of
Laplace's approximation and is given its Gaussian conditional about it: w is standard normal. With
H = J'J at the origin, a for what is sampled and b for what is not, the ridge is -H_bb^-1 H_ba and
the conditional covariance H_bb^-1.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workbench.blocks import Layout
from workbench.blocks.entries import Indices
from workbench.errors import BadArgument, UnknownName, WorkbenchError
from workbench.problem import Linearization, Problem

Array = NDArray[np.float64]


class Improper(WorkbenchError):
    """A direction that neither data nor priors nor bounds hold: its posterior has no width."""


@dataclass(frozen=True, eq=False)
class Subspace:
    """See the module; n free numbers, k of them (or directions) sampled."""

    origin: Array  # (n,)
    along: Array  # (n, k)
    centre: Array  # (k,)
    rest: Array  # (n, c)
    labels: tuple[str, ...]  # of z
    units: tuple[str, ...]
    entries: Indices | None = None  # the places of z in x, where it is entries

    @property
    def size(self) -> int:
        """k."""
        return len(self.centre)

    @cached_property
    def still(self) -> bool:
        """Whether z are entries and all else stays where it is."""
        if self.entries is None or self.rest.shape[1]:
            return False
        return not np.delete(self.along, self.entries, axis=0).any()

    def points(self, z: Array, w: Array | None = None) -> Array:
        """x (M, n) for z (M, k), and w (M, c) if it is not to be zero."""
        x = self.origin + (z - self.centre) @ self.along.T
        if self.entries is not None:
            x[:, self.entries] = z  # and not their sum with the origin, to the last bit
        return x if w is None else x + w @ self.rest.T


Rest = Callable[[Problem, Linearization, Array, Indices], Subspace]


def fixed(problem: Problem, here: Linearization, x: Array, chosen: Indices) -> Subspace:
    """All that is not chosen stays where it is."""
    along = np.zeros((len(x), len(chosen)))
    along[chosen, np.arange(len(chosen))] = 1.0
    return _entries(problem.free, x, chosen, along, np.empty((len(x), 0)))


def conditional(problem: Problem, here: Linearization, x: Array, chosen: Indices) -> Subspace:
    """What is not chosen is integrated out by its Gaussian conditional; see the module.

    Raises Improper where that has no width.
    """
    others = np.setdiff1d(np.arange(len(x)), chosen)
    along = fixed(problem, here, x, chosen).along
    rest = np.zeros((len(x), len(others)))
    if others.size:
        R = _triangle(here.dense[:, others], problem.free, others)
        ridge = scipy.linalg.lstsq(here.dense[:, others], here.dense[:, chosen])[0]
        along[others] = -ridge
        rest[others] = scipy.linalg.solve_triangular(R, np.eye(len(others)))
    return _entries(problem.free, x, chosen, along, rest)


def informed(
    problem: Problem, here: Linearization, x: Array, count: int, priors: Iterable[str]
) -> Subspace:
    """The `count` directions that the data know best, compared with the priors; the rest Gaussian.

    J_d'J_d v = l (J'J) v with J_d the rows of the data, the largest l first (Cui et al. 2014,
    likelihood-informed subspaces, there by the prior). Directions are scaled to one standard
    deviation of Laplace's approximation, in which they are independent. Raises UnknownName for
    priors that are no residuals, Improper where a direction has no width.
    """
    n = problem.free.size
    if not 0 < count <= n:
        raise BadArgument(f"1 to {n} directions can be sampled, not {count}")
    is_prior = np.zeros(problem.size, dtype=bool)
    for name in priors:
        if name not in problem.rows:
            raise UnknownName("residual", name, problem.rows)
        is_prior[problem.rows[name]] = True
    W = scipy.linalg.solve_triangular(_triangle(here.dense, problem.free, np.arange(n)), np.eye(n))
    told = here.dense[is_prior] @ W
    share, Q = np.linalg.eigh(told.T @ told)  # of the priors, rising
    V = W @ Q
    V *= np.where(V[np.argmax(abs(V), axis=0), np.arange(n)] < 0, -1.0, 1.0)  # one of two signs
    labels = tuple(
        f"direction {i + 1} ({1 - share[i]:.0%} data; {_mostly(problem.free, V[:, i])})"
        for i in range(count)
    )
    return Subspace(x, V[:, :count], np.zeros(count), V[:, count:], labels, ("sd",) * count)


def _entries(layout: Layout, x: Array, chosen: Indices, along: Array, rest: Array) -> Subspace:
    return Subspace(
        x, along, x[chosen].copy(), rest,
        tuple(layout.label(int(i)) for i in chosen), tuple(layout.unit(int(i)) for i in chosen),
        chosen,
    )  # fmt: skip


def _triangle(J: Array, layout: Layout, columns: Indices) -> Array:
    """R with R'R = J'J, all of its diagonal above rounding; raises Improper."""
    lengths = np.linalg.norm(J, axis=0)  # of no matter: a unit makes nothing unseen
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, s, Vt = np.linalg.svd(J / lengths, full_matrices=True)
    least = np.zeros(J.shape[1])
    least[: s.size] = s
    tolerance = np.finfo(float).eps * max(J.shape) * max(least.max(initial=0), 1e-300)
    if (least <= tolerance).any():
        direction = np.zeros(layout.size)
        direction[columns] = Vt[int(np.argmin(least))] / lengths
        raise Improper(
            f"nothing holds {_mostly(layout, direction)}: its posterior has no width. Add a prior "
            "or bounds, or fix it; `workbench diagnose` names all such directions"
        )
    R = scipy.linalg.qr(J, mode="r")[0][: J.shape[1]]
    return np.asarray(R * np.where(np.diag(R) < 0, -1.0, 1.0)[:, None])


def _mostly(layout: Layout, direction: Array) -> str:
    """The two entries with most of a direction."""
    order = np.argsort(-abs(direction))[:2]
    large = [i for i in order if abs(direction[i]) > 0.3 * abs(direction[order[0]])]
    return ", ".join(layout.label(int(i)) for i in large)
