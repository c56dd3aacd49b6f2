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

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout, Tree
from workbench.blocks.layout import entries, places_named
from workbench.errors import WorkbenchError
from workbench.problem import Linearization, Problem

MOST = 21  # numbers that ensembles sample well together


class Improper(WorkbenchError):
    """A direction that neither data nor priors nor bounds hold: its posterior has no width."""


@dataclass(frozen=True, eq=False)
class Subspace:
    """x(z, w) = origin + along (z - centre) + rest w, for n free numbers x, of which z is sampled.

    z (k,) are named entries. w (c,) is standard normal and stands for what is integrated out; see
    the module.
    """

    origin: Array  # (n,) the point at z = centre and w = 0
    along: Array  # (n, k) how the unknowns move with z
    centre: Array  # (k,) z at the origin
    rest: Array  # (n, c) how the unknowns move with w
    labels: tuple[str, ...]  # a name for each entry of z
    units: tuple[str, ...]  # the unit of each entry of z
    entries: Index  # the places of z among the unknowns

    @property
    def size(self) -> int:
        """k, the number of entries of z."""
        return len(self.centre)

    def of_columns(self, at: Index) -> "Subspace":
        """With the entries of z at some places (m,) alone; the others no longer move."""
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
        """(n, k + c) all directions in which points of the subspace lie."""
        return np.hstack([self.along, self.rest])

    @cached_property
    def entries_only(self) -> bool:
        """Whether all else than z stays where it is."""
        moves = self.rest.shape[1] or np.delete(self.along, self.entries, axis=0).any()
        return not moves

    def points(self, z: Array, w: Array | None = None) -> Array:
        """x (M, n) for z (M, k), and w (M, c) if it is not to be zero."""
        if self.entries_only:
            x = np.repeat(self.origin[None], len(z), axis=0)
        else:
            x = self.origin + (z - self.centre) @ self.along.T
        x[:, self.entries] = z  # and not their sum with the origin, to the last bit
        return x if w is None else x + w @ self.rest.T


Rest = Callable[[Problem, Linearization, Array, Index], Subspace]
Names = str | Iterable[str] | None


def subspace_of(
    problem: Problem, x: Array, fixed_values: Array, names: Names, rest: Rest
) -> Subspace:
    """The subspace to sample, by names (all that are free if None) and what becomes of the rest."""
    sampled = entries(problem.free, problem.free.names if names is None else names)
    return rest(problem, problem.linearize_at(x, fixed_values), x, sampled)


def fixed(problem: Problem, here: Linearization, x: Array, named: Index) -> Subspace:
    """All numbers that are not named are held fixed."""
    along = np.zeros((len(x), len(named)))
    along[named, np.arange(len(named))] = 1.0
    return _entries(problem.free, x, named, along, np.empty((len(x), 0)))


def integrated(problem: Problem, here: Linearization, x: Array, named: Index) -> Subspace:
    """What is not named is integrated out by Laplace's approximation of it; see the module.

    Three kinds of numbers stay where they are: those with equal bounds, those that equations among
    the constraints read, and directions of the rest that change no residual, which therefore say
    nothing about what is named.
    """
    others = np.setdiff1d(np.flatnonzero(movable(problem)), named)
    along = fixed(problem, here, x, named).along
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
    constraints = problem.stacked_constraints
    if constraints is not None and constraints.equal.any():
        pattern = constraints.function.jac_sparsity(0, 0)  # not its values: one may vanish here
        row, column = (np.array(part) for part in pattern.get_triplet())
        free[column[constraints.equal[row]]] = False
    return np.asarray(free)


def _entries(layout: Layout, x: Array, named: Index, along: Array, rest: Array) -> Subspace:
    return Subspace(
        x,
        along,
        x[named].copy(),
        rest,
        tuple(layout.labels_of(named)),
        tuple(layout.unit(int(i)) for i in named),
        named,
    )


def sampling_blocks(layout: Layout, trees: Iterable[Tree]) -> dict[str, tuple[str, ...]]:
    """Parts of the unknowns by name, of at most 21 numbers each.

    If there are few unknowns, all of them are one part. Otherwise the parts are `shape and place`,
    with everything but the pose and with the root's rotation, and seven joints after seven.
    """
    if layout.size <= MOST:
        return {"all": layout.names}
    parts: dict[str, tuple[str, ...]] = {}
    trees = tuple(trees)
    poses = {name for tree in trees for name in tree.blocks}
    others = [b.name for b in layout.blocks if b.name not in poses and b.size <= MOST]
    roots = [name for tree in trees for name in _of_joint(layout, tree, 0)]
    chosen: list[str] = []
    for name in (*others, *roots):
        if sum(len(places_named(layout, n)) for n in (*chosen, name)) <= MOST:
            chosen.append(name)
    if chosen:
        parts["shape and place" if poses else "the small blocks"] = tuple(chosen)
    for tree in trees:
        joints = [k for k in range(1, len(tree.names)) if tree.entries(k, layout)]
        for part in (joints[i : i + MOST // 3] for i in range(0, len(joints), MOST // 3)):
            names = [tree.names[k] for k in part]
            parts[f"{names[0]} to {names[-1]}" if len(names) > 1 else names[0]] = tuple(
                name for k in part for name in _of_joint(layout, tree, k)
            )
    return parts


def _of_joint(layout: Layout, tree: Tree, joint: int) -> list[str]:
    """The names of a joint's free numbers: of their row, or one by one."""
    places = tree.entries(joint, layout)
    labels = layout.labels_of(places)
    rows = {label.rpartition(", ")[0] for label in labels}
    return [f"{rows.pop()}]"] if len(places) == 3 and len(rows) == 1 and "" not in rows else labels
