"""A motion of a body as .glb, which browsers, Blender and engines play."""

from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.files.gltf import Correctives, write_gltf
from workbench.errors import BadArgument
from workbench.motions.motion import Motion

LARGEST = 2.5e8  # bytes of morph targets, and of their weights in all frames


def write_glb(
    path: str | Path,
    motion: Motion,
    body: SkinnedBody,
    *,
    correctives: int | None = None,
    shapes: int = 0,
    betas: Array | None = None,
) -> Correctives:
    """Write a motion as .glb: surface, skeleton and correctives of a body, and its way.

    Each frame is a key frame. `correctives` is the number of morph targets that stand for what the
    motion uses of the pose blend shapes: None for all of it, 0 for none. What is returned says how
    far the surface is off with them, and so do the file's extras. An expression moves the face of a
    body that has one; `betas` (T, B) take the place of the motion's own. `shapes` is the number of
    shape directions that become morph targets as well, at zero for the person of the motion.

    Raises BadArgument for a file of more than 250 MB, and what `write_gltf` and `Motion.named`
    raise.
    """
    here, T = motion.named(body), len(motion)
    used = min(T, body.posedirs.shape[2])
    each = here.betas_on(body) if betas is None else betas
    person = np.zeros(body.n_betas)
    person[: len(here.betas)] = here.betas
    moving = np.broadcast_to(each, (T, body.n_betas)) - person
    morphs = shapes + (used if correctives is None else min(correctives, used))
    morphs += int(moving.any(axis=0).sum())
    size = morphs * (12.0 * body.n_vertices + 4.0 * T)
    if size > LARGEST:
        raise BadArgument(
            f"{morphs} morph targets of {body.n_vertices} vertices in {T} frames take "
            f"{size / 1e6:.0f} MB as .glb; ask for fewer correctives, resample the motion, slice "
            "it, or take a smaller body"
        )
    return write_gltf(
        path,
        body,
        here.pose,
        here.betas,
        trans=here.trans,
        moving=moving,
        seconds=1 / here.fps,
        correctives=correctives,
        shapes=shapes,
    )
