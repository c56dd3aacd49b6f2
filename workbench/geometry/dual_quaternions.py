"""Rigid motions as dual quaternions: (8, K) columns, w x y z of the real part, then of the dual.

The motion v -> R v + t is (q, q_e) with q the quaternion of R and q_e = 1/2 (0, t) q, and so is
its opposite (-q, -q_e). Kavan, Collins, Zara, O'Sullivan: Geometric Skinning with Approximate Dual
Quaternion Blending, ACM TOG 27(4), 2008.
"""

from collections.abc import Sequence

import casadi as cs

from workbench.geometry.rotation import Matrix


def dual_quaternions(motions: Sequence[Matrix]) -> Matrix:
    """The unit dual quaternions (8, K) of K motions (3, 4), with offsets and dual parts in m."""
    entries = cs.horzcat(*[cs.vec(G) for G in motions])  # (12, K)
    q, t = _quaternions(entries[:9, :]), entries[9:, :]
    w, r = q[0, :], q[1:, :]
    return cs.vertcat(q, -0.5 * _dot(t, r), 0.5 * (_times(w, t) + _cross(t, r)))


def moved(points: Matrix, dual: Matrix) -> Matrix:
    """Points (3, N) m moved by dual quaternions (8, N), one each, of any length but zero.

    With (w, r) and (w_e, r_e) over the length of the real part (Kavan et al. 2008, algorithm 1):

        v + 2 r x (r x v + w v) + 2 (w r_e - w_e r + r x r_e)

    The component of the dual part that is parallel to the real one moves nothing, and can stay.
    """
    unit = dual / cs.repmat(cs.sqrt(_dot(dual[:4, :], dual[:4, :])), 8, 1)
    w, r, w_e, r_e = unit[0, :], unit[1:4, :], unit[4, :], unit[5:, :]
    turned = points + 2 * _cross(r, _cross(r, points) + _times(w, points))
    return turned + 2 * (_times(w, r_e) - _times(w_e, r) + _cross(r, r_e))


def _quaternions(entries: Matrix) -> Matrix:
    """The unit quaternions (4, K), with either sign, of rotations (9, K), column by column.

    4 q q' is linear in R. Of its columns the one with the largest diagonal entry, which is at
    least 1, is divided by its length (Shepperd, J. Guidance and Control 1(3), 1978), so that
    derivatives are exact at every rotation, those by 180 degrees among them.
    """
    xx, yx, zx, xy, yy, zy, xz, yz, zz = cs.vertsplit(entries, 1)
    a, b, c = zy - yz, xz - zx, yx - xy  # 4 w times x, y, z
    f, g, h = xy + yx, xz + zx, yz + zy  # 4 times x y, x z, y z
    diagonal = (1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz)
    columns = [
        cs.vertcat(diagonal[0], a, b, c),
        cs.vertcat(a, diagonal[1], f, g),
        cs.vertcat(b, f, diagonal[2], h),
        cs.vertcat(c, g, h, diagonal[3]),
    ]
    largest, chosen = diagonal[0], columns[0]
    for entry, column in zip(diagonal[1:], columns[1:], strict=True):
        larger = entry > largest
        chosen = cs.if_else(cs.repmat(larger, 4, 1), column, chosen)
        largest = cs.if_else(larger, entry, largest)
    return chosen / cs.repmat(2 * cs.sqrt(largest), 4, 1)


def _dot(a: Matrix, b: Matrix) -> Matrix:
    return cs.sum1(a * b)


def _times(factors: Matrix, columns: Matrix) -> Matrix:
    """Each column (3,) times its factor."""
    return cs.repmat(factors, columns.shape[0], 1) * columns


def _cross(a: Matrix, b: Matrix) -> Matrix:
    x, y, z = a[0, :], a[1, :], a[2, :]
    u, v, w = b[0, :], b[1, :], b[2, :]
    return cs.vertcat(y * w - z * v, z * u - x * w, x * v - y * u)
