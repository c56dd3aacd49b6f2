"""Compiled arithmetic of surfaces and of kinematics: loaded, tried against NumPy, and called.

The functions of `c_functions.py` are written as C with loops around them, compiled once for a tree
and a number of betas, and kept on disk. The numbers of a library are compared with NumPy's before
it is used. Without a compiler, or if anything fails, NumPy does the same work, and the log says
why.

Vertices are packed in groups of as many as the processor takes side by side. Most joints leave a
vertex alone: each group has lists of the joints that do not, and the posedirs of these joints only.
What limits a posed surface is reading its directions. Those of an embedded body are whole multiples
of one step, and those of many files are single precision: four bytes hold each of them, and the
processor makes eight of them again in its registers, the same to the bit.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Mask
from workbench.bodies.forward.c_functions import joint_source, mesh_source
from workbench.bodies.forward.kinematics import Skeleton, ancestors
from workbench.bodies.forward.mesh import NumpyMesh, chunks_of
from workbench.bodies.forward.motion import (
    JointMotion,
    Kinematics,
    MotionDerivatives,
    PointsAtMotion,
)
from workbench.bodies.forward.named_points import Rows, RowTarget
from workbench.bodies.forward.posing import world_rotations
from workbench.compiling import (
    NoLibrary,
    address,
    aligned_zeros,
    function_of_addresses,
    library,
    library_or_none,
)
from workbench.errors import NotSupported
from workbench.geometry.rotation import matrix_from_vector

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

LOG = logging.getLogger(__name__)
MESH, JOINTS = "mesh", "joints"  # the names of libraries
ROLES = ("pose", "betas", "trans")
FLAGS = ("-O3",)  # a quarter less time than with -O2, and the same numbers
# how many arguments their functions take
OF_MESH = {"points": 4, "write_jacobian": 9, "vjp": 5}
OF_JOINTS = {"motions": 5, "derivatives": 5}

N_TRIED = 11  # vertices: all lanes full at least once, and some that are left over
TRIED_SHARE = 0.1  # of its joints that have a weight on, and posedirs for, each of them
TRIED_STEP = 1e-3  # of the directions that are tried in single precision
NEAR_ZERO = 1e-3  # rad: so near to zero, rotations are series


Scalar = TypeVar("Scalar", bound=np.generic)


PACKED_AT_ONCE = 1024  # vertices at a time, so that packing needs little memory beside the result
WORTH_NARROWING = 4e6  # bytes: below, making doubles costs more than reading them (measured)
SAMPLE = 100_000  # numbers from which a step is guessed
COMPARED_AT_ONCE = 2**16  # numbers that are compared at a time


class Packing(NamedTuple):
    """How shapedirs and posedirs are stored: each number is what is stored, times a step.

    Attributes:
        single: whether single precision holds them; then it holds them exactly.
        steps: those of shapedirs and of posedirs.
    """

    single: bool = False
    steps: tuple[float, float] = (1.0, 1.0)

    @staticmethod
    def of(body: SkinnedBody) -> Packing:
        """The packing that takes the least time: none where a cache holds the directions."""
        arrays = body.shapedirs, body.posedirs
        if 8 * (arrays[0].size + np.count_nonzero(arrays[1])) < WORTH_NARROWING:
            return Packing()
        whole_steps = whole_step(arrays[0]), whole_step(arrays[1])
        for steps in (whole_steps, (1.0, 1.0)):
            if all(is_exact(array, step) for array, step in zip(arrays, steps, strict=True)):
                return Packing(True, steps)
        return Packing()

    @property
    def dtype(self) -> type[np.floating[Any]]:
        """The type of what is stored."""
        return np.float32 if self.single else np.float64

    def stored(self, array: Array, step: float) -> NDArray[Any]:
        """What is stored of the numbers of an array."""
        return (array if step == 1 else np.rint(array / step)).astype(self.dtype)


def whole_step(array: Array) -> float:
    """The step of which all entries seem to be whole multiples: the smallest gap in a sample."""
    entries = array[array != 0]
    sample = entries[np.linspace(0, entries.size - 1, min(entries.size, SAMPLE)).astype(np.int64)]
    distances = np.diff(np.unique(np.abs(sample)), prepend=0.0)
    return float(f"{distances.min(initial=1.0):.6g}") or 1.0


def is_exact(array: Array, step: float) -> bool:
    """Whether single precision times the step gives the numbers of an array, to the bit."""
    packing, flat = Packing(True), array.ravel()
    pieces = (flat[i : i + COMPARED_AT_ONCE] for i in range(0, flat.size, COMPARED_AT_ONCE))
    with np.errstate(over="ignore"):  # what is too large becomes infinite, which is not equal
        return all(
            np.array_equal(packing.stored(part, step) * np.float64(step), part) for part in pieces
        )


@dataclass(frozen=True, eq=False)
class PackedVertices:
    """N vertices of a surface with K joints and B betas, in groups; `mesh.c` reads them.

    Every array begins at an address that is a multiple of 64.

    Attributes:
        count: N, the number of vertices.
        sizes: K and B.
        vertices: (groups, 3 + K, lanes), template and weights.
        shapes: (groups, 3 B, lanes), as they are stored.
        posedirs: (., 27, lanes), as they are stored, for each group and each joint that has some.
        steps: (2,) by which the stored shapes and posedirs are multiplied.
        joints: for each group three lists, each after its length: the joints that have a weight on
            it, that have posedirs, and that have a weight on it at or below them.
    """

    count: int
    sizes: tuple[int, int]
    vertices: Array
    shapes: NDArray[Any]
    posedirs: NDArray[Any]
    steps: Array
    joints: NDArray[np.intp]

    @staticmethod
    def of(
        arrays: SkinnedBody,
        parents: Sequence[int],
        vertices: slice | list[int],
        lanes: int,
        packing: Packing,
    ) -> PackedVertices:
        """Some vertices of a surface on this tree, in order."""
        chosen = np.arange(len(arrays.template))[vertices]
        K, B, N = arrays.weights.shape[1], arrays.shapedirs.shape[2], len(chosen)
        groups, (shape_step, pose_step) = -(-N // lanes), packing.steps
        packed = aligned_zeros((groups, 3 + K, lanes), np.float64)
        shapes = aligned_zeros((groups, 3 * B, lanes), packing.dtype)
        weighted, corrected = np.zeros((groups, K), dtype=bool), np.zeros((groups, K), dtype=bool)
        pieces = []
        for start in range(0, N, PACKED_AT_ONCE):
            chunk = chosen[start : start + PACKED_AT_ONCE]
            rows = slice(start // lanes, start // lanes + -(-len(chunk) // lanes))
            pieces.append((chunk, rows))
            of_vertex = np.concatenate([arrays.template[chunk].T, arrays.weights[chunk].T])
            packed[rows] = _grouped(of_vertex, lanes)
            by_beta = arrays.shapedirs[chunk].transpose(2, 1, 0).reshape(3 * B, len(chunk))
            shapes[rows] = _grouped(packing.stored(by_beta, shape_step), lanes)
            weighted[rows] = (_grouped(arrays.weights[chunk].T, lanes) != 0).any(axis=2)
            acting = (arrays.posedirs[chunk].reshape(len(chunk), 3, K - 1, 9) != 0).any(axis=(1, 3))
            corrected[rows, 1:] = _grouped(acting.T, lanes).any(axis=2)
        # Now that their number is known, the directions are written to where they will stay.
        posedirs, end = aligned_zeros((int(corrected.sum()), 27, lanes), packing.dtype), 0
        for chunk, rows in pieces:
            by_joint = arrays.posedirs[chunk].reshape(len(chunk), 3, K - 1, 9)
            planar = by_joint.transpose(2, 3, 1, 0).reshape(27 * (K - 1), len(chunk))
            joints = corrected[rows, 1:]
            directions = _grouped(planar, lanes).reshape(*joints.shape, 27, lanes)[joints]
            begin, end = end, end + len(directions)
            posedirs[begin:end] = packing.stored(directions, pose_step)
        moved = weighted @ ancestors(parents) > 0
        return PackedVertices(
            N,
            (K, B),
            packed,
            shapes,
            posedirs,
            np.array(packing.steps),
            _lists(weighted, corrected, moved),
        )

    @cached_property
    def structure(self) -> NDArray[np.intp]:
        """The `body_t` of `mesh.c`."""
        arrays = self.vertices, self.shapes, self.posedirs, self.steps, self.joints
        addresses = [array.ctypes.data for array in arrays]
        return np.array([self.count, *addresses], dtype=np.intp)


def _lists(*groups: Mask) -> NDArray[np.intp]:
    """For each group, the joints in each of some masks (groups, K), each list after its length."""
    lists: list[int] = []
    for rows in zip(*groups, strict=True):
        for row in rows:
            joints = np.flatnonzero(row).tolist()
            lists += [len(joints), *joints]
    return np.array(lists, dtype=np.intp)


def _grouped(columns: NDArray[Scalar], lanes: int) -> NDArray[Scalar]:
    """Rows of vertices (r, n) in groups (., r, lanes), the last one filled up with zeros."""
    rows, n = columns.shape
    filled = np.pad(columns, ((0, 0), (0, -n % lanes)))
    return filled.reshape(rows, -(-n // lanes), lanes).transpose(1, 0, 2)


@cache
def mesh_library(
    parents: tuple[int, ...], B: int, single: bool = False
) -> tuple[ctypes.CDLL | None, str]:
    """The library for bodies with B betas on this tree, once per process; or None, and why.

    `single` says whether shape and pose directions are stored in single precision.
    """

    def agrees(loaded: ctypes.CDLL) -> bool:
        return _mesh_agrees(loaded, parents, B, single)

    try:
        return library(MESH, mesh_source(parents, B, single), agrees, FLAGS), ""
    except (NoLibrary, NotSupported) as error:
        LOG.info("surfaces are computed by NumPy: %s", error)
        return None, str(error)


@cache
def joint_library(parents: tuple[int, ...], B: int) -> ctypes.CDLL | None:
    """The library for bodies with B betas on this tree, once per process; None without compiler."""

    def agrees(loaded: ctypes.CDLL) -> bool:
        return _joints_agree(loaded, parents, B)

    return library_or_none(
        JOINTS, joint_source(parents, B), agrees, "kinematics are computed by NumPy"
    )


class CompiledJoints:
    """The motions of a body's joints and their derivatives, for `Kinematics`."""

    def __init__(
        self, loaded: ctypes.CDLL, skeleton: Skeleton, bind_pose: Array, parents: Sequence[int]
    ) -> None:
        local = matrix_from_vector(bind_pose)
        unbind = world_rotations(local, parents).swapaxes(1, 2)
        arrays = skeleton.mean, skeleton.by_betas, local, unbind
        self._arrays = [np.ascontiguousarray(array, dtype=np.float64) for array in arrays]
        self._structure = np.array([a.ctypes.data for a in self._arrays], dtype=np.intp)
        self._address = address(self._structure)  # the `skeleton_t` of joint.c
        self._motions, self._derivatives = (
            function_of_addresses(loaded, name, count) for name, count in OF_JOINTS.items()
        )

    @staticmethod
    def of(skeleton: Skeleton, bind_pose: Array, parents: Sequence[int]) -> CompiledJoints | None:
        """The joints of a body on this tree; None where nothing can be compiled."""
        loaded = joint_library(tuple(parents), skeleton.by_betas.shape[2])
        return None if loaded is None else CompiledJoints(loaded, skeleton, bind_pose, parents)

    # The library trusts the sizes of arrays, which are made and checked by `Kinematics`. A count is
    # an integer of the size of an address.

    def motion(self, motion: JointMotion, betas: Array) -> None:
        """Find the numbers of one motion or several, at betas (..., B)."""
        people = np.ascontiguousarray(betas, dtype=np.float64)
        count = motion.numbers.size // motion.numbers.shape[-1]
        poses, numbers = address(motion.pose), address(motion.numbers)
        self._motions(self._address, poses, address(people), numbers, count)

    def derivatives(self, motion: JointMotion, by: MotionDerivatives) -> None:
        """Find the numbers of the derivatives of one motion or several."""
        poses, motions = (np.ascontiguousarray(a) for a in (motion.pose, motion.numbers))
        count = by.numbers.size // by.numbers.shape[-1]
        derivatives = address(by.numbers)
        self._derivatives(self._address, address(poses), address(motions), derivatives, count)


@dataclass(frozen=True, eq=False)
class CompiledMesh:
    """Vertices of a surface, as many side by side as the processor takes at a time.

    Attributes:
        library: the compiled functions.
        packed: the vertices.
    """

    library: ctypes.CDLL
    packed: PackedVertices

    @staticmethod
    def of(body: SkinnedBody, vertices: slice | list[int], packing: Packing) -> CompiledMesh | None:
        """A body's vertices, or some of them, in order; None if nothing can be compiled."""
        loaded, _ = mesh_library(body.parents, body.n_betas, packing.single)
        if loaded is None:
            return None
        lanes = int(loaded.lanes())
        return CompiledMesh(loaded, PackedVertices.of(body, body.parents, vertices, lanes, packing))

    def at(self, motion: JointMotion, betas: Array) -> CompiledMeshAt:
        """The surface moved by a motion, of the person with these betas (B,)."""
        return CompiledMeshAt(self, motion, betas)

    def run(self, name: str, *arrays: NDArray[np.generic] | None) -> None:
        """A function of the library, which is given the addresses of arrays."""
        self._functions[name](self._address, *(None if a is None else address(a) for a in arrays))

    @cached_property
    def _functions(self) -> dict[str, Callable[..., None]]:
        return {n: function_of_addresses(self.library, n, count) for n, count in OF_MESH.items()}

    @cached_property
    def _address(self) -> int:
        return address(self.packed.structure)


@dataclass(frozen=True, eq=False)
class CompiledMeshAt(PointsAtMotion):
    """The vertices at one motion and shape, before translation."""

    of: CompiledMesh
    motion: JointMotion
    betas: Array

    @cached_property
    def points(self) -> Array:
        """The posed vertices before translation, (N, 3) m."""
        points = np.empty((self.of.packed.count, 3))
        self.of.run("points", *self._moved, points)
        return points

    def write_jacobian(
        self, by: MotionDerivatives, into: Mapping[str, RowTarget], scale: Array | None
    ) -> None:
        """Write the transposed derivative into[name] (size, 3 N); keep the points as well.

        The points have the same bits as those that are computed alone.
        """
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        copied: list[tuple[Array, Array]] = []  # what the library cannot write to, and its copy
        tables = {name: _addresses(target, copied) for name, target in into.items()}
        points = None if "points" in self.__dict__ else np.empty((self.of.packed.count, 3))
        outputs = factor, *(tables.get(name) for name in ROLES), points
        self.of.run("write_jacobian", *self._moved, by.numbers, *outputs)
        if points is not None:
            self.__dict__["points"] = points  # as if they had been asked for
        for array, copy in copied:
            array[...] = copy

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """The gradients of cotangent (N, 3) . points by G, the features and betas."""
        (K, B), features = self.of.packed.sizes, self.motion.features.size
        upstream = np.ascontiguousarray(cotangent, dtype=np.float64)
        gradients = np.empty(B + features + 12 * K)
        self.of.run("vjp", *self._moved, upstream, gradients)
        on_betas, on_features, on_G = np.split(gradients, [B, B + features])
        shape, pose = self.of.packed.steps
        return on_G.reshape(K, 3, 4), pose * on_features, shape * on_betas

    @property
    def _moved(self) -> tuple[Array, Array]:
        """Betas and the motion, as the library takes them."""
        return np.ascontiguousarray(self.betas, dtype=np.float64), self.motion.numbers


def _addresses(target: RowTarget, copied: list[tuple[Array, Array]]) -> NDArray[np.intp]:
    """The address that each row is written to, (count,); 0 for a row that is not wanted."""
    array = target.array if isinstance(target, Rows) else target
    plain = array
    if array.strides[1] != 8:
        plain = np.zeros(array.shape)
        copied.append((array, plain))
    places = address(plain) + plain.strides[0] * np.arange(len(plain))
    if not isinstance(target, Rows):
        return places
    table = np.zeros(target.count, dtype=np.intp)
    table[target.rows] = places
    return table


def _mesh_agrees(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int, single: bool) -> bool:
    """Whether the library says what NumPy says, about a few random vertices."""
    rng, K = np.random.default_rng(0), len(parents)
    packing = Packing(True, (TRIED_STEP, TRIED_STEP)) if single else Packing()
    corrected = rng.random((N_TRIED, 1, K - 1, 1)) < TRIED_SHARE
    posedirs = (rng.standard_normal((N_TRIED, 3, K - 1, 9)) * corrected).reshape(
        N_TRIED, 3, 9 * (K - 1)
    )
    shapedirs, posedirs = (
        packing.stored(array, step) * np.float64(step)
        for array, step in zip(
            (rng.standard_normal((N_TRIED, 3, B)), posedirs), packing.steps, strict=True
        )
    )
    weights = rng.standard_normal((N_TRIED, K)) * (rng.random((N_TRIED, K)) < TRIED_SHARE)
    template = rng.standard_normal((N_TRIED, 3))
    parts = {"template": template, "shapedirs": shapedirs, "posedirs": posedirs, "weights": weights}
    arrays = cast("SkinnedBody", SimpleNamespace(**parts))  # as far as it is read
    kinematics, pose, betas = _random_kinematics(parents, B)
    motion, scale = kinematics.motion(pose, betas), rng.standard_normal(3 * N_TRIED)

    def answers(mesh: NumpyMesh | CompiledMesh) -> list[Array]:
        sizes = {"pose": 3 * K, "betas": B, "trans": 3}
        into = {name: np.zeros((size, 3 * N_TRIED)) for name, size in sizes.items()}
        posed = mesh.at(motion, betas)
        posed.write_jacobian(motion.derivatives, into, scale)
        gradients = posed.vjp(scale.reshape(-1, 3))
        return [posed.points, mesh.at(motion, betas).points, *into.values(), *gradients]

    packed = PackedVertices.of(arrays, parents, slice(None), int(loaded.lanes()), packing)
    in_numpy = NumpyMesh(chunks_of(arrays, slice(None)), parents)
    return _agree(answers(CompiledMesh(loaded, packed)), answers(in_numpy))


def _joints_agree(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int) -> bool:
    """Whether the library says what NumPy says, at two random poses of a random skeleton."""
    in_numpy, pose, betas = _random_kinematics(parents, B)
    joints = CompiledJoints(loaded, in_numpy.skeleton, pose[::-1], parents)
    in_c = Kinematics(in_numpy.skeleton, pose[::-1], parents, joints)
    poses, people = np.array([pose[::-1], pose]), np.array([-betas, betas])
    motions = in_c.motion(poses, people), in_numpy.motion(poses, people)
    compiled, expected = ([motion.numbers, motion.derivatives.numbers] for motion in motions)
    return _agree(compiled, expected)


def _random_kinematics(parents: tuple[int, ...], B: int) -> tuple[Kinematics, Array, Array]:
    """Kinematics of a random skeleton by NumPy, bound in a pose; a pose (K, 3) and betas (B,)."""
    rng, K = np.random.default_rng(1), len(parents)
    pose = rng.standard_normal((K, 3))
    pose[-1] *= NEAR_ZERO
    skeleton = Skeleton(rng.standard_normal((K, 3)), rng.standard_normal((K, 3, B)))
    return Kinematics(skeleton, pose[::-1], parents), pose, rng.standard_normal(B)


def _agree(compiled: Sequence[Array], expected: Sequence[Array]) -> bool:
    return all(
        np.allclose(a, b, rtol=0, atol=1e-12 * (1 + np.abs(b).max(initial=0)))
        for a, b in zip(compiled, expected, strict=True)
    )
