"""How deep capsules of a body overlap: a hinge, the gaps themselves, and SMPLify's spheres."""

from functools import cache

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.residuals.residual import Residual, as_matrix, expressed, numbered

NEGLIGIBLE = 1e-18  # m^2: shorter segments are points, and nearer ones have no direction
PARALLEL = 1e-10  # the squared sine of an angle below which the ends alone decide


def gaps(ends: Points | cs.MX, radii: cs.MX | ArrayLike, pairs: ArrayLike) -> cs.MX:
    """The distance of the surfaces of two capsules, for each pair, (P, 1) m; negative: overlap.

    `ends` (2 C, 3) m are start and end of each capsule in turn, as `capsule_points` gives
    them, `radii` (C,) m numbers or symbols, and `pairs` (P, 2) the numbers of capsules. Kept at
    zero or above by a solver that takes constraints:

        Constraint("apart", gaps(ends, radii, pairs), lower=0, unit="m", points=(ends,))

    Where the segments themselves meet, the gap is right, but no direction leads apart and its
    derivative by the ends is zero. Raises BadResidual for shapes that do not fit.
    """
    points, r, chosen = _capsules("gaps", ends, radii, pairs)
    i, j = chosen.T
    columns, segment_distance = cs.horzsplit(points), _segment_distance()
    # pair by pair, not by `map`: derivatives then skip the ends that a pair does not read
    distances = [
        segment_distance(*(columns[2 * capsule + end] for capsule in pair for end in (0, 1)))
        for pair in chosen
    ]
    return cs.vertcat(*distances) - r[i.tolist()] - r[j.tolist()]


def apart(
    ends: Points | cs.MX,
    radii: cs.MX | ArrayLike,
    pairs: ArrayLike,
    *,
    sigma: float,
    name: str = "apart",
) -> Residual:
    """max(0, r_i + r_j - d_ij), how deep each pair of capsules overlaps, in metres.

    d_ij is the distance of the two segments, and the arguments are those of `gaps`. The row is zero
    as long as the capsules do not overlap. The smaller sigma, the nearer is the minimum to that
    under the constraint that no gap is negative: what remains is a depth of sigma^2 times the
    force that pushes the pair together.

    Take `Dogleg` to minimise it. Where a pair is pushed hard, the curvature of the cost can be
    several times that of J'J in some direction; the damping that this asks for slows all other
    directions of `TrustRegion` and `LevenbergMarquardt` too (`benchmarks/DECISIONS.md`).
    """
    depth = cs.fmax(0, -gaps(ends, radii, pairs))
    return Residual(name, depth, sigma, "m", points=expressed(ends)[1], labels=_labels(ends, pairs))


def spheres(
    ends: Points | cs.MX,
    radii: cs.MX | ArrayLike,
    pairs: ArrayLike,
    *,
    sigma: float,
    per_capsule: int = 4,
    share: float = 0.3,
    name: str = "spheres",
) -> Residual:
    """SMPLify's interpenetration term E_sp (Bogo et al. 2016), with spheres along the capsules:

        E_sp = sum over pairs of spheres of exp(-|C_i - C_j|^2 / (s_i^2 + s_j^2)),  s = 0.3 r

    The rows are sqrt of the terms, so that their sum of squares is E_sp. It is here to be compared
    with `apart`. The paper's formula lacks the minus sign. SMPLify's code does not differentiate by
    betas, since this pushes to thin bodies; give radii in numbers for that.

    `per_capsule` spheres, at least 2, are spread evenly from end to end; `share` is s / r.
    """
    points, r, chosen = _capsules(name, ends, radii, pairs)
    if per_capsule < 2:
        raise BadResidual(f"residual {name!r} needs at least 2 spheres a capsule, at its ends")
    places = np.linspace(0, 1, per_capsule)
    first, second = np.repeat(places, per_capsule), np.tile(places, per_capsule)
    rows = []
    for i, j in chosen.tolist():
        a, b, c, d = (points[:, k] for k in (2 * i, 2 * i + 1, 2 * j, 2 * j + 1))
        off = (
            cs.mtimes(a, cs.DM(1 - first).T)
            + cs.mtimes(b, cs.DM(first).T)
            - cs.mtimes(c, cs.DM(1 - second).T)
            - cs.mtimes(d, cs.DM(second).T)
        )
        width = share**2 * (r[i] ** 2 + r[j] ** 2)
        rows.append(cs.exp(-0.5 * cs.sum1(off**2).T / width))
    return Residual(name, cs.vertcat(*rows), sigma, "1", points=expressed(ends)[1])


def _capsules(
    name: str, ends: Points | cs.MX, radii: cs.MX | ArrayLike, pairs: ArrayLike
) -> tuple[cs.MX, cs.MX, Index]:
    points, _ = expressed(ends)
    C, odd = divmod(points.shape[1], 2)
    if odd:
        raise BadResidual(
            f"{name!r} takes two ends for each capsule, not {points.shape[1]} points; "
            "capsule_points of a body has them"
        )
    r = as_matrix(name, "the radii", radii, (C,))
    if r.shape != (C, 1):
        raise BadResidual(f"{name!r} has {C} capsules, but radii of shape {r.shape}")
    return points, r, numbered(name, "pairs (P", pairs, 2, C)


def _labels(ends: Points | cs.MX, pairs: ArrayLike) -> tuple[str, ...] | None:
    names = ends.labels if isinstance(ends, Points) else None
    if names is None:
        return None
    of = [name.rpartition(",")[0] or name for name in names[::2]]
    return tuple(f"{of[i]} and {of[j]}" for i, j in np.asarray(pairs))


@cache
def _segment_distance() -> cs.Function:
    """The distance of segments ab and cd; each candidate is feasible, and the least is it."""
    p, pe, q, qe = (cs.SX.sym(name, 3) for name in ("a", "b", "c", "d"))
    u, v, w = pe - p, qe - q, p - q
    a, b, c, d, e = cs.dot(u, u), cs.dot(u, v), cs.dot(v, v), cs.dot(u, w), cs.dot(v, w)
    det = a * c - b * b
    crossed = det > PARALLEL * a * c
    safe = cs.if_else(crossed, det, 1)
    long_a, long_c = cs.fmax(a, NEGLIGIBLE), cs.fmax(c, NEGLIGIBLE)

    def within(x: cs.SX) -> cs.SX:
        return cs.fmin(cs.fmax(x, 0), 1)

    places = [
        tuple(within(cs.if_else(crossed, x / safe, 0)) for x in (b * e - c * d, a * e - b * d)),
        (cs.SX(0), within(e / long_c)),
        (cs.SX(1), within((e + b) / long_c)),
        (within(-d / long_a), cs.SX(0)),
        (within((b - d) / long_a), cs.SX(1)),
    ]
    squares = [cs.sumsqr(w + s * u - t * v) for s, t in places]
    least = squares[0]
    for square in squares[1:]:
        least = cs.if_else(square < least, square, least)
    near = least < NEGLIGIBLE
    return cs.Function(
        "segment_distance",
        [p, pe, q, qe],
        [cs.if_else(near, 0, cs.sqrt(cs.if_else(near, 1, least)))],
    )
