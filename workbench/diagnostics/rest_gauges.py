"""Changes of a body at rest that no registration of it can tell: the gauges of training.

Where the arrays of a body are unknown together with the poses and places of its registrations,
some of their changes cancel exactly:

shift    a subject's template and joints move by t, and every place by -t
root     the root joint moves by t, and a place by -(I - R_0) t, the pose of the root being R_0
turn     everything at rest turns by Q, about the origin, and everybody's root turns back: templates
         and joints become Q T and Q J, rotations of joints Q R_k Q', that of the root R_0 Q', and
         pose blend shapes P(R) become Q P(Q' R Q)
axis     blend shapes of a joint push the whole surface along the axis of the joint's rotation,
         which the rotation leaves as it is, and the places undo it; where only the root carries
         the joint, and no other joint moves the surface

The first two are known to be gauges of SMPL's training in that the data do not determine the root
joint; Loper et al. (SMPL, 2015, section 4.1) keep joints near the rings between segments.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.blocks.tree import Rest
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.problem import Problem

LEVI_CIVITA = np.array(
    [[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)]
)


def rest_gauges(problem: Problem, values: Mapping[str, Array]) -> Iterator[NamedSubspace]:
    """The subspaces in which the gauges of a problem lie, at the values of its blocks."""
    free = problem.free
    found = (getattr(points.source, "rest", None) for points in problem.points)
    rests = [rest for rest in found if rest is not None]
    subjects: dict[tuple[str | None, str | None], list[Rest]] = {}
    for rest in rests:
        subjects.setdefault((rest.template, rest.joints), []).append(rest)
    for scans in subjects.values():
        yield from _shift(free, scans)
        yield from _root(free, scans)
    families: dict[str | None, list[Rest]] = {}
    for rest in rests:
        shared = rest.posedirs if rest.posedirs in free.slices else f"{rest.template} {rest.joints}"
        families.setdefault(shared, []).append(rest)
    for scans in families.values():
        yield from _turn(free, scans, values)
        yield from _axes(free, scans, values)


def _shift(free: Layout, scans: Sequence[Rest]) -> Iterator[NamedSubspace]:
    """All at rest that is free moves by the same, and every place moves back."""
    names = [n for n in (scans[0].template, scans[0].joints) if n in free.slices]
    if names and (places := _places(free, scans)) is not None:
        entries = np.concatenate([_entries(free, name) for name in names])
        uniform = np.tile(np.eye(3), (len(entries) // 3, 1)) / np.sqrt(len(entries) / 3)
        said = f"a shift of {' and '.join(names)}, undone by {_listed(scans)}"
        yield _with_places("shift", said, entries, uniform, places)


def _root(free: Layout, scans: Sequence[Rest]) -> Iterator[NamedSubspace]:
    """The root joint moves, and each translation compensates what rotations about it have moved."""
    joints = scans[0].joints
    if joints in free.slices and (places := _places(free, scans)) is not None:
        root = _entries(free, joints)[:3]
        for a, axis in enumerate("xyz"):
            said = f"{joints}[root] along {axis}, undone by {_listed(scans)}"
            yield _with_places("gauge", said, root[a : a + 1], np.eye(1), places)


def _turn(
    free: Layout, scans: Sequence[Rest], values: Mapping[str, Array]
) -> Iterator[NamedSubspace]:
    """All at rest turns about the origin, and every root turns it back."""
    moved = {n for rest in scans for n in (rest.template, rest.joints, rest.posedirs, rest.pose)}
    names = [name for name in free.names if name in moved]
    templates = {rest.template for rest in scans} - {None}
    if not templates or not templates <= set(names) or (places := _places(free, scans)) is None:
        return
    poses = {rest.pose for rest in scans}
    shapes = {rest.posedirs for rest in scans}
    entries = np.concatenate([_entries(free, name) for name in names])
    for a, axis in enumerate("xyz"):
        omega = np.eye(3)[a]
        parts = []
        for name in names:
            if name in poses:
                parts.append(_turned_pose(values[name], omega))
            elif name in shapes:
                parts.append(_turned_posedirs(values[name], omega))
            else:
                parts.append(np.cross(omega, values[name]))
        column = np.concatenate([part.ravel() for part in parts])
        said = f"a turn of everything at rest about {axis}, undone by the rotation of every root"
        basis = column[:, None] / np.linalg.norm(column)
        yield _with_places("gauge", said, entries, basis, places)


def _turned_pose(pose: Array, omega: Array) -> Array:
    """How rotation vectors (K, 3) change with a turn of the rest: Q R_k Q', and R_0 Q'."""
    change = np.cross(omega, pose)
    change[0] = -np.linalg.solve(_right_jacobian(pose[0]), omega)
    return change


def _right_jacobian(theta: Array) -> Array:
    """J with exp(theta + d) = exp(theta) exp(J d) to first order, (3, 3)."""
    t, W = float(np.linalg.norm(theta)), _hat(theta)
    if t < 1e-6:
        return np.eye(3) - W / 2
    return np.asarray(np.eye(3) - (1 - np.cos(t)) / t**2 * W + (t - np.sin(t)) / t**3 * W @ W)


def _hat(v: Array) -> Array:
    """The matrix [v] of x -> v x x."""
    return np.cross(np.eye(3), v)


def _turned_posedirs(posedirs: Array, omega: Array) -> Array:
    """How P (N, 3, 9 (K - 1)) changes: w x P(M) - P([w] M - M [w]), M being a rotation less I."""
    W = _hat(omega)
    P = posedirs.reshape(*posedirs.shape[:2], -1, 3, 3)
    change = np.einsum("ab,nbkrc->nakrc", W, P)
    change -= np.einsum("nakrc,rq->nakqc", P, W) - np.einsum("nakrc,qc->nakrq", P, W)
    return np.asarray(change.reshape(posedirs.shape))


def _axes(
    free: Layout, scans: Sequence[Rest], values: Mapping[str, Array]
) -> Iterator[NamedSubspace]:
    """Blend shapes of the only joint push the whole surface along the axis of its rotation."""
    name = scans[0].posedirs
    if name not in free.slices or values[name].shape[2] != 9:
        return
    if (places := _places(free, scans)) is None:
        return
    count = len(values[name])
    eye = np.eye(3)
    # d(M) = (tr(M) I - M - M') c is along the axis for every c, and so is d(M) = vee(M - M')
    along = np.einsum("rs,ac->cars", eye, eye) - np.einsum("ra,sc->cars", eye, eye)
    along -= np.einsum("rc,sa->cars", eye, eye)
    pushes = {f"(1 - cos) times the axis's {axis}": along[c] for c, axis in enumerate("xyz")}
    pushes["sin"] = LEVI_CIVITA
    for how, push in pushes.items():
        column = np.tile(push.ravel(), count)[:, None]
        push_of = f"{name} that push the whole surface along the joint's axis by {how}"
        said = f"{push_of}, undone by every translation"
        basis = column / np.linalg.norm(column)
        yield _with_places("gauge", said, _entries(free, name), basis, places)


def _with_places(
    kind: str, name: str, entries: Index, basis: Array, places: Index
) -> NamedSubspace:
    """The columns of a basis at these entries, together with every move of the places."""
    whole = np.zeros((len(entries) + len(places), basis.shape[1] + len(places)))
    whole[: len(entries), : basis.shape[1]] = basis
    whole[len(entries) :, basis.shape[1] :] = np.eye(len(places))
    return NamedSubspace(kind, name, (), np.concatenate([entries, places]), whole)


def _places(free: Layout, scans: Sequence[Rest]) -> Index | None:
    """The entries of the translations of all registrations; None unless all of them are free."""
    names = dict.fromkeys(rest.trans for rest in scans)
    if any(name not in free.slices for name in names):
        return None
    return np.concatenate([_entries(free, name) for name in names])


def _entries(free: Layout, name: str) -> Index:
    part = free.slices[name]
    return np.arange(part.start, part.stop)


def _listed(scans: Sequence[Rest]) -> str:
    """`scan 0/trans, scan 1/trans and 4 others`."""
    names = list(dict.fromkeys(rest.trans for rest in scans))
    if len(names) < 4:
        return " and ".join(names)
    return f"{names[0]}, {names[1]} and {len(names) - 2} others"
