"""How much of simulated soft tissue a model explains in clips and people that it has not seen.

    python -m benchmarks.soft_tissue RECORDING

The data are those of `builder.soft_tissue`. Choices are made on clips of their own; then one model
is trained on all clips but the held-out ones, and its free run, which sees the motion alone, is
compared with the simulated tissue of held-out clips, made by people that no clip was learned from.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from builder.soft_tissue import (
    EACH,
    FPS,
    PEOPLE,
    PLAN,
    SEED,
    clip_of,
    people,
    recorded,
    tissue_clips,
)
from workbench import SkinnedBody, load_body
from workbench.bodies.spaces import body_mass_index
from workbench.motions import Motion, SoftTissue
from workbench.training.soft_tissue import (
    TissueClip,
    coefficients_of,
    factor_names,
    one_step_of,
    one_step_problem,
    one_step_start,
    score_tissue,
    train_tissue,
)

RESULTS = Path(__file__).parent / "results" / "soft-tissue.json"
PAGE = Path(__file__).parent / "TISSUE.md"
MARK = "<!-- written by `python -m benchmarks.soft_tissue` -->\n"
UNSEEN = {"choosing": (3, 100), "test": (3, 200)}  # how many people, and the seed of their betas
TRIED = {
    "8 components": replace(PLAN, components=8),
    "16 components": replace(PLAN, components=16),
    "24 components": replace(PLAN, components=24),
    "4 betas": replace(PLAN, n_betas=4),
    "ridge 0.1": replace(PLAN, ridge=0.1),
    "no forces on parts": replace(PLAN, parts=0),
    "as embedded": PLAN,
}
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


def measured(tissue: SoftTissue, body: SkinnedBody, clips: list[TissueClip]) -> dict[str, Any]:
    """All clips together, and each of them."""
    scores = [score_tissue(tissue, body, clip) for clip in clips]
    rows = [
        {
            "clip": clip.motion.origin,
            "frames": one.frames,
            "body_mass_index": body_mass_index(body, clip.motion.betas),
            "explained": one.explained,
            "rms_mm": 1e3 * one.rms,
            "error_mm": 1e3 * one.error,
            "largest_mm": 1e3 * one.largest,
            "directions_hold": held(tissue, clip),
        }
        for one, clip in zip(scores, clips, strict=True)
    ]
    return {"together": pooled([one.explained for one in scores], clips), "each": rows}


def held(tissue: SoftTissue, clip: TissueClip) -> float:
    """The share that the directions could explain with the best coefficients."""
    phi = coefficients_of(tissue.directions, clip.displacements)
    away = clip.displacements - (phi @ tissue.directions.reshape(-1, phi.shape[1]).T).reshape(
        clip.displacements.shape
    )
    return float(1 - np.square(away).sum() / spread(clip))


def one_step(tissue: SoftTissue, body: SkinnedBody, clips: list[TissueClip]) -> float:
    """The rms of the coefficients' error one step ahead, over their rms."""
    one = one_step_of(tissue, body, clips)
    factors = np.hstack([tissue.first, tissue.second, tissue.response])
    off = one.targets - one.regressors @ factors.T
    return float(np.sqrt(np.square(off).sum() / np.square(one.targets).sum()))


def violent(body: SkinnedBody, seed: int = 0) -> Motion:
    """Ten seconds in which every joint jumps by half a radian in each frame, about each axis."""
    rng = np.random.default_rng(seed)
    pose = 0.5 * rng.standard_normal((600, body.n_joints, 3))
    return Motion(pose, 0.1 * rng.standard_normal((600, 3)), FPS, body.joint_names)


def main() -> None:
    """Measure, and write results/soft-tissue.json."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("recording", type=Path)
    given = parser.parse_args()
    began = time.process_time()
    body, motions = load_body(), recorded(given.recording)
    everyone = people(PEOPLE, SEED)
    learned = tissue_clips(body, motions.learned, everyone, EACH)
    others = {name: people(*some) for name, some in UNSEEN.items()}
    choosing = tissue_clips(body, motions.chosen_by, others["choosing"], 2)
    choices: dict[str, Any] = {}
    for name, plan in TRIED.items():
        tissue = train_tissue(body, learned, plan)
        found = measured(tissue, body, choosing)["together"]
        choices[name] = found | {"spectral_radius": tissue.spectral_radius}
        print(name, json.dumps(choices[name]), flush=True)
    learned = tissue_clips(body, (*motions.learned, *motions.chosen_by), everyone, EACH)
    test = tissue_clips(body, motions.test, others["test"], 2)
    result: dict[str, Any] = {
        "left_out": motions.left_out,
        "learned": {"clips": len(learned), "frames": sum(len(c.motion) for c in learned)},
        "people": {"learned": PEOPLE, **{name: len(some) for name, some in others.items()}},
        "seeds": {"learned": SEED, **{name: seed for name, (_, seed) in UNSEEN.items()}},
        "choices": choices,
    }
    for name in ("no forces on parts", "as embedded"):
        tissue = train_tissue(body, learned, TRIED[name])
        shaken = tissue.vertices(body, violent(body)) - violent(body).vertices(body)
        one = one_step_of(tissue, body, learned)
        result[name] = measured(tissue, body, test) | {
            "spectral_radius": tissue.spectral_radius,
            "power_of_body_mass_index": tissue.power,
            "one_step_error": one_step(tissue, body, test),
            "inputs_that_never_move": [
                name
                for name, x in zip(factor_names(tissue), one.regressors.T, strict=True)
                if not x.any()
            ],
            "unknowns_of_a_coefficient": one.regressors.shape[1],
            "rank": one_step_problem(one, tissue).linearize(one_step_start(tissue)).rank,
            "violent_motion_mm": 1e3 * float(np.linalg.norm(shaken, axis=-1).max()),
        }
        print(name, json.dumps(result[name]["together"]), flush=True)
    result["cpu_s"] = time.process_time() - began
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    write_page(result)


def write_page(result: dict[str, Any]) -> None:
    """The tables of TISSUE.md, after the mark."""
    text = PAGE.read_text().split(MARK)[0]
    PAGE.write_text(text + MARK + tables(result))


def tables(result: dict[str, Any]) -> str:
    """What was found as Markdown."""
    lines = [
        "Held-out clips, and people that nothing was learned from:",
        "",
        "| inputs | explained | 95 % interval | worst motion | a frame ahead off by | "
        "spectral radius |",
        "| --- | --: | --: | --: | --: | --: |",
    ]
    for name, told in (("no forces on parts", "Dyna's"), ("as embedded", "and forces on parts")):
        one, all_of_them = result[name], result[name]["together"]
        low, high = all_of_them["interval_95"]
        lines.append(
            f"| {told} | {100 * all_of_them['explained']:.0f} % | "
            f"{100 * low:.0f} to {100 * high:.0f} % | {100 * all_of_them['worst_clip']:.0f} % | "
            f"{100 * one['one_step_error']:.1f} % | {one['spectral_radius']:.3f} |"
        )
    lines += [
        "",
        "Each of these motions, with forces on parts:",
        "",
        "| clip | frames | body mass index | explained | tissue, rms mm | left, rms mm | "
        "largest mm | the directions could explain |",
        "| --- | --: | --: | --: | --: | --: | --: | --: |",
    ]
    lines += [
        f"| {row['clip']} | {row['frames']} | {row['body_mass_index']:.1f} | "
        f"{100 * row['explained']:.0f} % | {row['rms_mm']:.1f} | {row['error_mm']:.1f} | "
        f"{row['largest_mm']:.0f} | {100 * row['directions_hold']:.0f} % |"
        for row in result["as embedded"]["each"]
    ]
    lines += [
        "",
        "What was tried on the clips for choices:",
        "",
        "| | explained | 95 % interval | worst motion | spectral radius |",
        "| --- | --: | --: | --: | --: |",
    ]
    for name, one in result["choices"].items():
        low, high = one["interval_95"]
        lines.append(
            f"| {name} | {100 * one['explained']:.0f} % | {100 * low:.0f} to {100 * high:.0f} % | "
            f"{100 * one['worst_clip']:.0f} % | {one['spectral_radius']:.3f} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
