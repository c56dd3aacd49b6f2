"""The embedded soft tissue: simulated on the body `default`, driven by recorded motion.

    python -m builder.soft_tissue RECORDING --out workbench/data/tissue

RECORDING is an .npz as `builder.recordings` reads it. Clips of 2 s and more are
splined to 60 frames a second and made by synthetic people, tissue is simulated on each of them, and
the model is learned from it. The clips that the pose priors hold out are held out here as well. It
takes about two minutes.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from builder.recordings import read_recording, recorded_motions
from lectures.material.tissue import TissueClip, TissuePlan, train_tissue
from lectures.material.tissue_simulation import TissueLaw, simulate_tissue
from workbench import SkinnedBody, load_body
from workbench.arrays import Array
from workbench.motions import Motion, save_tissue, splined
from workbench.motions.soft_tissue import SoftTissue

FPS = 60.0
LEAST = 20  # frames of the recording
FASTEST = 30.0  # m/s^2: a recording whose root accelerates more, for a tenth of a second, is wrong
PEOPLE, EACH, SEED = 8, 2, 0  # who makes the clips to learn from; how many people make each clip
PLAN = TissuePlan()


@dataclass(frozen=True, eq=False)
class Recorded:
    """Motions to learn from, to choose by and to test on, by whole clips.

    Attributes:
        left_out: why motions were left out, a sentence each.
    """

    learned: tuple[Motion, ...]
    chosen_by: tuple[Motion, ...]
    test: tuple[Motion, ...]
    left_out: tuple[str, ...]


def recorded(path: Path) -> Recorded:
    """The motions of a recording. Every fifth of the clips to learn from is for choices."""
    held_out = set(read_recording(path).split()[0].absent)
    long = [m for m in recorded_motions(path) if len(m) >= LEAST]
    wrong = [m for m in long if hardest_push(m) > FASTEST]
    good = [m for m in long if hardest_push(m) <= FASTEST]
    names = sorted({clip_of(m) for m in good} - held_out)
    choosing = set(names[4::5])
    return Recorded(
        tuple(m for m in good if clip_of(m) not in held_out | choosing),
        tuple(m for m in good if clip_of(m) in choosing),
        tuple(m for m in good if clip_of(m) in held_out),
        tuple(
            f"{m.origin}: the root would accelerate by up to {hardest_push(m):.0f} m/s^2"
            for m in wrong
        ),
    )


def clip_of(motion: Motion) -> str:
    """The name of the clip that a motion comes from."""
    return motion.origin.split(",")[0]


def hardest_push(motion: Motion) -> float:
    """The largest second difference of trans, in m/s^2."""
    return float(np.linalg.norm(np.diff(motion.trans, 2, axis=0), axis=1).max() * motion.fps**2)


def people(count: int, seed: int) -> Array:
    """Betas (count, 10) of synthetic people."""
    return np.random.default_rng(seed).standard_normal((count, 10))


def tissue_clips(
    body: SkinnedBody,
    motions: Sequence[Motion],
    betas: Array,
    each: int = 1,
    law: TissueLaw | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> list[TissueClip]:
    """Simulated tissue in motions, each made by `each` of the people in turn."""
    clips: list[TissueClip] = []
    for motion in motions:
        smooth = splined(motion, FPS)
        for _ in range(each):
            here = replace(smooth, betas=betas[len(clips) % len(betas)])
            clips.append(TissueClip(here, simulate_tissue(body, here, law)))
        progress(f"simulated {motion.origin}")
    return clips


def rounded(tissue: SoftTissue) -> SoftTissue:
    """The tissue with directions in half precision, and matrices in single precision."""
    return replace(
        tissue,
        directions=tissue.directions.astype(np.float16).astype(float),
        first=tissue.first.astype(np.float32).astype(float),
        second=tissue.second.astype(np.float32).astype(float),
        response=tissue.response.astype(np.float32).astype(float),
    )


def main() -> None:
    """Simulate, learn and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    body = load_body()
    motions = recorded(given.recording)
    learned = (*motions.learned, *motions.chosen_by)
    clips = tissue_clips(body, learned, people(PEOPLE, SEED), EACH, progress=print)
    found = rounded(train_tissue(body, clips, PLAN, progress=print))
    card = {
        "body": body.name,
        "tissue": "simulated: springs and dampers on the mesh; none was measured",
        "provenance": "workbench/data/tissue/PROVENANCE.md",
        "clips": len(learned),
        "frames": sum(len(clip.motion) for clip in clips),
        "people": PEOPLE,
    }
    save_tissue(given.out / "default.npz", replace(found, card=card))
    print(f"{card['frames']} frames; spectral radius {found.spectral_radius:.3f}")
    print(f"gain: body mass index to the power of {found.power:.2f}")


if __name__ == "__main__":
    main()
