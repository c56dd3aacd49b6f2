"""The command `python -m benchmarks.images.markers RECORDING`: shape and offsets from 41 markers.

Synthetic markers on `default`, in poses of clips that are held out of the pose prior
(`PoseRecording.split`): 60 frames of which 12 are chosen, noise of 1 mm along each axis, 5 %
missing, and offsets 5 mm along each axis from their nominal places. A second person wears markers
of the nominal height, displaced by 5 mm along each of two directions of the surface; they are
fitted as if nothing was known of their heights, and with heights that are known to 1 mm. Numbers go
to `results/markers.json`. With `--tuning` the poses are those of the other clips, and nothing is
kept: settings were chosen there.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.keeping import keep
from workbench import load_body
from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.experiments.moving_people import (
    Placed,
    dressed_person,
    true_measures,
)
from workbench.fitting import (
    default_markers,
    marker_fit,
    marker_solver,
    spread_frames,
)
from workbench.fitting.marker_sets import MarkerSet
from workbench.fitting.markers import surface_frames
from workbench.geometry.surface_tree import SurfaceTree
from workbench.priors.recordings import read_recording

RESULTS = Path(__file__).parent.parent / "results" / "markers.json"
FRAMES, CHOSEN, NOISE, MISSING, APART = 60, 12, 0.001, 0.05, 0.005
ACROSS = 0.001  # m: how well heights are known, where they are


def on_the_surface(
    body: SkinnedBody, worn: MarkerSet, betas: Array, apart: float, rng: np.random.Generator
) -> Array:
    """Offsets (M, 3) m of markers somewhere on the person at rest, all of the nominal height.

    The place is the vertex, displaced in two directions along the surface by normally distributed
    lengths with a standard deviation of `apart` m each, and brought back to the surface. The centre
    is straight above it, as far from the surface as the nominal one is from its vertex.
    """
    vertices = body.vertices(betas=betas)
    feet = vertices[worn.vertices]
    along = surface_frames(body, worn)[:, :2]
    lengths = apart * rng.normal(size=(len(feet), 2))
    towards = feet + worn.nominal + np.einsum("md,mdi->mi", lengths, along)
    places = SurfaceTree(vertices, body.faces).closest(towards).points
    up = towards - places
    up *= np.linalg.norm(worn.nominal, axis=1, keepdims=True) / np.linalg.norm(
        up, axis=1, keepdims=True
    )
    return np.asarray(places + up - feet)


def fitted(
    body: SkinnedBody,
    worn: MarkerSet,
    poses: Array,
    seed: int,
    choose: Callable[[Array, int], Index],
    placed: Placed | None,
    across: float | None,
) -> dict[str, float]:
    """One fit to chosen frames: errors in mm at its start and at its end, and CPU seconds."""
    rng = np.random.default_rng((seed, 41))
    some = np.sort(rng.choice(len(poses), FRAMES, replace=False))
    truth, observed = dressed_person(body, worn, poses[some], rng, NOISE, MISSING, APART, placed)
    begin = time.process_time()
    chosen = choose(observed, CHOSEN)
    choosing = time.process_time() - begin
    setup = marker_fit(observed[chosen], body, worn, sigma=NOISE, across=across)
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
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--only", nargs="+", help="names of rows, all if not given")
    parser.add_argument("--tuning", action="store_true")
    given = parser.parse_args()
    body = load_body("default")
    worn = default_markers(body)
    learned, held_out = read_recording(given.recording).split()
    poses = (learned if given.tuning else held_out).poses
    rows: dict[str, list[dict[str, float]]] = {}
    for seed in range(given.seeds):
        for name, choose, placed, across in (
            ("spread", spread_frames, None, None),
            ("on the surface", spread_frames, on_the_surface, None),
            ("on the surface, heights known", spread_frames, on_the_surface, ACROSS),
        ):
            if given.only and name not in given.only:
                continue
            found = fitted(body, worn, poses, seed, choose, placed, across)
            rows.setdefault(name, []).append(found)
            print(f"{seed:3} {name:30}", *(f"{found[n]:6.2f}" for n in found), flush=True)
    for name, several in rows.items():
        means = {key: float(np.mean([row[key] for row in several])) for key in several[0]}
        print(f"mean {name:12}", {key: round(value, 2) for key, value in means.items()})
    if not given.tuning:
        before = json.loads(RESULTS.read_text())["rows"] if RESULTS.is_file() else {}
        told: dict[str, Any] = {"rows": before | rows, "machine": machine.description()}
        keep(RESULTS, told, 4)


if __name__ == "__main__":
    main()
