"""The kinematics of a body by compiled code, after trying it out."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.blocks.simd import C_OF
from workbench.bodies.forward.joint import joint_functions
from workbench.bodies.forward.kernel_code import kernel, tree_sizes
from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.forward.motion import Kinematics, Motion, Slopes
from workbench.bodies.forward.skeleton import Skeleton
from workbench.bodies.forward.vertex import OF_JOINT, motion_column, slopes_column
from workbench.compiling import (
    address,
    function_of_addresses,
    library_or_none,
    source_beside,
)
from workbench.geometry.rotation import matrix_from_vector

NAME = "joint-kernels"
ARGUMENTS = {"motion": 4, "slopes": 5, "motions": 5, "slopes_of_all": 5}  # of its functions
SMALL = 1e-3  # rad: so near to zero, rotations are series


@cache
def joint_kernels(parents: tuple[int, ...], B: int) -> ctypes.CDLL | None:
    """The library for bodies with B betas on this tree, once per process; None without compiler."""
    sizes = {**tree_sizes(parents, B), "OF_JOINT": OF_JOINT}
    defines = [f"#define {name} {size}" for name, size in sizes.items()]
    written = [kernel(function, "=", C_OF) for function in joint_functions().values()]
    head, loops = (source_beside(__package__, name) for name in ("one_number.h", "joint_loops.c"))
    source = "\n".join([head, *defines, *written, loops])
    return library_or_none(
        NAME, source, lambda loaded: _agrees(loaded, parents, B), "CasADi computes kinematics"
    )


@dataclass(frozen=True, eq=False)
class CompiledJoints:
    """The motion of a body's joints and its derivative; see JointNumbers.

    Attributes:
        library: the compiled functions for bodies on this tree.
        skeleton: the joints at rest.
        bind: (K, 3, 3) each joint's rotation in its parent's frame, in the bind pose.
        unbind: (K, 3, 3) the transpose of its rotation in the world, in the bind pose.
    """

    library: ctypes.CDLL
    skeleton: Skeleton
    bind: Array
    unbind: Array

    @staticmethod
    def of(skeleton: Skeleton, bind_pose: Array, parents: Sequence[int]) -> CompiledJoints | None:
        """The joints of a body on this tree; None where nothing can be compiled."""
        loaded = joint_kernels(tuple(parents), skeleton.slopes.shape[2])
        if loaded is None:
            return None
        return CompiledJoints.made(loaded, skeleton, bind_pose, parents)

    @staticmethod
    def made(
        loaded: ctypes.CDLL, skeleton: Skeleton, bind_pose: Array, parents: Sequence[int]
    ) -> CompiledJoints:
        """By this library, which is trusted."""
        arrays = skeleton.mean, skeleton.slopes, matrix_from_vector(bind_pose)
        plain = [np.ascontiguousarray(array) for array in (*arrays, unbinding(bind_pose, parents))]
        return CompiledJoints(loaded, Skeleton(*plain[:2]), *plain[2:])

    def motion(self, pose: Array, betas: Array) -> Motion:
        """The motion at pose (K, 3) rad and betas (B,)."""
        found = np.empty(self._sizes[0])
        self._run("motion", pose, betas, found)
        return self._moved(found)

    def slopes(self, pose: Array, betas: Array) -> Slopes:
        """The derivatives of the motion at pose (K, 3) rad and betas (B,)."""
        found = np.empty(self._sizes[1])
        self._run("slopes", pose, betas, found, None)
        return self._sloped(found)

    def motion_and_slopes(self, pose: Array, betas: Array) -> tuple[Motion, Slopes]:
        """Both of them, in one call."""
        moving, found = np.empty(self._sizes[0]), np.empty(self._sizes[1])
        self._run("slopes", pose, betas, found, moving)
        return self._moved(moving), self._sloped(found)

    def motions(self, poses: Array, betas: Array) -> Motion:
        """The motions at poses (M, K, 3) rad and betas (M, B), in one call."""
        found = np.empty((len(poses), self._sizes[0]))
        self._run_all("motions", poses, betas, found)
        return self._moved(found)

    def slopes_batch(self, poses: Array, betas: Array) -> Slopes:
        """The derivatives of the motions at poses (M, K, 3) rad and betas (M, B), in one call."""
        found = np.empty((len(poses), self._sizes[1]))
        self._run_all("slopes_of_all", poses, betas, found)
        return self._sloped(found)

    def _moved(self, found: Array) -> Motion:
        K, some = len(self.bind), found.shape[:-1]
        bent, turned = 9 * (K - 1), 9 * (K - 1) + 12 * K
        return Motion(
            found[..., bent:turned].reshape(*some, K, 3, 4),
            found[..., :bent],
            found[..., turned:].reshape(*some, K, 3),
            found,
        )

    def _sloped(self, found: Array) -> Slopes:
        K, B, some = len(self.bind), self.skeleton.slopes.shape[2], found.shape[:-1]
        own = OF_JOINT * K + 3 * B * K
        turned, bulged = own + 27 * K, own + 27 * K + 27 * (K - 1)
        return Slopes(
            found[..., own:turned].reshape(*some, K, 9, 3),
            found[..., turned:bulged].reshape(*some, K - 1, 3, 9),
            found[..., bulged:].reshape(*some, 3 * B, K),
            found[..., :own],
        )

    @cached_property
    def _sizes(self) -> tuple[int, int]:
        """How many numbers `motion` and `slopes` find."""
        K, B = len(self.bind), self.skeleton.slopes.shape[2]
        return 9 * (K - 1) + 15 * K, (OF_JOINT + 27) * K + 27 * (K - 1) + 6 * B * K

    @cached_property
    def structure(self) -> NDArray[np.intp]:
        """The `skeleton_t` of `joint_loops.c`."""
        arrays = self.skeleton.mean, self.skeleton.slopes, self.bind, self.unbind
        return np.array([array.ctypes.data for array in arrays], dtype=np.intp)

    @cached_property
    def _here(self) -> int:
        return address(self.structure)

    @cached_property
    def _functions(self) -> dict[str, Callable[..., None]]:
        return {n: function_of_addresses(self.library, n, count) for n, count in ARGUMENTS.items()}

    def _run(self, name: str, pose: Array, betas: Array, *found: Array | None) -> None:
        K, _, B = self.skeleton.slopes.shape
        if (pose.size, betas.size) != (3 * K, B):  # the library trusts it
            raise ValueError(f"pose has {pose.size} numbers and betas {betas.size}")
        pose, betas = (np.ascontiguousarray(a, dtype=np.float64) for a in (pose, betas))
        places = (None if array is None else address(array) for array in found)
        self._functions[name](self._here, address(pose), address(betas), *places)

    def _run_all(self, name: str, poses: Array, betas: Array, found: Array) -> None:
        (K, _, B), M = self.skeleton.slopes.shape, len(found)
        if (poses.size, betas.size) != (3 * K * M, B * M):  # the library trusts it
            raise ValueError(f"{M} poses have {poses.size} numbers and betas {betas.size}")
        poses, betas = (np.ascontiguousarray(a, dtype=np.float64) for a in (poses, betas))
        # M is an integer of the size of an address
        self._functions[name](self._here, address(poses), address(betas), address(found), M)


def unbinding(bind_pose: Array, parents: Sequence[int]) -> Array:
    """The transposes of the joints' rotations in the world at a pose (K, 3) rad, (K, 3, 3)."""
    return np.array([np.asarray(R).T for R in world_rotations(cs.DM(bind_pose.T), parents)])


def _agrees(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int) -> bool:
    """Whether the library says what CasADi says, at a random pose of a random skeleton."""
    rng, K = np.random.default_rng(0), len(parents)
    pose, bind = rng.standard_normal((2, K, 3))
    pose[-1] *= SMALL
    skeleton = Skeleton(rng.standard_normal((K, 3)), rng.standard_normal((K, 3, B)))
    betas = rng.standard_normal(B)
    ours, casadis = (
        CompiledJoints.made(loaded, skeleton, bind, parents),
        Kinematics(skeleton, bind, parents),
    )
    twice = np.array([bind, pose]), np.array([-betas, betas])
    right = _answers(casadis.motion(pose, betas), casadis.slopes(pose, betas))
    return all(
        np.allclose(got, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max(initial=0)))
        for both in (
            (ours.motion(pose, betas), ours.slopes(pose, betas)),
            ours.motion_and_slopes(pose, betas),
            (ours.motions(*twice)[1], ours.slopes_batch(*twice)[1]),
        )
        for got, expected in zip(_answers(*both), right, strict=True)
    )


def _answers(motion: Motion, slopes: Slopes) -> list[Array]:
    parts = [motion.G, motion.features, motion.joints, motion_column(motion)]
    return [*parts, slopes.turns, slopes.d_features, slopes.d_shift, slopes_column(slopes)]
