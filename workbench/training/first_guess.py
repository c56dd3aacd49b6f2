"""What training starts from: a template cut into segments, and what follows from that alone."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.bodies.npz_files import read_npz
from workbench.errors import BadBody, BadFile, listed
from workbench.training.mesh_graph import edges_of, find_mirror, heat
from workbench.training.mirror import Mirror, opposites
from workbench.writing import replacing

Array = NDArray[np.float64]
Index = NDArray[np.int64]
MOST_WEIGHTS = 4  # joints that carry one vertex
SPREAD = 0.03  # m: how far the border between two segments is blurred


@dataclass(frozen=True, eq=False)
class Start:
    """A template, its tree, and the joint that carries each vertex. Raises BadBody."""

    template: Array  # (N, 3) m, y up, facing +z, left = +x
    faces: Index  # (F, 3)
    parents: tuple[int, ...]
    joint_names: tuple[str, ...]
    segmentation: Index  # (N,): a joint's number for each vertex

    def __post_init__(self) -> None:
        K, N = len(self.parents), len(self.template)
        if self.segmentation.shape != (N,):
            raise BadBody(
                f"the segmentation has shape {self.segmentation.shape}, but there are {N} vertices"
            )
        if not 0 <= self.segmentation.min() <= self.segmentation.max() < K:
            raise BadBody(f"the segmentation names joints beyond 0 to {K - 1}")
        for k in set(range(K)) - set(self.segmentation.tolist()):
            raise BadBody(
                f"no vertex belongs to {self.joint_names[k]}; its turns would not be seen. Give "
                "it a segment, or leave the joint out"
            )

    @staticmethod
    def of(body: SkinnedBody) -> "Start":
        """A body's template and tree; each vertex goes with the joint that carries it most.

        A joint that carries no vertex most has the one of which it carries the largest share.
        """
        carrier = body.weights.argmax(axis=1)
        for k in set(range(len(body.parents))) - set(carrier.tolist()):
            if body.weights[:, k].any():
                carrier[body.weights[:, k].argmax()] = k
        return Start(body.template, body.faces, body.parents, body.joint_names, carrier)

    def mirror(self) -> Mirror | None:
        """Vertices and joints on the other side; None if no joint has a side.

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

    def weights(self, spread: float = SPREAD) -> Array:
        """W_I (N, K): the segmentation after heat has spread about so many metres, cut to four."""
        segments = np.eye(len(self.parents))[self.segmentation]
        warm = heat(self.template, self.faces, spread).solve(segments)
        return at_most(warm.clip(0), MOST_WEIGHTS)

    def rings(self) -> csr_array:
        """Where two segments meet, in the mean: (K, N), the joint's first guess (E_J).

        The root's is the mean of its children's rings; where a segment does not touch its
        parent's, the vertices of either that are closest to the other's.
        """
        K, N = len(self.parents), len(self.template)
        edges = edges_of(self.faces)
        rows = np.zeros((K, N))
        for k, parent in enumerate(self.parents[1:], start=1):
            ends = self.segmentation[edges]
            across = ((ends == [k, parent]) | (ends == [parent, k])).all(axis=1)
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


def at_most(weights: Array, most: int) -> Array:
    """The largest shares of each row, summing to one."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :most]
    kept = np.zeros_like(weights)
    np.put_along_axis(kept, order, np.take_along_axis(weights, order, axis=1), axis=1)
    kept[kept < 1e-4 * kept.max(axis=1, keepdims=True)] = 0
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))


def read_start(name: str | Path) -> Start:
    """The start in an .npz of yours, or that of a body by its name or file.

    The .npz holds template (N, 3) m, faces (F, 3), parents (K,), joint_names (K,) and
    segmentation (N,). Raises BadFile or BadBody.
    """
    path = Path(name).expanduser()
    if not path.is_file() or path.suffix != ".npz":
        return Start.of(load_body(name))
    arrays = read_npz(path)
    if "segmentation" not in arrays:
        return Start.of(load_body(path))
    missing = {"template", "faces", "parents", "joint_names"} - arrays.keys()
    if missing:
        raise BadFile(f"{path} is no start for training: {listed(missing)} missing")
    try:
        return Start(
            np.asarray(arrays["template"], dtype=np.float64),
            np.asarray(arrays["faces"], dtype=np.int64),
            tuple(map(int, np.asarray(arrays["parents"]))),
            tuple(map(str, np.asarray(arrays["joint_names"]))),
            np.asarray(arrays["segmentation"], dtype=np.int64),
        )
    except (TypeError, ValueError) as error:
        raise BadFile(f"{path} is no start for training: {error}") from error


def write_start(start: Start, path: Path) -> None:
    """As `read_start` reads it."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            template=start.template,
            faces=start.faces,
            parents=np.array(start.parents),
            joint_names=np.array(start.joint_names),
            segmentation=start.segmentation,
        )
