"""The command `python -m benchmarks.images.markers RECORDING`: shape and offsets from 41 markers.

Synthetic markers on `default`, in poses of clips that are held out of the pose prior
(`priors.mocap.Mocap.split`): 60 frames of which 12 are chosen, noise of 1 mm along each axis, 5 %
missing, and offsets 5 mm along each axis from their nominal places. Every choice of frames gets the
same markers. Numbers go to `results/markers.json`. With `--tuning` the poses are those of the other
clips, and nothing is kept: settings were chosen there.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.keeping import keep
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.experiments.markers import dressed_person, true_measures
from workbench.fitting import (
    default_markers,
    informative_frames,
    marker_fit,
    marker_solver,
    random_frames,
    spread_frames,
)
from workbench.fitting.marker_frames import Choice
from workbench.fitting.marker_sets import MarkerSet
from workbench.priors.mocap import read_mocap

RESULTS = Path(__file__).parent.parent / "results" / "markers.json"
FRAMES, CHOSEN, NOISE, MISSING, APART = 60, 12, 0.001, 0.05, 0.005


def fitted(
    body: SkinnedBody, worn: MarkerSet, poses: Array, seed: int, choose: Choice
) -> dict[str, float]:
    """One fit to chosen frames: errors in mm at its start and at its end, and CPU seconds."""
    rng = np.random.default_rng((seed, 41))
    some = np.sort(rng.choice(len(poses), FRAMES, replace=False))
    truth, observed = dressed_person(body, worn, poses[some], rng, NOISE, MISSING, APART)
    begin = time.process_time()
    chosen = choose(observed, CHOSEN)
    choosing = time.process_time() - begin
    setup = marker_fit(observed[chosen], body, worn, sigma=NOISE)
    solution = marker_solver().solve(setup.problem, setup.start)
    seconds = time.process_time() - begin - choosing
    values = setup.start | solution.values
    before, after = (true_measures(body, at, truth) for at in (setup.start, values))
    return {
        "shape_before": before[0].value,
        "offsets_before": before[1].value,
        "shape": after[0].value,
        "offsets": after[1].value,
        "choosing_seconds": choosing,
        "seconds": seconds,
    }


def main() -> None:
    """Fit every seed with every choice of frames, print a table, and keep the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--tuning", action="store_true")
    given = parser.parse_args()
    body = load_body("default")
    worn = default_markers(body)
    learned, held_out = read_mocap(given.recording).split()
    poses = (learned if given.tuning else held_out).poses
    rows: dict[str, list[dict[str, float]]] = {}
    for seed in range(given.seeds):
        for name, choose in (
            ("random", random_frames(seed)),
            ("spread", spread_frames),
            ("informative", informative_frames(body, worn, sigma=NOISE)),
        ):
            found = fitted(body, worn, poses, seed, choose)
            rows.setdefault(name, []).append(found)
            print(f"{seed:3} {name:12}", *(f"{found[n]:6.2f}" for n in found), flush=True)
    found_all: dict[str, Any] = {"rows": rows, "machine": machine.description()}
    for name, several in rows.items():
        means = {key: float(np.mean([row[key] for row in several])) for key in several[0]}
        print(f"mean {name:12}", {key: round(value, 2) for key, value in means.items()})
    if not given.tuning:
        keep(RESULTS, found_all, 4)


if __name__ == "__main__":
    main()
