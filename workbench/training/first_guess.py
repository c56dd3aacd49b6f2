"""What training starts from: a template that is divided into segments."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.validation import check_tree
from workbench.environment import expanded
from workbench.errors import BadBody, BadFile, BadMesh
from workbench.geometry.meshes import Mesh
from workbench.geometry.mirror import Mirror, find_mirror, opposite, opposites
from workbench.geometry.rigid import procrustes
from workbench.geometry.solids import heat, mesh_edges
from workbench.reading.arrays import opened, read_expected, reals, taken_for, texts, wholes
from workbench.training.estimate import Estimate
from workbench.training.execution import SERIAL, Execution
from workbench.training.poses import fitted_poses, poses_of_segments
from workbench.training.registrations import FARTHEST, Registrations, batches
from workbench.training.shares import MOST_WEIGHTS, at_most, shares
from workbench.training.subsampling import subsample
from workbench.writing import write_arrays

FIRST_STEPS = 5  # of the first fit of a pose
FIRST_SIGMA = 0.005  # m, of an edge on a template of somebody else
RIGID_SIGMA = 0.01  # m: how far a segment is from rigid
RING_SIGMA = 0.05  # m: how far the middle of a ring is from the joint
MOST_AVERAGED = 80  # vertices that a joint is a mean of
BORDER = 0.03  # m: the width of the blurred border between two segments
START_ARRAYS = {
    "template": reals("N", 3),
    "faces": wholes("F", 3),
    "parents": wholes("K"),
    "joint_names": texts("K"),
    "segmentation": wholes("N"),
}


@dataclass(frozen=True, eq=False)
class Start:
    """A template, the tree of its joints, and its segments. Raises BadBody.

    Attributes:
        template: (N, 3) in metres, y up, facing +z, left = +x.
        faces: (F, 3) the triangles.
        parents: the parent of each of K joints.
        joint_names: their names.
        segmentation: (N,) the number of the joint that moves each vertex most.
    """

    template: Array
    faces: Index
    parents: tuple[int, ...]
    joint_names: tuple[str, ...]
    segmentation: Index

    def __post_init__(self) -> None:
        check_tree(_refuse, self.parents)
        if self.template.dtype.kind != "f":
            _refuse("the template holds what are no real numbers")
        try:
            if not len(Mesh.of(self.template, self.faces).faces):
                _refuse("the template has no faces")
        except BadMesh as error:
            _refuse(f"the template is no mesh: {error}")
        if abs(self.template).max() > FARTHEST:
            far = abs(self.template).max()
            _refuse(f"the template reaches {far:.3g} m far; metres are expected")
        self._check_names()
        K, N = len(self.parents), len(self.template)
        if self.segmentation.shape != (N,) or self.segmentation.dtype.kind not in "iu":
            _refuse(
                f"the segmentation holds {self.segmentation.dtype} of shape "
                f"{self.segmentation.shape}, but must say a joint's number for each of {N} vertices"
            )
        if not 0 <= self.segmentation.min() <= self.segmentation.max() < K:
            _refuse(f"the segmentation names joints beyond 0 to {K - 1}")
        for k in set(range(K)) - set(self.segmentation.tolist()):
            _refuse(
                f"no vertex belongs to {self.joint_names[k]}; its turns would not be seen. Give "
                "it a segment, or leave the joint out"
            )

    def _check_names(self) -> None:
        names = self.joint_names
        if not len(names) == len(set(names)) == len(self.parents):
            _refuse(f"{len(self.parents)} joints must have as many different names, not {names}")
        for name in names:
            if opposite(name) not in names:
                _refuse(
                    f"{name} has no opposite called {opposite(name)}; add that joint, or call this "
                    "one something that does not begin with left_ or right_"
                )

    @staticmethod
    def of(body: SkinnedBody) -> "Start":
        """The start of a body: the segment of a vertex is that of its largest weight.

        A joint that has the largest weight of no vertex gets the vertex where its weight is
        largest.
        """
        carrier = body.weights.argmax(axis=1)
        for k in set(range(len(body.parents))) - set(carrier.tolist()):
            if body.weights[:, k].any():
                carrier[body.weights[:, k].argmax()] = k
        return Start(body.template, body.faces, body.parents, body.joint_names, carrier)

    def mirror(self) -> Mirror | None:
        """The vertices and joints on the other side; None if no joint has a side.

        Raises NoMirror, or BadBody if a vertex of a left segment lies opposite to another's.
        """
        joints = opposites(self.joint_names)
        if np.array_equal(joints, np.arange(len(joints))):
            return None
        mirror = Mirror(find_mirror(self.template, self.faces), joints)
        agree = joints[self.segmentation] == self.segmentation[mirror.vertices]
        if agree.mean() < 0.9:
            raise BadBody(
                f"{1 - agree.mean():.0%} of the vertices lie opposite to a segment of another "
                "name; are left (+x) and right exchanged in the segmentation?"
            )
        return mirror

    def weights(self, border: float = BORDER) -> Array:
        """The initial weights W_I (N, K): the segmentation after heat has diffused `border` metres.

        Each vertex keeps its four largest weights.
        """
        segments = np.eye(len(self.parents))[self.segmentation]
        warm = heat(self.template, self.faces, border).solve(segments)
        return at_most(warm.clip(0), MOST_WEIGHTS)

    def rings(self) -> csr_array:
        """The mean of the vertices where two segments meet, (K, N): a first guess of the joints.

        The root's row is the mean of its children's rows. Where a segment does not touch its
        parent's, its row has the vertices of either that are closest to the other.
        """
        K, N = len(self.parents), len(self.template)
        edges = mesh_edges(self.faces)
        rows = np.zeros((K, N))
        for k, parent in enumerate(self.parents[1:], start=1):
            ends = self.segmentation[edges]
            across = (np.sort(ends, axis=1) == sorted((k, parent))).all(axis=1)
            ring = np.unique(edges[across])
            rows[k, ring if len(ring) else self._closest(k, parent)] = 1
        rows /= rows.sum(axis=1, keepdims=True).clip(1)
        children = [k for k, parent in enumerate(self.parents) if parent == 0]
        rows[0] = rows[children].mean(axis=0) if children else 1 / N
        return csr_array(rows)

    def _closest(self, k: int, parent: int) -> Index:
        own, other = (np.flatnonzero(self.segmentation == s) for s in (k, parent))
        gaps = np.linalg.norm(self.template[own, None] - self.template[other], axis=2)
        near = np.argwhere(gaps <= np.quantile(gaps, min(1.0, 4 / gaps.size)))
        return np.unique(np.concatenate([own[near[:, 0]], other[near[:, 1]]]))


def _refuse(reason: str) -> NoReturn:
    raise BadBody(reason)


def read_start(name: str | Path) -> Start:
    """Read a start from an .npz, or make that of a body from its name or file.

    The .npz holds template (N, 3) m, faces (F, 3), parents (K,), joint_names (K,) and
    segmentation (N,). Raises BadFile or BadBody.
    """
    path = expanded(name)
    if not path.is_file() or path.suffix != ".npz":
        return Start.of(load_skinned(name))
    what = "start for training", "write it with write_start, or give an embedded body"
    with opened(path, *what) as archive:
        arrays = read_expected(archive, START_ARRAYS) if "segmentation" in archive.headers else None
    if arrays is None:
        return Start.of(load_skinned(path))
    with taken_for(path, *what):
        try:
            parents = tuple(arrays.pop("parents").tolist())
            names = tuple(map(str, arrays.pop("joint_names")))
            return Start(parents=parents, joint_names=names, **arrays)
        except BadBody as error:
            raise BadFile(str(error)) from error


def write_start(start: Start, path: Path) -> None:
    """Write a start as an .npz that `read_start` reads."""
    write_arrays(path, {name: np.asarray(getattr(start, name)) for name in START_ARRAYS})


def first_estimate(
    registrations: Registrations, start: Start, *, weights: Array, rings: csr_array
) -> Estimate:
    """The estimate in which every subject is the template, in the zero pose."""
    S = int(registrations.subject.max()) + 1
    K, N = len(start.parents), len(start.template)
    return Estimate(
        templates=np.repeat(start.template[None], S, axis=0),
        joints=np.repeat((rings @ start.template)[None], S, axis=0),
        posedirs=np.zeros((N, 3, 9 * (K - 1))),
        weights=weights,
        poses=np.zeros((len(registrations.subject), K, 3)),
        parents=start.parents,
    )


def first_poses(
    first: Estimate,
    registrations: Registrations,
    start: Start,
    execution: Execution = SERIAL,
    *,
    by_edges: bool = True,
) -> Estimate:
    """Poses by turning each segment onto its vertices, then by fitting edges of the template.

    Edges ignore where the body stands, and distinguish a bent knee from a long shin better than
    vertices do, which may take their place.
    """
    few = subsample(start.template, start.faces)
    registrations, sparse = few.registrations(registrations), few.estimate(first)
    poses = first.poses.copy()
    template, weights = start.template[few.vertices], sparse.weights
    for batch in batches(registrations):
        for j, (V, confidence) in enumerate(zip(batch.vertices, batch.trust, strict=True)):
            guess = poses_of_segments(template, weights, start.parents, V, confidence)
            poses[batch.some.start + j] = guess
    execution = replace(execution, task="first poses")
    turned = replace(sparse, poses=poses)
    fitted = fitted_poses(
        turned,
        registrations,
        few.faces,
        FIRST_SIGMA,
        FIRST_STEPS,
        by_edges=by_edges,
        execution=execution,
    )
    return replace(first, poses=fitted.poses)


def motions_of_segments(
    start: Start, weights: Array, registrations: Registrations
) -> tuple[Array, Array]:
    """The rotations (J, K, 3, 3) and translations (J, K, 3) m that take each segment of the
    template to its vertices in each registration.
    """
    J, K = len(registrations.subject), len(start.parents)
    R, t = np.empty((J, K, 3, 3)), np.empty((J, K, 3))
    for batch in batches(registrations):
        for j, (V, confidence) in enumerate(zip(batch.vertices, batch.trust, strict=True)):
            for k, trusted in enumerate(weights.T * confidence + 1e-9 * confidence):
                motion = procrustes(start.template, V, trusted)
                R[batch.some.start + j, k], t[batch.some.start + j, k] = motion.R, motion.t
    return R, t


def rotation_centres(
    R: Array, t: Array, subject: Index, parents: tuple[int, ...], rings: Array
) -> Array:
    """Joints (K, 3) m on the template, as means over all subjects.

    `R` and `t` are the motions of the segments, and `rings` (K, 3) m the means of the joints'
    priors.
    """
    joints = rings.copy()
    prior = (RIGID_SIGMA / RING_SIGMA) * np.eye(6)
    for k, parent in enumerate(parents[1:], start=1):
        rings_twice = np.tile(rings[k], 2)
        centres = []
        for s in np.unique(subject):
            own = subject == s
            A = np.concatenate([R[own, parent], -R[own, k]], axis=2).reshape(-1, 6)
            gap = (t[own, k] - t[own, parent]).ravel() - A @ rings_twice
            step = np.linalg.solve(A.T @ A + prior.T @ prior, A.T @ gap)
            centres.append(rings[k] + step.reshape(2, 3).mean(axis=0))
        joints[k] = np.mean(centres, axis=0)
    return joints


def means_at(template: Array, points: Array) -> csr_array:
    """Rows (K, N) of shares, as even as possible, that give the points (K, 3) on the template.

    A point outside of the convex hull of the vertices nearest to it is approximated.
    """
    rows = np.zeros((len(points), len(template)))
    for k, point in enumerate(points):
        near = np.argsort(np.linalg.norm(template - point, axis=1), kind="stable")[:MOST_AVERAGED]
        away = template[near] - point
        gram = away @ away.T + 1e-6 * np.eye(len(near))  # m^2: evenness decides among exact ones
        first = np.full(len(near), 1 / len(near))
        rows[k, near] = shares(gram, np.zeros(len(near)), first)
    return csr_array(rows)


def joint_guess(start: Start, weights: Array, registrations: Registrations) -> csr_array:
    """The first guess of the joint regressor (K, N), which E_J uses until one is learned."""
    middles = start.rings() @ start.template
    R, t = motions_of_segments(start, weights, registrations)
    centres = rotation_centres(R, t, registrations.subject, start.parents, middles)
    return means_at(start.template, centres)
