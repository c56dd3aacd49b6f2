"""Tubes in motion that linear blend skinning explains exactly; nothing here was measured."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.synthetic.made_up import jointed_tube, random_smpl


@dataclass(frozen=True, eq=False)
class Driven:
    """A body without blend shapes, and meshes (T, N, 3) m that it made."""

    body: SkinnedBody
    meshes: Array


def tube() -> SkinnedBody:
    """66 vertices on six bones, in smooth random weights."""
    made = random_smpl(jointed_tube(11, 6), 1, seed=2)
    plain = {"shapedirs": made.shapedirs[:, :, :0], "posedirs": np.zeros_like(made.posedirs)}
    return replace(made, **plain)


def driven(frames: int, seed: int, turn: float = 0.5, allowed: Array | None = None) -> Driven:
    """Meshes of `tube`; `allowed` (K, 3) says which rotations a joint makes, by default all."""
    body, rng = tube(), np.random.default_rng(seed)
    poses = turn * rng.standard_normal((frames, body.n_joints, 3))
    poses *= 1 if allowed is None else allowed
    trans = rng.standard_normal((frames, 3))
    meshes = [body.vertices(pose, trans=t) for pose, t in zip(poses, trans, strict=True)]
    return Driven(body, np.stack(meshes))


@dataclass(frozen=True, eq=False)
class Compared:
    """What was found, against the body that made the meshes.

    Attributes:
        weights: the largest difference, the bones being matched by their weights.
        joints: the largest distance of a joint, in metres, by edges of the tree; none of the root.
        edges: how many edges of the tree are the true ones.
    """

    weights: float
    joints: float
    edges: int


def compared(found: SkinnedBody, truth: SkinnedBody) -> Compared:
    """Bones of two bodies matched by their weights, and their joints by the bones that they join.

    `found` may have fewer bones than the truth, but then some are matched with none.
    """
    gaps = np.abs(found.weights[:, :, None] - truth.weights[:, None]).max(axis=0)
    own, other = linear_sum_assignment(gaps)
    true = dict(zip(own.tolist(), other.tolist(), strict=True))
    places, away, edges = truth.joints(), [0.0], 0
    for k, place in enumerate(found.joints()):
        a, b = true[k], true[found.parents[k]] if k else -1
        for child, parent in ((a, b), (b, a)):
            if k and truth.parents[child] == parent:
                edges += 1
                away.append(float(np.linalg.norm(place - places[child])))
    return Compared(float(gaps[own, other].max()), max(away), edges)
