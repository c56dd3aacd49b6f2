r"""What is sampled of a problem's unknowns, and what becomes of the rest.

    x(z, w) = origin + along (z - centre) + rest w

z (k,) is sampled. The rest is integrated out: it moves with z along the ridge of Laplace's
approximation, and is Gaussian about it, with w standard normal. Or it is held fixed (`rest` has no
columns), which makes intervals conditional. With H = J'J at the origin, a for what is sampled and b
for what is not, the ridge is -H_bb^-1 H_ba and the covariance about it H_bb^-1.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout, Tree
from workbench.blocks.layout import entries, places_named
from workbench.errors import BadArgument, TooLarge, WorkbenchError
from workbench.problem import Linearization, Problem
from workbench.problem.banded import BandedFactor, BandedMatrix


@dataclass(frozen=True, eq=False)
class BandedRest:
    """The matrix (n, c) that turns w ~ N(0, 1) into draws of what is integrated out; never stored.

    Attributes:
        factor: Cholesky's factor of the normal equations.
        others: (c,) the unknowns that are integrated out.
    """

    factor: BandedFactor
    others: Index

    @property
    def shape(self) -> tuple[int, int]:
        """The number n of all unknowns, and the number c of those that are integrated out."""
        return self.factor.order.size, len(self.others)

    def times(self, w: Array) -> Array:
        """The matrix times each row of w (M, c): (M, n)."""
        whole = np.zeros((self.shape[0], len(w)))
        whole[self.others] = w.T
        return self.factor.half_times(whole).T


class Improper(WorkbenchError):
    """A direction that neither data nor priors nor bounds hold: its posterior has no width."""


@dataclass(frozen=True, eq=False)
class Subspace:
    """x(z, w) = origin + along (z - centre) + rest w, for n free numbers x, of which z is sampled.

    z (k,) are named entries or directions. w (c,) is standard normal and stands for what is
    integrated out; see the module.

    Attributes:
        origin: (n,) the point at z = centre and w = 0.
        along: (n, k) how the unknowns move with z.
        centre: (k,) z at the origin.
        rest: (n, c) how the unknowns move with w.
        labels: a name for each entry of z.
        units: the unit of each entry of z.
        entries: the places of z among the unknowns; None where z are directions.
    """

    origin: Array
    along: Array
    centre: Array
    rest: Array | BandedRest
    labels: tuple[str, ...]
    units: tuple[str, ...]
    entries: Index | None = None

    @property
    def size(self) -> int:
        """k, the number of entries of z."""
        return len(self.centre)

    def of_columns(self, at: Index) -> "Subspace":
        """With the entries of z at some places (m,) alone; the others no longer move."""
        assert self.entries is not None  # directions have no marginal
        return replace(
            self,
            along=self.along[:, at],
            centre=self.centre[at],
            labels=tuple(self.labels[i] for i in at),
            units=tuple(self.units[i] for i in at),
            entries=self.entries[at],
        )

    @property
    def span(self) -> Array:
        """(n, k + c) all directions in which points of the subspace lie. Raises TooLarge."""
        if isinstance(self.rest, np.ndarray):
            return np.hstack([self.along, self.rest])
        raise TooLarge(
            f"what is integrated out of this sequence moves {self.rest.shape[1]:,} directions, too "
            "many to be looked at one by one; take a shorter part of the sequence"
        )

    @cached_property
    def entries_only(self) -> bool:
        """Whether z are entries and all else stays where it is."""
        if self.entries is None or self.rest.shape[1]:
            return False
        return not np.delete(self.along, self.entries, axis=0).any()

    def points(self, z: Array, w: Array | None = None) -> Array:
        """x (M, n) for z (M, k), and w (M, c) if it is not to be zero."""
        if self.entries_only:
            x = np.repeat(self.origin[None], len(z), axis=0)
        else:
            x = self.origin + (z - self.centre) @ self.along.T
        if self.entries is not None:
            x[:, self.entries] = z  # and not their sum with the origin, to the last bit
        if w is None:
            return x
        return x + (w @ self.rest.T if isinstance(self.rest, np.ndarray) else self.rest.times(w))


Rest = Callable[[Problem, Linearization, Array, Index], Subspace]
Choice = Callable[[Problem, Array, Array], Subspace]  # of a problem, free and fixed numbers
Names = str | Iterable[str] | Choice | None


def subspace_of(problem: Problem, x: Array, given: Array, names: Names, rest: Rest) -> Subspace:
    """The subspace to sample, by a choice, or by names and what becomes of all other numbers."""
    if callable(names):
        return names(problem, x, given)
    meant = entries(problem.free, problem.free.names if names is None else names)
    return rest(problem, problem.linearize_at(x, given), x, meant)


def fixed(problem: Problem, here: Linearization, x: Array, named: Index) -> Subspace:
    """All numbers that are not named are held fixed."""
    along = np.zeros((len(x), len(named)))
    along[named, np.arange(len(named))] = 1.0
    return _entries(problem.free, x, named, along, np.empty((len(x), 0)))


def integrated(problem: Problem, here: Linearization, x: Array, named: Index) -> Subspace:
    """What is not named is integrated out by Laplace's approximation of it; see the module.

    Three kinds of numbers stay where they are: those with equal bounds, those that equations among
    the constraints read, and directions of the rest that change no residual, which therefore say
    nothing about what is named. Raises Improper where a long sequence leaves such a direction.
    """
    others = np.setdiff1d(np.flatnonzero(movable(problem)), named)
    along = fixed(problem, here, x, named).along
    if here.by_frames and len(others) == len(x) - len(named) > 0:
        found = banded_rest(here, named)
        if found is None:
            raise Improper(
                "nothing holds a direction of what is to be integrated out, so its posterior has "
                "no width. Add a prior or bounds, or fix it; `workbench diagnose` names all such "
                "directions"
            )
        along[others] = found[0][others]
        return _entries(problem.free, x, named, along, found[1])
    if not others.size:
        return _entries(problem.free, x, named, along, np.empty((len(x), 0)))
    J = here.dense[:, others]
    lengths = np.linalg.norm(J, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    U, s, Vt = np.linalg.svd(J / lengths, full_matrices=False)
    seen = s > np.finfo(float).eps * max(J.shape) * s.max(initial=0.0)
    half = Vt[seen].T / s[seen] / lengths[:, None]
    along[others] = -half @ (U[:, seen].T @ here.dense[:, named])
    rest = np.zeros((len(x), half.shape[1]))
    rest[others] = half
    return _entries(problem.free, x, named, along, rest)


def movable(problem: Problem) -> Mask:
    """Which unknowns (n,) can be integrated out: bounds leave room, and no equation reads them."""
    free = problem.lower < problem.upper
    there = problem.stacked_constraints
    if there is not None and there.equal.any():
        pattern = there.function.jac_sparsity(0, 0)  # not its values: one may vanish here
        row, column = (np.array(part) for part in pattern.get_triplet())
        free[column[there.equal[row]]] = False
    return np.asarray(free)


def directions(count: int, priors: Iterable[str]) -> Choice:
    """The `count` directions about which the data say most, compared with the priors.

    The other directions are integrated out as a Gaussian. The directions solve
    J_d'J_d v = l (J'J) v with J_d the rows of the data, the largest l first. (Cui et al.,
    Likelihood-informed dimension reduction, 2014, have the priors' rows in the place of all rows
    J, which gives the same directions in the same order.) Directions are scaled to one standard
    deviation of Laplace's approximation, in which they are independent. The choice raises
    BadArgument for a count below 1 or above n, UnknownName for priors that are no residuals, and
    Improper where a direction has no width.
    """
    priors = tuple(priors)

    def choice(problem: Problem, x: Array, given: Array) -> Subspace:
        n, layout = problem.free.size, problem.free
        if not 0 < count <= n:
            raise BadArgument(f"1 to {n} directions can be sampled, not {count}")
        J = problem.linearize_at(x, given).dense
        svd_of_full_rank(J, lambda direction: _mostly(layout, direction))
        R = scipy.linalg.qr(J, mode="r")[0][:n]  # R'R = J'J
        R *= np.where(np.diag(R) < 0, -1.0, 1.0)[:, None]
        W = scipy.linalg.solve_triangular(R, np.eye(n))
        told = J[problem.rows_named(priors)] @ W
        share, Q = np.linalg.eigh(told.T @ told)  # of the priors, rising
        V = W @ Q
        V *= np.where(V[np.argmax(abs(V), axis=0), np.arange(n)] < 0, -1.0, 1.0)  # one of two signs
        labels = tuple(
            f"direction {i + 1} ({1 - share[i]:.0%} data; {_mostly(layout, V[:, i])})"
            for i in range(count)
        )
        return Subspace(x, V[:, :count], np.zeros(count), V[:, count:], labels, ("sd",) * count)

    return choice


def _entries(
    layout: Layout, x: Array, named: Index, along: Array, rest: Array | BandedRest
) -> Subspace:
    return Subspace(
        x,
        along,
        x[named].copy(),
        rest,
        tuple(layout.labels_of(named)),
        tuple(layout.unit(int(i)) for i in named),
        named,
    )


def svd_of_full_rank(J: Array, named: Callable[[Array], str]) -> tuple[Array, Array, Array]:
    """L (n,), s (n,) and V (n, n), where J (m, n) = U diag(s) V' diag(L) and L are column lengths.

    Raises Improper, which names the direction (n,) that is held least, if J has no full rank. That
    is judged with columns of length 1, so that no unit decides what is seen.
    """
    lengths = np.linalg.norm(J, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, found, Vt = np.linalg.svd(J / lengths, full_matrices=len(J) < J.shape[1])
    s = np.zeros(J.shape[1])
    s[: found.size] = found
    if (s <= np.finfo(float).eps * max(J.shape) * max(s.max(initial=0), 1e-300)).any():
        raise Improper(
            f"nothing holds {named(Vt[int(np.argmin(s))] / lengths)}: its posterior has no width. "
            "Add a prior or bounds, or fix it; `workbench diagnose` names all such directions"
        )
    return lengths, s, Vt.T


def _mostly(layout: Layout, direction: Array) -> str:
    """The two entries with most of a direction."""
    order = np.argsort(-abs(direction))[:2]
    large = [i for i in order if abs(direction[i]) > 0.3 * abs(direction[order[0]])]
    return ", ".join(layout.labels_of(large))


def banded_rest(here: Linearization, named: Index) -> tuple[Array, BandedRest] | None:
    """The ridge -H_bb^-1 H_ba in the rows of b, (n, k), and the spread of b about it; H = J'J.

    a are the `named` unknowns and b all others. None where H_bb is not definite enough.
    """
    n = here.shape[1]
    is_named = np.zeros(n, dtype=bool)
    is_named[named] = True
    others = here.scaled(np.where(is_named, 0.0, 1.0))
    normal = others.normal
    assert isinstance(normal, BandedMatrix)
    factor = normal.factorized(is_named.astype(float))  # a stands by itself, and stays zero
    if factor is None:
        return None
    own = np.zeros((n, len(named)))
    own[named, np.arange(len(named))] = 1.0
    along = here.jacobian @ own
    right = np.column_stack([others.jacobian.T @ column for column in along.T])
    return -factor.solve(right), BandedRest(factor, np.flatnonzero(~is_named))


def sampling_blocks(
    layout: Layout, trees: Iterable[Tree], most: int = 21
) -> dict[str, tuple[str, ...]]:
    """Parts of the unknowns by name, each small enough to be sampled.

    If there are few unknowns, all of them are one part. Otherwise the parts are `shape and place`,
    with everything but the pose, and with the root's rotation, and the limbs, which are chains of
    joints between two branchings.
    """
    if layout.size <= most:
        return {"all": layout.names}
    parts: dict[str, tuple[str, ...]] = {}
    trees = tuple(trees)
    poses = {name for tree in trees for name in tree.blocks if name in layout.names}
    others = [b.name for b in layout.blocks if b.name not in poses and b.size <= most]
    roots = [name for tree in trees for name in _of_joint(layout, tree, 0)]
    chosen: list[str] = []
    for name in (*others, *roots):
        if sum(len(places_named(layout, n)) for n in (*chosen, name)) <= most:
            chosen.append(name)
    if chosen:
        parts["shape and place" if poses else "the small blocks"] = tuple(chosen)
    for tree in trees:
        for limb in limbs(tree):
            joints = [k for k in limb if tree.entries(k, layout)][: most // 3]
            if joints:
                names = [tree.names[k] for k in joints]
                parts[f"{names[0]} to {names[-1]}" if len(names) > 1 else names[0]] = tuple(
                    name for k in joints for name in _of_joint(layout, tree, k)
                )
    return parts


def _of_joint(layout: Layout, tree: Tree, joint: int) -> list[str]:
    """The names of a joint's free numbers: of their row, or one by one."""
    at = tree.entries(joint, layout)
    labels = layout.labels_of(at)
    rows = {label.rpartition(", ")[0] for label in labels}
    return [f"{rows.pop()}]"] if len(at) == 3 and len(rows) == 1 and "" not in rows else labels


def limbs(tree: Tree) -> list[list[int]]:
    """Joints in a row, each the only child of the one before; the root is in none."""
    rows: list[list[int]] = []
    for k, parent in enumerate(tree.parents):
        if parent < 0:
            continue
        if parent > 0 and len(tree.children(parent)) == 1:
            next(row for row in rows if row[-1] == parent).append(k)
        else:
            rows.append([k])
    return rows
