"""People to be scanned: held-out poses, facing any way, with shapes that the body may not reach."""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.synthetic.scan_effects import smooth_field

OWN_SPREAD = 0.1  # m, over which a person's own shape varies
PLACE_SIGMA = 0.1  # m per axis, of where people stand
WORN = ("pelvis", "spine", "hip", "knee", "collar", "shoulder")  # joints of what is clothed


@dataclass(frozen=True, eq=False)
class ScannedPerson:
    """A person made of a body, whose own template may lie outside of its shape space.

    Attributes:
        values: pose (K, 3) rad, betas (B,) and trans (3,) m, by the names of the body's blocks.
        vertices: (N, 3) m, posed.
        template: (N, 3) m, the body's template with the person's own displacement.
    """

    values: Values
    vertices: Array
    template: Array


def people(
    body: SkinnedBody,
    poses: Array,
    n: int,
    seed: int,
    *,
    own_shape: float = 0.0,
    turn: float = np.pi,
) -> tuple[ScannedPerson, ...]:
    """`n` people of a body, in some of the poses (P, K, 3) rad, which are drawn at random.

    For poses that the pose prior was not learned from, give `held_out_poses(FILE)` of
    `builder.recordings`; without a recording, `priors.poses.draw_poses` draws from the prior, which
    makes fits look better than they are. Betas are from N(0, 1). Each person is turned about the
    vertical by up to `turn` rad to either side, and moved by 0.1 m per axis. `own_shape` in m is
    the rms length of a smooth random displacement of the template: with it, no betas give the
    person's shape. Person i depends on the seed and on i alone, and its pose and betas do not
    depend on `own_shape`. Raises BadArgument for poses of another body, none at all, or a negative
    number.
    """
    given = np.asarray(poses, dtype=float)
    if given.ndim != 3 or given.shape[1:] != (body.n_joints, 3) or not len(given):
        raise BadArgument(
            f"poses of the body {body.name!r} are (P, {body.n_joints}, 3) rad with at least one, "
            f"not {given.shape}"
        )
    if n < 0 or seed < 0 or not 0 <= own_shape < np.inf:
        raise BadArgument(
            "the number of people, the seed and the rms of their own shape are from 0 on, not "
            f"{n}, {seed} and {own_shape:g}"
        )
    return tuple(_person(body, given, (seed, i), own_shape, turn) for i in range(n))


def _person(
    body: SkinnedBody, poses: Array, seed: tuple[int, int], own_shape: float, turn: float
) -> ScannedPerson:
    rng = np.random.default_rng(seed)
    pose = poses[rng.integers(len(poses))].copy()
    pose[0] = [0.0, rng.uniform(-turn, turn), 0.0]
    arguments = (
        pose,
        rng.standard_normal(body.n_betas),
        PLACE_SIGMA * rng.standard_normal(3),
    )
    names = (block.name for block in body.blocks())
    shape, template = body, body.template
    if own_shape:
        drawn = smooth_field(template, OWN_SPREAD, 3, np.random.default_rng((*seed, 1)))
        rms = np.sqrt(np.mean((drawn**2).sum(axis=1)))
        template = template + own_shape * drawn / rms
        shape = replace(body, template=template)
    vertices = shape.vertices(*arguments)
    return ScannedPerson(dict(zip(names, arguments, strict=True)), vertices, template)


def clothed(body: SkinnedBody) -> Array:
    """How far each vertex (N,) belongs to the torso, the upper arms or the legs, from 0 to 1.

    It is the sum of its skinning weights of the joints there, for the `where` of `Clothing`. Raises
    BadArgument for a body that has no joints of such names.
    """
    worn = [any(part in name for part in WORN) for name in body.joint_names]
    if not any(worn):
        raise BadArgument(
            f"no joint of the body {body.name!r} is called after {', '.join(WORN)}; give Clothing "
            "an array `where` of your own"
        )
    return np.asarray(body.weights[:, worn].sum(axis=1)).clip(0, 1)
