"""A rig as data: what the sets and the training need to know of a body or a hand."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.synthetic.teacher import JOINT_NAMES, PARENTS, Teacher


class Posable(Protocol):
    """One person, whose surface a pose moves."""

    def vertices(self, pose: Array) -> Array:
        """The posed surface (N, 3) m of one pose (K, 3) rad."""


@dataclass(frozen=True, eq=False)
class Rig:
    """Joints, the teacher of what pose does to skin, and the poses that people are in.

    Attributes:
        joint_names: the names of K joints.
        parents: (K,), parents[0] == -1.
        teacher: makes a person who can be posed from the surface at rest (N, 3) m, the joints at
            rest (K, 3) m and the weights (N, B) of the teacher's own B bones.
        draw: draws so many poses (n, K, 3) rad.
        radius: in metres, of the vertices around a joint from which it may be regressed.
        draws: what the drawn poses are, in a few words.
    """

    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    teacher: Callable[[Array, Array, csr_array], Posable]
    draw: Callable[[int, np.random.Generator], Array]
    radius: float
    draws: str


def _of_the_mixture(count: int, rng: np.random.Generator) -> Array:
    return draw_poses(shipped_mixture(), count, rng)


BODY = Rig(JOINT_NAMES, PARENTS, Teacher, _of_the_mixture, 0.25, "draws of the mixture")
