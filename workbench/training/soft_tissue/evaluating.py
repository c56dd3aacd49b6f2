"""How much of the motion of tissue a model explains in clips that it has not seen."""

from dataclasses import dataclass

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.motions.soft_tissue import SoftTissue
from workbench.training.soft_tissue.identification import TissueClip


@dataclass(frozen=True)
class TissueScore:
    """A free run of the model in one clip, against what the tissue did.

    Attributes:
        explained: the share of the variance of the displacements, about the mean of each
            coordinate in the clip, that the free run explains.
        rms: in m, of the displacements of vertices that ever move.
        error: in m, the rms of what the free run leaves.
        largest: in m, the largest displacement of the free run.
        frames: of the clip.
    """

    explained: float
    rms: float
    error: float
    largest: float
    frames: int


def score_tissue(tissue: SoftTissue, body: SkinnedBody, clip: TissueClip) -> TissueScore:
    """Compare a free run, which sees the motion alone, with the displacements of a clip."""
    phi = tissue.coefficients(body, clip.motion)
    found = tissue.displacements(body, phi, clip.motion.betas)
    true = clip.displacements
    moves = (true != 0).any(axis=(0, 2)) | (found != 0).any(axis=(0, 2))
    off = np.square(true - found).sum()
    spread = np.square(true - true.mean(axis=0)).sum()
    counted = max(1, int(moves.sum()) * len(true))
    return TissueScore(
        explained=float(1 - off / spread) if spread > 0 else float("nan"),
        rms=float(np.sqrt(np.square(true).sum() / counted)),
        error=float(np.sqrt(off / counted)),
        largest=float(np.linalg.norm(found, axis=-1).max()),
        frames=len(true),
    )
