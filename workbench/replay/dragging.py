"""A body whose joints are drawn to places by hand: inverse kinematics by the default solver."""

import threading

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.solvers import TrustRegion

HELD = 0.003  # m: how closely a joint follows the hand
LOOSE = 0.5  # rad: how far a joint that carries nothing turns for it
ROUGHLY = TrustRegion(max_iterations=12, gradient_tolerance=1e-3)  # a hand is not exact


class Puppet:
    """A body as a puppet: one joint goes where it is wanted, and the others change little.

    The cost is the distance of the joint, and how far all joints turn from where they were. A
    joint that carries much of the body (the share s of all joints) is stiff: its standard deviation
    is 0.5 rad (1 - s)^2. So a wrist is reached by the arm rather than by the trunk. The root joint
    keeps its rotation, and is moved with the whole body.
    """

    def __init__(self, body: SkinnedBody) -> None:
        pose, betas, trans = blocks = body.blocks()
        K = body.n_joints
        held, place = Block("held", (K, 3), "rad"), Block("place", (3,), "m")
        which = Block("which", (K,))
        joints = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
        away = joints.symbol @ which.symbol - place.symbol
        names = body.joint_names
        self._problem = Problem(
            [
                Residual("place", away, HELD, "m", points=(joints,)),
                Residual("held", cs.vec(pose.symbol - held.symbol), self._sigmas(body), "rad"),
            ],
            [f"{pose.name}[{name}]" for name in names[1:]],
            blocks=[*blocks, held, place, which],
        )
        self._problem.prepare()
        self._names = [block.name for block in blocks]
        self._body, self._one_at_a_time = body, threading.Lock()

    @staticmethod
    def _sigmas(body: SkinnedBody) -> Array:
        """Of the entries of the pose, (3 K,) rad."""
        K = body.n_joints
        carried = np.zeros(K)
        for k in range(K - 1, 0, -1):
            carried[body.parents[k]] += carried[k] + 1
        return np.repeat(np.maximum(LOOSE * (1 - carried / K) ** 2, 1e-3), 3)

    def dragged(
        self, pose: Array, betas: Array, trans: Array, joint: int, place: Array
    ) -> tuple[Array, Array]:
        """The pose (K, 3) rad and trans (3,) m with a joint at a place (3,) m, or as near as it
        comes. Raises BadArgument for a joint that is not there.
        """
        if not 0 <= joint < self._body.n_joints:
            raise BadArgument(f"the joints are numbered from 0 to {self._body.n_joints - 1}")
        if joint == 0:
            return pose, trans + place - self._body.joints(pose, betas, trans)[0]
        which = np.zeros(self._body.n_joints)
        which[joint] = 1.0
        given = dict(zip(self._names, (pose, betas, trans), strict=True))
        given |= {"held": pose, "place": place, "which": which}
        with self._one_at_a_time:
            found = ROUGHLY.solve(self._problem, given)
        return np.asarray(found.values[self._names[0]]), trans
