"""People to be scanned: held-out poses, facing any way, with shapes that the body may not reach."""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.checks import from_zero
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.synthetic.scan_effects import smooth_field

OWN_SPREAD = 0.1  # m, over which a person's own shape varies
PLACE_SIGMA = 0.1  # m per axis, of where people stand


@dataclass(frozen=True, eq=False)
class ScannedPerson:
    """A person made of a body: the values of its blocks, the vertices (N, 3) m, posed, and a
    template (N, 3) m with the person's own displacement, which may lie outside of the body's shape
    space.
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
    choices = np.asarray(poses, dtype=float)
    if choices.ndim != 3 or choices.shape[1:] != (body.n_joints, 3) or not len(choices):
        raise BadArgument(
            f"poses of the body {body.name!r} are (P, {body.n_joints}, 3) rad with at least one, "
            f"not {choices.shape}"
        )
    from_zero("people", n=n, seed=seed, own_shape=own_shape)
    return tuple(_person(body, choices, (seed, i), own_shape, turn) for i in range(n))


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
