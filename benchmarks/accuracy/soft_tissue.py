"""How much of simulated soft tissue a model explains in clips and people that it has not seen.

The data are those of `builder.soft_tissue`: no tissue was measured. A model is trained on all clips
but the held-out ones, and its free run, which sees the motion alone, is compared with the simulated
tissue of held-out clips, made by people that no clip was learned from.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.accuracy import RECORDING, needed
from benchmarks.measuring import table
from builder.soft_tissue import EACH, PEOPLE, PLAN, SEED, clip_of, people, recorded, tissue_clips
from lectures.material.tissue import TissueClip, one_step_of, score_tissue, train_tissue
from workbench import SkinnedBody, load_body
from workbench.bodies.spaces import body_mass_index
from workbench.motions import SoftTissue

UNSEEN = 3, 200  # how many people the held-out clips are made by, and the seed of their betas
PLANS = {"no forces on parts": replace(PLAN, parts=0), "as embedded": PLAN}
INPUTS = {"no forces on parts": "Dyna's", "as embedded": "and forces on parts"}
DRAWS = 2000  # of recorded clips, with replacement


def spread(clip: TissueClip) -> float:
    """The variance of a clip's displacements about their means, times the frames, in m^2."""
    return float(np.square(clip.displacements - clip.displacements.mean(axis=0)).sum())


def pooled(shares: list[float], clips: list[TissueClip]) -> dict[str, Any]:
    """The share explained in all clips together, with an interval by drawing recorded clips.

    What several people do in one recorded clip, and the pieces of a clip that is not whole, are
    drawn together, because they are alike.
    """
    weights, each = np.array([spread(clip) for clip in clips]), np.array(shares)
    names, of = np.unique([clip_of(clip.motion) for clip in clips], return_inverse=True)
    whole, part = np.bincount(of, weights), np.bincount(of, weights * each)
    drawn = np.random.default_rng(0).integers(len(names), size=(DRAWS, len(names)))
    found = part[drawn].sum(axis=1) / whole[drawn].sum(axis=1)
    low, high = np.quantile(found, [0.025, 0.975])
    return {
        "explained": float(np.average(each, weights=weights)),
        "interval_95": [float(low), float(high)],
        "median_of_clips": float(np.median(each)),
        "worst_clip": float(each.min()),
        "recorded_clips": len(names),
        "motions": len(each),
        "frames": sum(len(clip.motion) for clip in clips),
    }


def one_step(tissue: SoftTissue, body: SkinnedBody, clips: list[TissueClip]) -> float:
    """The rms of the coefficients' error one step ahead, over their rms."""
    one = one_step_of(tissue, body, clips)
    factors = np.hstack([tissue.first, tissue.second, tissue.response])
    off = one.targets - one.regressors @ factors.T
    return float(np.sqrt(np.square(off).sum() / np.square(one.targets).sum()))


def judged(tissue: SoftTissue, body: SkinnedBody, clips: list[TissueClip]) -> dict[str, Any]:
    """All clips together, and each of them."""
    scores = [score_tissue(tissue, body, clip) for clip in clips]
    rows = [
        {
            "clip": clip.motion.origin,
            "frames": one.frames,
            "body mass index": body_mass_index(body, clip.motion.betas),
            "explained": one.explained,
            "rms_mm": 1e3 * one.rms,
            "error_mm": 1e3 * one.error,
            "largest_mm": 1e3 * one.largest,
        }
        for one, clip in zip(scores, clips, strict=True)
    ]
    return {"together": pooled([one.explained for one in scores], clips), "each": rows}


def measured(quick: bool) -> dict[str, object]:
    """Both plans; `quick` learns from two recorded clips, and judges by one."""
    body, motions = load_body(), recorded(needed(RECORDING))
    some = slice(2 if quick else None)
    learned = tissue_clips(
        body, (*motions.learned, *motions.chosen_by)[some], people(PEOPLE, SEED), EACH
    )
    test = tissue_clips(body, motions.test[: 1 if quick else None], people(*UNSEEN), 2)
    found: dict[str, object] = {}
    for name, plan in PLANS.items():
        tissue = train_tissue(body, learned, plan)
        found[name] = judged(tissue, body, test) | {
            "one step error": one_step(tissue, body, test),
            "spectral radius": tissue.spectral_radius,
        }
    return found


def tables(found: dict[str, Any]) -> str:
    """Both plans, and each motion with forces on parts."""
    head: tuple[str, ...] = (
        "inputs",
        "explained",
        "95 % interval",
        "worst motion",
        "a frame ahead off by",
    )
    rows: list[tuple[object, ...]] = []
    for name, inputs in INPUTS.items():
        one, together = found[name], found[name]["together"]
        low, high = together["interval_95"]
        rows.append(
            (
                *(inputs, f"{100 * together['explained']:.0f} %"),
                *(
                    f"{100 * low:.0f} to {100 * high:.0f} %",
                    f"{100 * together['worst_clip']:.0f} %",
                ),
                *(f"{100 * one['one step error']:.1f} %", f"{one['spectral radius']:.3f}"),
            )
        )
    text = table((*head, "spectral radius"), rows)
    head = ("clip", "frames", "body mass index", "explained")
    rows = [
        (
            *(row["clip"], row["frames"], f"{row['body mass index']:.1f}"),
            f"{100 * row['explained']:.0f} %",
            *(f"{row['rms_mm']:.1f}", f"{row['error_mm']:.1f}", f"{row['largest_mm']:.0f}"),
        )
        for row in found["as embedded"]["each"]
    ]
    return f"{text}\n{table((*head, 'tissue, rms mm', 'left, rms mm', 'largest mm'), rows)}"
