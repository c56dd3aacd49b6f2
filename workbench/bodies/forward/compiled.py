"""Compiled arithmetic of surfaces and of kinematics: loaded, tried against NumPy, and called.

The functions of `c_functions.py` are written as C with loops around them, compiled once for a tree
and a number of betas, and kept on disk. The numbers of a library are compared with NumPy's before
it is used. Without a compiler, or if anything fails, NumPy does the same work, and the log says
why.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.forward.c_functions import joint_source, mesh_source
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.mesh import NumpyMesh, chunks_of
from workbench.bodies.forward.motion import (
    JointMotion,
    Kinematics,
    MotionDerivatives,
    PointsAtMotion,
)
from workbench.bodies.forward.named_points import Rows, RowTarget
from workbench.bodies.forward.packing import PackedVertices, Packing
from workbench.bodies.forward.posing import world_rotations
from workbench.compiling import (
    NoLibrary,
    address,
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
MANY_PLACES = 64  # of arrays whose rows' addresses are remembered
FLAGS = ("-O3",)  # a quarter less time than with -O2, and the same numbers
# how many arguments their functions take
OF_MESH = {"points": 4, "write_jacobian": 9, "vjp": 5}
OF_JOINTS = {"motions": 5, "derivatives": 5}

TRIED = 11  # vertices: all lanes full at least once, and some that are left over
TRIED_SHARE = 0.1  # of its joints that have a weight on, and posedirs for, each of them
TRIED_STEP = 1e-3  # of the directions that are tried in single precision
SMALL = 1e-3  # rad: so near to zero, rotations are series


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
        self._held = [np.ascontiguousarray(array, dtype=np.float64) for array in arrays]
        self._structure = np.array([a.ctypes.data for a in self._held], dtype=np.intp)
        self._here = address(self._structure)  # the `skeleton_t` of joint.c
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
        plain = np.ascontiguousarray(betas, dtype=np.float64)
        count = motion.numbers.size // motion.numbers.shape[-1]
        poses, found = address(motion.pose), address(motion.numbers)
        self._motions(self._here, poses, address(plain), found, count)

    def derivatives(self, motion: JointMotion, by: MotionDerivatives) -> None:
        """Find the numbers of the derivatives of one motion or several."""
        poses, moved = (np.ascontiguousarray(a) for a in (motion.pose, motion.numbers))
        count = by.numbers.size // by.numbers.shape[-1]
        found = address(by.numbers)
        self._derivatives(self._here, address(poses), address(moved), found, count)


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
        self._functions[name](self._here, *(None if a is None else address(a) for a in arrays))

    @cached_property
    def _functions(self) -> dict[str, Callable[..., None]]:
        return {n: function_of_addresses(self.library, n, count) for n, count in OF_MESH.items()}

    @cached_property
    def _here(self) -> int:
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
        found = np.empty((self.of.packed.count, 3))
        self.of.run("points", *self._moved, found)
        return found

    def write_jacobian(
        self, by: MotionDerivatives, into: Mapping[str, RowTarget], scale: Array | None
    ) -> None:
        """Write the transposed derivative into[name] (size, 3 N); keep the points as well.

        The points have the same bits as those that are computed alone.
        """
        factor = None if scale is None else np.ascontiguousarray(scale, dtype=np.float64)
        copied: list[tuple[Array, Array]] = []  # what the library cannot write to, and its copy
        tables = {name: _addresses(target, copied) for name, target in into.items()}
        found = None if "points" in self.__dict__ else np.empty((self.of.packed.count, 3))
        wanted = factor, *(tables.get(name) for name in ROLES), found
        self.of.run("write_jacobian", *self._moved, by.numbers, *wanted)
        if found is not None:
            self.__dict__["points"] = found  # as if they had been asked for
        for array, copy in copied:
            array[...] = copy

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """The gradients of cotangent (N, 3) . points by G, the features and betas."""
        (K, B), features = self.of.packed.sizes, self.motion.features.size
        plain = np.ascontiguousarray(cotangent, dtype=np.float64)
        found = np.empty(B + features + 12 * K)
        self.of.run("vjp", *self._moved, plain, found)
        on_betas, on_features, on_G = np.split(found, [B, B + features])
        shape, pose = self.of.packed.steps
        return on_G.reshape(K, 3, 4), pose * on_features, shape * on_betas

    @property
    def _moved(self) -> tuple[Array, Array]:
        """Betas and the motion, as the library takes them."""
        return np.ascontiguousarray(self.betas, dtype=np.float64), self.motion.numbers


def _addresses(target: RowTarget, copied: list[tuple[Array, Array]]) -> NDArray[np.intp]:
    """The address that each row is written to, (count,); 0 for a row that is not wanted.

    An array whose rows are not in one piece is written aside, and appended to `copied`.
    """
    array = target.array if isinstance(target, Rows) else target
    plain = array
    if array.strides[1] != 8:
        plain = np.zeros(array.shape)
        copied.append((array, plain))
    places = _places(address(plain), plain.strides[0], len(plain))
    if not isinstance(target, Rows):
        return places
    table = np.zeros(target.count, dtype=np.intp)
    table[target.rows] = places
    return table


@lru_cache(MANY_PLACES)
def _places(begin: int, stride: int, count: int) -> NDArray[np.intp]:
    """The addresses of rows one after the other; only the library reads them.

    Large Jacobians take turns in a few buffers, so that the same addresses are asked for again.
    """
    return begin + stride * np.arange(count)


class TrialArrays(NamedTuple):
    """The arrays of a surface that is tried, as those of a SkinnedBody."""

    template: Array
    shapedirs: Array
    posedirs: Array
    weights: Array


def _mesh_agrees(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int, single: bool) -> bool:
    """Whether the library says what NumPy says, about a few random vertices."""
    rng, K = np.random.default_rng(0), len(parents)
    packing = Packing(True, (TRIED_STEP, TRIED_STEP)) if single else Packing()
    corrected = rng.random((TRIED, 1, K - 1, 1)) < TRIED_SHARE
    posedirs = (rng.standard_normal((TRIED, 3, K - 1, 9)) * corrected).reshape(
        TRIED, 3, 9 * (K - 1)
    )
    shapedirs, posedirs = (
        packing.stored(array, step) * np.float64(step)
        for array, step in zip(
            (rng.standard_normal((TRIED, 3, B)), posedirs), packing.steps, strict=True
        )
    )
    weights = rng.standard_normal((TRIED, K)) * (rng.random((TRIED, K)) < TRIED_SHARE)
    arrays = TrialArrays(rng.standard_normal((TRIED, 3)), shapedirs, posedirs, weights)
    kinematics, pose, betas = _random_kinematics(parents, B)
    motion, scale = kinematics.motion(pose, betas), rng.standard_normal(3 * TRIED)

    def answers(mesh: NumpyMesh | CompiledMesh) -> list[Array]:
        sizes = {"pose": 3 * K, "betas": B, "trans": 3}
        into = {name: np.zeros((size, 3 * TRIED)) for name, size in sizes.items()}
        here = mesh.at(motion, betas)
        here.write_jacobian(motion.derivatives, into, scale)
        gradients = here.vjp(scale.reshape(-1, 3))
        return [here.points, mesh.at(motion, betas).points, *into.values(), *gradients]

    packed = PackedVertices.of(arrays, parents, slice(None), int(loaded.lanes()), packing)
    in_numpy = NumpyMesh(chunks_of(arrays, slice(None)), parents)
    return _agree(answers(CompiledMesh(loaded, packed)), answers(in_numpy))


def _joints_agree(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int) -> bool:
    """Whether the library says what NumPy says, at two random poses of a random skeleton."""
    in_numpy, pose, betas = _random_kinematics(parents, B)
    own = CompiledJoints(loaded, in_numpy.skeleton, pose[::-1], parents)
    in_c = Kinematics(in_numpy.skeleton, pose[::-1], parents, own)
    poses, people = np.array([pose[::-1], pose]), np.array([-betas, betas])
    motions = in_c.motion(poses, people), in_numpy.motion(poses, people)
    found, expected = ([motion.numbers, motion.derivatives.numbers] for motion in motions)
    return _agree(found, expected)


def _random_kinematics(parents: tuple[int, ...], B: int) -> tuple[Kinematics, Array, Array]:
    """Kinematics of a random skeleton by NumPy, bound in a pose; a pose (K, 3) and betas (B,)."""
    rng, K = np.random.default_rng(1), len(parents)
    pose = rng.standard_normal((K, 3))
    pose[-1] *= SMALL
    skeleton = Skeleton(rng.standard_normal((K, 3)), rng.standard_normal((K, 3, B)))
    return Kinematics(skeleton, pose[::-1], parents), pose, rng.standard_normal(B)


def _agree(found: Sequence[Array], expected: Sequence[Array]) -> bool:
    return all(
        np.allclose(a, b, rtol=0, atol=1e-12 * (1 + np.abs(b).max(initial=0)))
        for a, b in zip(found, expected, strict=True)
    )
