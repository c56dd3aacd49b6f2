"""Infinitesimal similarities of points: translations, rotations, and a scale about the origin."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.diagnostics.undoing import SAME


def steps_of(d: int) -> int:
    """How many similarities there are in 2 or 3 dimensions: 4 or 7."""
    return d + d * (d - 1) // 2 + 1


def similarity(X: Array) -> Array:
    """How points (N, d) move, (N d, 4 or 7): d translations, the rotations, and the scale."""
    N, d = X.shape
    turns = [np.column_stack([-X[:, 1], X[:, 0]])]
    if d == 3:
        turns = [np.cross(axis, X) for axis in np.eye(3)]
    steps = [np.broadcast_to(axis, (N, d)) for axis in np.eye(d)]
    return np.column_stack([step.ravel() for step in (*steps, *turns, X)])


def stretches(X: Array) -> Iterator[tuple[str, Array]]:
    """What else a linear map does to points (N, d): stretches and shears, in words and (N d,).

    With the rotations and the scale they span all linear maps.
    """
    d = X.shape[1]
    for i in range(d - 1):
        yield f"a stretch along {'xyz'[i]}", (X * np.eye(d)[i]).ravel()
    for i, j in combinations(range(d), 2):
        shear = np.zeros((d, d))
        shear[i, j] = shear[j, i] = 1.0
        yield f"a shear of {'xyz'[i]} and {'xyz'[j]}", (X @ shear).ravel()


@dataclass(frozen=True, eq=False)
class Step:
    """A translation, a rotation or a scale among similarities, with its coefficients (g,)."""

    kind: str
    name: str
    coefficients: Array


def named_steps(coefficients: Array, d: int, size: float) -> Iterator[Step]:
    """The steps that span a space (g, q) of similarities in d dimensions: translations first.

    Those along the axes are taken where they span it; a rotation about a point that is held, and
    not about the origin, is named by that point. The similarities are those of points divided by
    `size`.
    """
    turns = slice(d, steps_of(d) - 1)
    T = coefficients @ _null(coefficients[d:])
    for t in along_axes(T, slice(0, d)):
        yield Step("translation", f"a translation along {axis_of(t[:d])}", t)
    R = coefficients @ _null(coefficients[-1:])
    R = R - T @ (T.T @ R)
    R = _orthonormal(R)
    for r in along_axes(R, turns):
        yield Step("rotation", _rotation(r, d, size if T.shape[1] < d else 0.0), r)
    S = coefficients - T @ (T.T @ coefficients)
    S = _orthonormal(S - R @ (R.T @ S))
    for s in along_axes(S, slice(-1, None)):
        about = "" if T.shape[1] == d else f" about {_place(-size * s[:d], size)}"
        yield Step("scale", f"a scale{about}", s)


def _rotation(r: Array, d: int, size: float) -> str:
    if d == 2:
        about = f" about {_place(size * np.array([-r[1], r[0]]) / r[2], size)}" if size else ""
        return f"a rotation{about}"
    t, omega = r[:3], r[3:6]
    about = f" through {_place(size * np.cross(omega, t) / (omega @ omega), size)}" if size else ""
    return f"a rotation about {axis_of(omega)}{about}"


def axis_of(v: Array) -> str:
    """The name of an axis (3,): `x`, or the vector `(0.60, 0.80, 0.00)`."""
    v = v / np.linalg.norm(v)
    main = int(np.argmax(abs(v)))
    return "xyz"[main] if abs(v[main]) > 1 - 1e-6 else _place(v)


def _place(v: Array, size: float = 0.0) -> str:
    """A place, or a direction, in words; what is nothing beside it, or beside `size`, is 0."""
    v = np.where(abs(v) > SAME * max(size, abs(v).max(initial=0.0)), v, 0.0)
    return f"({', '.join(f'{c:.3g}' for c in v)})"


def along_axes(basis: Array, rows: slice) -> Iterator[Array]:
    """The basis (g, q) combined so that q of its rows are a unit matrix."""
    if not basis.shape[1]:
        return
    part = basis[rows]
    pivots = np.sort(scipy.linalg.qr(part.T, mode="r", pivoting=True)[1][: basis.shape[1]])
    yield from (basis @ np.linalg.inv(part[pivots])).T


def _null(A: Array) -> Array:
    """An orthonormal basis of what A (r, q) takes to zero."""
    if not A.shape[1]:
        return np.zeros((0, 0))
    _, s, Vt = np.linalg.svd(A, full_matrices=True)
    return np.asarray(Vt[int(np.sum(s > SAME)) :].T)


def _orthonormal(A: Array) -> Array:
    U, s, _ = np.linalg.svd(A, full_matrices=False)
    return np.asarray(U[:, s > SAME])
