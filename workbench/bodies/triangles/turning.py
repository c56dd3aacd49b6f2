"""The parts' rotations in the world, and how they change with the pose."""

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks.buffered import Buffered
from workbench.bodies.forward.kinematics import local_slopes, turning_axes, world_rotations
from workbench.geometry.rotation import rodrigues


class Turning:
    """World rotations of K joints as CasADi functions of the pose, and back."""

    def __init__(self, parents: tuple[int, ...]) -> None:
        self._K = K = len(parents)
        pose = cs.SX.sym("pose", 3, K)
        R = world_rotations(pose, parents)
        local = rodrigues(pose)
        axes = turning_axes(local_slopes(pose, local), local, R, parents)
        turns = [cs.skew(axis) for axis in axes]
        # transposed, so that what CasADi stores by columns NumPy reads by rows
        rows = [cs.horzcat(*[part.T for part in parts]) for parts in (R, turns)]
        self._forth = Buffered(cs.Function("turning", [pose], [cs.densify(r) for r in rows]))
        pull = cs.SX.sym("pull", 3, 3 * K)
        felt = cs.dot(pull, rows[0])
        back = cs.densify(cs.gradient(felt, pose))
        self._back = Buffered(cs.Function("turning_adjoint", [pose, pull], [back]))

    def at(self, pose: Array) -> tuple[Array, Array]:
        """R (K, 3, 3), and turns (K, 3, 3, 3): pose[k, a] turns all below k by turns[k, a]."""
        R, turns = self._forth(pose)
        return R.reshape(self._K, 3, 3), turns.reshape(self._K, 3, 3, 3)

    def adjoint(self, pose: Array, on_R: Array) -> Array:
        """The gradient (K, 3) of sum(on_R * R), on_R (K, 3, 3)."""
        return np.asarray(self._back(pose, on_R)[0]).reshape(self._K, 3)
