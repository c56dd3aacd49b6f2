"""A skeleton by itself: joints, and how far each is from its parent, without a surface."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks.checks import reals
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.posing import world_rotations
from workbench.bodies.readonly import locked
from workbench.errors import BadArgument
from workbench.geometry.rotation import matrix_from_vector

LIMB_WEIGHT = 0.5  # the least with which the outermost vertex follows the last joint of a limb


@dataclass(frozen=True, eq=False)
class Bones:
    """K joints in a tree, each of which turns about its own place.

    Raises BadArgument for a tree whose first joint is not its root, or whose parents do not come
    before their children, and for offsets of other shapes.

    Attributes:
        parents: (K,) with parents[0] == -1 and 0 <= parents[k] < k.
        offsets: (K, 3) m from the parent to each joint at rest; the root's is its place at rest.
        end_parents: for each of the E bones with no joint at their end, the joint where it begins.
        end_offsets: (E, 3) m from that joint to the end at rest.
    """

    parents: tuple[int, ...]
    offsets: Array
    end_parents: tuple[int, ...] = ()
    end_offsets: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        tree = tuple(int(p) for p in self.parents)
        K, E = len(tree), len(self.end_parents)
        if not K or tree[0] != -1 or any(not 0 <= p < k for k, p in enumerate(tree) if k):
            raise BadArgument(
                "the first of a skeleton's parents is -1, and each other joint comes after its "
                f"parent, unlike in {tree[:30]}"
            )
        if any(not 0 <= p < K for p in self.end_parents):
            raise BadArgument(f"the ends of bones go out from one of {K} joints")
        offsets, ends = reals("offsets", self.offsets), reals("end_offsets", self.end_offsets)
        for name, array, shape in (("offsets", offsets, (K, 3)), ("end_offsets", ends, (E, 3))):
            if array.shape != shape or not np.isfinite(array).all():
                raise BadArgument(f"{name} are {shape} finite metres, not {array.shape}")
        self.__dict__.update(
            parents=tree, offsets=locked(offsets.copy()), end_offsets=locked(ends.copy())
        )

    @cached_property
    def rest(self) -> Array:
        """The joints at rest, (K, 3) m."""
        places = self.offsets.copy()
        for k, parent in enumerate(self.parents[1:], start=1):
            places[k] += places[parent]
        return places

    @property
    def span(self) -> float:
        """The longest way along bones from one joint or end to another, in m, in whatever pose."""
        reach, longest = np.zeros(len(self.parents)), 0.0  # of the bones below each joint; of all
        ends = np.linalg.norm(self.end_offsets, axis=1)
        for k, length in zip(self.end_parents, ends, strict=True):
            longest, reach[k] = max(longest, reach[k] + length), max(reach[k], length)
        lengths = np.linalg.norm(self.offsets, axis=1)
        for k in range(len(reach) - 1, 0, -1):
            parent, length = self.parents[k], reach[k] + lengths[k]
            longest = max(longest, reach[parent] + length)
            reach[parent] = max(reach[parent], length)
        return float(longest)

    def joints(self, pose: ArrayLike, trans: ArrayLike) -> Array:
        """The joints (T, K, 3) m of poses (T, K, 3) rad, with the root at its rest place + trans.

        Joint k is G_parent(k) (offset_k; 1), where G are the motions of the joints (SMPL eq. 3).
        """
        turned, K = np.array(pose, dtype=float), len(self.parents)
        alone = Skeleton(self.rest, np.zeros((K, 3, 0)))
        kinematics = Kinematics(alone, np.zeros((K, 3)), self.parents)
        motion = kinematics.motion(turned, np.zeros((len(turned), 0)))
        return np.asarray(motion.joints + np.asarray(trans)[:, None])

    def ends(self, pose: ArrayLike, trans: ArrayLike) -> Array:
        """The ends of bones that carry no joint, (T, E, 3) m."""
        places, starts = self.joints(pose, trans), list(self.end_parents)
        local = matrix_from_vector(np.asarray(pose, dtype=float))
        world = np.array([world_rotations(R, self.parents)[starts] for R in local])
        moved: Array = np.einsum("teij,ej->tei", world, self.end_offsets)
        return places[:, starts] + moved

    @property
    def pairs(self) -> Index:
        """Each joint but the root with its parent, (K - 1, 2)."""
        return np.array(list(enumerate(self.parents)), dtype=np.int64).reshape(-1, 2)[1:]


def different_names(
    labels: Sequence[str], kind: str = "joint"
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of which each occurs once, and a note if some had to be changed: `joint_3`, `hip_2`."""
    in_use, names, suffixes = {*labels}, dict[str, None](), Counter[str]()
    for k, name in enumerate(labels):
        base = new = name or f"{kind}_{k}"
        while new in names or (new != name and new in in_use):
            suffixes[base] += 1
            new = f"{base}_{suffixes[base] + 1}"
        names[new] = None
    changed = sum(new != old for new, old in zip(names, labels, strict=True))
    note = f"{changed} of {len(names)} {kind}s had no name or that of another, and got a number"
    return tuple(names), (note,) * bool(changed)


def bones_of(body: Body, betas: Sequence[float] | Array | None = None) -> Bones:
    """The skeleton of a person: the joints of the body at rest.

    Limbs of a SkinnedBody end at the farthest vertex that follows their last joint.
    """
    joints = body.joints(body.bind_pose * 0, betas)
    parents = tuple(body.parents)
    above = np.where(np.arange(len(joints))[:, None] > 0, joints[list(parents)], 0.0)
    last = tuple(k for k in range(len(joints)) if k not in parents)
    ends = np.zeros((len(last), 3))
    if isinstance(body, SkinnedBody):
        surface = body.vertices(body.bind_pose * 0, betas)
        for e, k in enumerate(last):
            away = surface[body.weights[:, k] >= LIMB_WEIGHT] - joints[k]
            if len(away):
                ends[e] = away[np.linalg.norm(away, axis=1).argmax()]
    return Bones(parents, joints - above, last, ends)
