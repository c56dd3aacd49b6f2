"""Error terms of the numbers of a block: priors, limits, and joints that bend backwards."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.checks import reals
from workbench.errors import BadResidual, some_of
from workbench.residuals.residual import Residual, check_symbolic, named


def gaussian(
    expression: cs.MX,
    *,
    mean: ArrayLike = 0.0,
    covariance: ArrayLike = 1.0,
    unit: str = "1",
    name: str | None = None,
) -> Residual:
    """x - mean with its covariance: half the sum of squares is half Mahalanobis' distance squared.

    x is a block's symbol or any expression, read in the order of the array that a user sees.
    `mean` has the array's shape or broadcasts to it; `covariance` is a variance, one per entry, or
    a matrix (n, n). A matrix is whitened by its Cholesky factor, L^-1 (x - mean), so that the
    residual has no unit left and sigma 1. Raises BadResidual if shapes do not fit, a number is
    not finite or the covariance is not positive definite, and NotNumbers for text and the like.
    """
    check_symbolic("what a gaussian is about", expression)
    x = cs.vec(expression)
    n = int(x.shape[0])
    name = name or named("gaussian", expression)
    rows, columns = expression.shape
    shape = (n,) if columns == 1 else (columns, rows)  # as a user sees it
    C = reals(f"residual {name!r}: the covariance", covariance)
    mu = reals(f"residual {name!r}: the mean", mean)
    mean_shape = mu.shape
    try:
        mu = mu if mu.shape == (n,) else np.broadcast_to(mu, shape).ravel()
    except ValueError:
        mu = np.zeros(0)
    if mu.size != n or C.shape not in ((), (n,), (n, n)):
        raise BadResidual(
            f"residual {name!r} is about {shape} numbers, but has a mean of {mean_shape} and "
            f"a covariance of {C.shape}; give a mean for {shape} or ({n},), and a covariance of "
            f"shape (), ({n},) or ({n}, {n})"
        )
    if not np.isfinite(mu).all():
        i = int(np.argmax(~np.isfinite(mu)))
        raise BadResidual(f"residual {name!r} needs a finite mean, but entry {i} of it is {mu[i]}")
    difference = x - cs.DM(mu)
    if C.ndim == 2:
        return Residual(name, cs.sparsify(cs.DM(whitening(C, name))) @ difference, 1.0)
    if not ((C > 0) & np.isfinite(C)).all():
        wrong = C[~((C > 0) & np.isfinite(C))].flat[0]
        raise BadResidual(f"residual {name!r} needs finite variances above zero, not {wrong}")
    return Residual(name, difference, np.sqrt(C), unit)


def whitening(C: Array, name: str) -> Array:
    """L^-1 of a covariance C = L L', both (n, n), for the residual of this name; zero above.

    Raises BadResidual for one that is not finite, not symmetric or not positive definite.
    """
    rounding = 1e-12 * np.abs(C).max(initial=0)  # of what was computed in two orders
    # Cholesky would read the lower half only
    if not (np.isfinite(C).all() and np.allclose(C, C.T, rtol=1e-9, atol=rounding)):
        raise BadResidual(f"residual {name!r} needs a covariance that is finite and symmetric")
    try:
        L = np.linalg.cholesky(C)
    except np.linalg.LinAlgError:
        low = np.linalg.eigvalsh(C)[0]
        raise BadResidual(
            f"residual {name!r} needs a positive definite covariance; the smallest eigenvalue "
            f"of this one is {low:.3g}"
        ) from None
    # as a triangle: a general inverse leaves rounding errors where half of the numbers are zero
    return np.tril(solve_triangular(L, np.eye(len(L)), lower=True))


def max_mixture(
    expression: cs.MX,
    *,
    shares: ArrayLike,
    means: ArrayLike,
    covariances: ArrayLike,
    name: str | None = None,
) -> Residual:
    """The rows of the likeliest component, L_j^-1 (x - mu_j), and sqrt(2 (c_j - min c)).

    The likeliest one is that with the least e_j(x) = 1/2 |L_j^-1 (x - mu_j)|^2 + c_j, where
    L_j L_j' is its covariance and c_j = log det L_j - log g_j.

    The cost is min over j of e_j(x), less the smallest c_j. It has kinks where two components are
    equally likely, and no derivative there; on either side it is one Gaussian. x is a block's
    symbol or an expression of D numbers, read in the order of the array that a user sees; shares
    (C,) are the weights g_j of the components, means (C, D), covariances (C, D, D). Raises
    BadResidual for arrays that do not fit, shares that are not above 0, and a covariance that is
    not positive definite.
    """
    name = name or named("max_mixture", expression)
    white, c = _components(name, expression, shares, means, covariances)
    e = 0.5 * cs.sum1(white**2).T + cs.DM(c)  # (C, 1)
    lowest, before, each = e <= cs.mmin(e), cs.MX(0), []
    for j in range(len(c)):
        each.append(lowest[j] * (1 - before))
        before = cs.fmax(before, lowest[j])
    first = cs.vertcat(*each)  # 1 for the first component among those that are lowest
    rows = cs.vertcat(white @ first, cs.dot(cs.DM(np.sqrt(2 * (c - c.min()))), first))
    alone = (
        Residual(f"{name}, component {j}", column, 1.0)
        for j, column in enumerate(cs.horzsplit(white))
    )
    return Residual(name, rows, 1.0, components=tuple(alone))


def _components(
    name: str, expression: cs.MX, shares: ArrayLike, means: ArrayLike, covariances: ArrayLike
) -> tuple[cs.MX, Array]:
    """L_j^-1 (x - mu_j) as the columns of a matrix (D, C), and the c_j (C,)."""
    check_symbolic("what a mixture is about", expression)
    x = cs.vec(expression)
    g = reals(f"residual {name!r}: the shares", shares)
    mu = reals(f"residual {name!r}: the means", means)
    sigma = reals(f"residual {name!r}: the covariances", covariances)
    C, D = len(np.atleast_1d(g)), int(x.shape[0])
    if g.shape != (C,) or mu.shape != (C, D) or sigma.shape != (C, D, D):
        raise BadResidual(
            f"residual {name!r} is about {D} numbers, and has shares {g.shape}, means {mu.shape} "
            f"and covariances {sigma.shape}; they must be (C,), (C, {D}) and (C, {D}, {D})"
        )
    if not C or not ((g > 0) & np.isfinite(g)).all() or not np.isfinite(mu).all():
        raise BadResidual(
            f"residual {name!r} needs finite means, and shares above 0; leave out a component that "
            "has none"
        )
    inverse = np.array([whitening(covariance, name) for covariance in sigma])  # L^-1, (C, D, D)
    c = -np.log(np.einsum("cii->ci", inverse)).sum(axis=1) - np.log(g / g.sum())
    shifts = np.einsum("cde,ce->cd", inverse, mu).ravel()
    stacked = cs.DM(inverse.reshape(C * D, D)) @ x - cs.DM(shifts)
    return cs.reshape(stacked, D, C), np.asarray(c)


def limits(
    of: Block | cs.MX,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    sigma: float,
    name: str | None = None,
    unit: str = "1",
    labels: Sequence[str] | None = None,
) -> Residual:
    """How far each number lies outside of its limits: x - upper above, x - lower below.

    Between its limits a number has the residual 0. Outside of them the cost grows quadratically,
    with `sigma` in the unit of the numbers; bounds of a problem, by comparison, are never violated.
    The numbers are the entries of a block, or a column (n, 1) of expressions, whose `unit` and
    `labels` are given. Lower and upper have the shape of the block, or (n,), or broadcast to it;
    those that are infinite are no limits, and numbers without any have no row.
    `joint_limits().bounds(pose)` gives such limits of a pose.

    Raises BadResidual for limits that do not fit the numbers, for a lower one above the upper one,
    and if there are none.
    """
    name = name or named("limits", of.symbol if isinstance(of, Block) else of)
    x, shape, label_of = _numbers(name, of, labels)
    flat = []
    for side, limit in (("lower", lower), ("upper", upper)):
        numbers = reals(f"residual {name!r}: the {side} limits", limit)
        try:
            flat.append(np.broadcast_to(numbers, shape).ravel())
        except ValueError:
            raise BadResidual(
                f"residual {name!r} needs {side} limits of the shape {shape}, or one for "
                f"all, not {numbers.shape}"
            ) from None
    low, high = flat
    if not (low <= high).all():  # also where one is NaN
        i = int(np.argmin(low <= high))
        raise BadResidual(
            f"residual {name!r}: {label_of(i)} has the lower limit {low[i]:g} and "
            f"the upper limit {high[i]:g}; no number lies between"
        )
    rows = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
    if not len(rows):
        raise BadResidual(f"residual {name!r} has no finite limit; give one, or leave it out")
    x = x[rows.tolist()]
    above = cs.fmax(0, x - cs.DM(high[rows]))
    below = cs.fmin(0, x - cs.DM(low[rows]))
    if isinstance(of, Block):
        entries = tuple(of.entry(int(i))[1:-1] for i in rows)
        return Residual(name, above + below, sigma, of.unit, labels=entries, blocks=(of,))
    labels_of_rows = None if labels is None else tuple(labels[i] for i in rows.tolist())
    return Residual(name, above + below, sigma, unit, labels=labels_of_rows)


def _numbers(
    name: str, of: Block | cs.MX, labels: Sequence[str] | None
) -> tuple[cs.MX, tuple[int, ...], Callable[[int], str]]:
    """The numbers as a column, their shape as a user sees it, and what entry i is called."""
    if isinstance(of, Block):
        return cs.vec(of.symbol), of.shape, lambda i: f"{of.name}{of.entry(i)}"
    check_symbolic(f"what residual {name!r} limits", of)
    n = int(of.shape[0])
    if of.shape[1] != 1 or (labels is not None and len(labels) != n):
        raise BadResidual(
            f"residual {name!r} limits a column (n, 1) with one label for each row, not "
            f"{of.shape} with {'no' if labels is None else len(labels)} labels; casadi.vec makes a "
            "column"
        )
    return of, (n,), lambda i: f"number {i}" if labels is None else labels[i]


class Hinge(NamedTuple):
    """The axis of a rotation vector about which a joint bends, and the sign of bending back."""

    axis: int  # 0, 1 or 2, for x, y or z
    backwards: int  # 1 if a positive angle bends the joint backwards, -1 if a negative one does


HINGES: Mapping[str, Hinge] = {
    "left_elbow": Hinge(1, 1),
    "right_elbow": Hinge(1, -1),
    "left_knee": Hinge(0, -1),
    "right_knee": Hinge(0, -1),
}  # of bodies with SMPL's joints: entries 55, 58, 12 and 15 of the pose


def bending(pose: Block, *, sigma: float = 1.0, name: str = "bending") -> Residual:
    """exp(s theta) for the angle theta of each of `HINGES`, where s theta > 0 bends it backwards.

    The cost is 1/2 sum of exp(2 s theta) / sigma^2. It is E_a of SMPLify (Bogo et al., Keep it
    SMPL, 2016, section 3.3), whose code has the residual exp(s theta) as well, while its text
    writes the energy exp(theta). A straight joint has the value 1; `sigma` has no unit.

    `pose` is a block (K, 3) rad whose rows are labelled by joints. Raises BadResidual if it is
    none, or has none of the hinges' joints.
    """
    joints = pose.labels or ()
    if len(pose.shape) != 2 or pose.shape[1] != 3 or not joints:
        raise BadResidual(
            f"block {pose.name!r} {pose.shape} is no pose: rotation vectors (K, 3) whose rows are "
            "labelled by joints; give the first of body.blocks()"
        )
    present = {joint: hinge for joint, hinge in HINGES.items() if joint in joints}
    if not present:
        raise BadResidual(
            f"residual {name!r} is about the joints {some_of(sorted(HINGES))}, and block "
            f"{pose.name!r} has none of them"
        )
    labels = tuple(present)
    return Residual(name, bent_back(pose, present), sigma, labels=labels, blocks=(pose,))


def bent_back(pose: Block, hinges: Mapping[str, Hinge]) -> cs.MX:
    """exp(s theta) of each of these hinges, (H, 1); all of them are among the pose's labels."""
    joints = pose.labels or ()
    angles = [
        hinge.backwards * pose.symbol[hinge.axis, joints.index(joint)]
        for joint, hinge in hinges.items()
    ]
    return cs.exp(cs.vertcat(*angles))
