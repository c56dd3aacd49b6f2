"""The command `python -m benchmarks.images.choices RECORDING`: which answer to give for an image.

A fit from eight starts ends in several minima. Answers that could be given are compared with the
truth: the first start's, the lowest, the one of most evidence by Laplace's approximation, the one
nearest to all on average, the mean of all landmarks by these weights, and the mean of the posterior
about the first one's. The images are those that settings were chosen on: every eighth frame of
`balance`, and synthetic people other than those that are reported.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import softmax

from benchmarks import machine
from benchmarks.images.limbs import HIPS, limbs, mpjpe
from benchmarks.images.one_camera import Case, balance_cases, errors, synthetic_cases
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.fitting.images import ImageFits
from workbench.fitting.setup import Setup
from workbench.priors.recordings import held_out_poses
from workbench.sampling import posterior_mean

HERE = Path(__file__).parents[1]
RESULTS, PAGE = HERE / "results" / "images-choices.json", HERE / "IMAGES.md"
MARKS = (
    "<!-- choices: written by `python -m benchmarks.images.choices` -->",
    "<!-- choices: end -->",
)
STARTS, NEAR = 8, 1.0  # minima within this cost of the lowest are counted
FRAMES, SEEDS = range(2, 100, 8), range(1000, 1120)
DRAWS = 120  # of Laplace's approximation, half of them mirrored
SCENES = {"balance": "`balance`", "people": "synthetic people"}


def answers(body: SkinnedBody, fits: ImageFits, case: Case) -> tuple[dict[str, Array], list[float]]:
    """Limbs (12, 3) m by the name of the answer, about the hips, and the costs of all minima."""
    given = {"question": "", "held_out": case.held_out}
    setup = fits.setup(case.observed, hypotheses=STARTS, **given)
    assert setup.strategy is not None
    found = setup.strategy(None).solve(setup.problem, setup.start).hypotheses
    ends = [setup.start | one.values for one in found]
    costs = np.array([one.cost for one in found])
    places = np.array([of_hips(limbs_of(body, end)) for end in ends])
    first = next(i for i, one in enumerate(found) if 0 in one.starts)
    H = [here.dense.T @ here.dense for here in map(setup.problem.linearize, ends)]
    evidence = -costs - 0.5 * np.array([np.linalg.slogdet(one)[1] for one in H])
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1).mean(axis=-1)
    shares = softmax(evidence)
    mean = posterior_mean(setup.problem, ends[first])
    told = {
        "the first start's": places[first],
        "the lowest": places[int(costs.argmin())],
        "of most evidence": places[int(evidence.argmax())],
        "nearest to all": places[int((apart @ shares).argmin())],
        "mean of the minima": np.einsum("h,hij->ij", shares, places),
        "mean of Laplace's draws": of_laplace(body, setup, ends[first], H[first]),
        "mean of the posterior": of_hips(limbs_of(body, mean.values)),
    }
    true = limbs(body, case.truth)
    told["nearest to the truth"] = min(places, key=lambda one: mpjpe(one, true))
    return told, list(costs)


def limbs_of(body: SkinnedBody, values: Values) -> Array:
    """Limb landmarks (12, 3) m of a body."""
    return limbs(body, body.landmark("coco", *(values[block.name] for block in body.blocks())))


def of_hips(places: Array) -> Array:
    """Limbs (..., 12, 3) m about the middle of the hips."""
    return np.asarray(places - places[..., HIPS, :].mean(axis=-2, keepdims=True))


def of_laplace(body: SkinnedBody, setup: Setup, values: Values, H: Array) -> Array:
    """The mean of limbs of Laplace's approximation at a minimum, by draws, about the hips."""
    z = np.random.default_rng(0).standard_normal((DRAWS // 2, len(H)))
    x, fixed = setup.problem.split(values)
    moved = np.linalg.solve(np.linalg.cholesky(H).T, np.concatenate([z, -z]).T).T
    drawn = [limbs_of(body, setup.problem.values(x + one, fixed)) for one in moved]
    return np.asarray(of_hips(np.array(drawn)).mean(axis=0))


def measured(body: SkinnedBody, cases: Sequence[Case]) -> dict[str, Any]:
    """MPJPE and PA in mm of every answer in every case, and how many minima there were."""
    fits = ImageFits(body)
    found: dict[str, Any] = {"minima": [], "near the lowest": []}
    for case in cases:
        told, costs = answers(body, fits, case)
        found["minima"].append(len(costs))
        found["near the lowest"].append(int(sum(cost < min(costs) + NEAR for cost in costs)))
        for name, places in told.items():
            row = found.setdefault(name, {"MPJPE": [], "PA": []})
            off = errors(places, limbs(body, case.truth))
            for what, values in row.items():
                values.append(off[what])
    return found


def names(found: dict[str, Any]) -> list[str]:
    """The answers that were compared."""
    return [name for name, each in found["balance"].items() if isinstance(each, dict)]


def table(found: dict[str, Any]) -> str:
    """The means of all answers."""
    heads = [
        f"{title} ({len(found[scene]['minima'])}): MPJPE, mm | PA, mm"
        for scene, title in SCENES.items()
    ]
    lines = [f"| answer | {' | '.join(heads)} |", "| --- |" + " --: |" * 2 * len(SCENES)]
    for name in names(found):
        cells = (f"{np.mean(found[scene][name][k]):.1f}" for scene in SCENES for k in MEASURES)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


MEASURES = "MPJPE", "PA"


def main() -> None:
    """Compare, keep the numbers, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, help="motion capture (.npz)")
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    options = parser.parse_args()
    body = load_body("default")
    people = synthetic_cases(body, held_out_poses(options.recording), SEEDS, 0)
    found = {
        "balance": measured(body, list(balance_cases(body, FRAMES))),
        "people": measured(body, list(people)),
    }
    print(table(found))
    if not options.dry:
        keep(RESULTS, found | {"machine": machine.description()}, 4)
        write_between(PAGE, *MARKS, table(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
