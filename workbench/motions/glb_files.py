"""A motion of a body as .glb, which browsers, Blender and engines play."""

from pathlib import Path

from workbench.bodies import SkinnedBody
from workbench.bodies.files.gltf import write_gltf
from workbench.errors import BadArgument
from workbench.motions.motion import Motion

LARGEST = 2.5e8  # bytes; there is a morph target, and a row of weights, for each frame


def write_glb(path: str | Path, motion: Motion, body: SkinnedBody) -> None:
    """Write a motion as .glb: surface, skeleton and correctives of a body, and its way.

    Each frame is a key frame with a morph target of its own, so that the file grows with frames
    times vertices. Raises BadArgument for a file of more than 250 MB, and what `write_gltf` and
    `Motion.named` raise.
    """
    here, T = motion.named(body), len(motion)
    size = T * (12.0 * body.n_vertices + 4.0 * T)
    if size > LARGEST:
        raise BadArgument(
            f"{T} frames of {body.n_vertices} vertices take {size / 1e6:.0f} MB as .glb; resample "
            "the motion, slice it, or take a smaller body"
        )
    write_gltf(path, body, here.pose, _padded(here, body), trans=here.trans, seconds=1 / here.fps)


def _padded(motion: Motion, body: SkinnedBody) -> list[float]:
    return [*motion.betas, *[0.0] * (body.n_betas - len(motion.betas))]
