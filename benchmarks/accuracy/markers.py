"""Shape and offsets from 41 synthetic markers on `default`, in held-out poses.

60 frames of clips that are held out of the pose prior (`PoseRecording.split`), of which the 12 that
differ most are fitted; noise of 1 mm along each axis, 5 % missing, and offsets 5 mm along each axis
from their nominal places. A second person wears markers of the nominal height, displaced by 5 mm
along each of two directions of the surface; they are fitted as if nothing was known of their
heights, and with heights that are known to 1 mm. Settings were chosen on poses of the other clips.
"""

import time
from typing import Any

import numpy as np

from benchmarks.accuracy import RECORDING, needed
from benchmarks.measuring import table
from builder.recordings import read_recording
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.experiments.moving_people import Placed, dressed_person, true_measures
from workbench.fitting import default_markers, marker_fit, marker_solver, spread_frames
from workbench.fitting.marker_sets import MarkerSet
from workbench.fitting.markers import surface_frames
from workbench.geometry.surface_tree import SurfaceTree

FRAMES, CHOSEN, NOISE, MISSING, APART = 60, 12, 0.001, 0.05, 0.005
SEEDS = 8


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


ROWS: dict[str, tuple[Placed | None, float | None]] = {  # placed how, and sd of heights, m
    "markers anywhere": (None, None),
    "markers on the surface": (on_the_surface, None),
    "the same, heights known to 1 mm": (on_the_surface, 0.001),
}


def fitted(
    body: SkinnedBody, worn: MarkerSet, poses: Array, seed: int, placed: Placed | None, across: Any
) -> dict[str, float]:
    """One fit to chosen frames: errors in mm at its start and at its end, and CPU seconds."""
    rng = np.random.default_rng((seed, 41))
    some = np.sort(rng.choice(len(poses), FRAMES, replace=False))
    truth, observed = dressed_person(body, worn, poses[some], rng, NOISE, MISSING, APART, placed)
    begin = time.process_time()
    chosen = observed[spread_frames(observed, CHOSEN)]
    setup = marker_fit(chosen, body, worn, sigma=NOISE, across=across)
    solution = marker_solver().solve(setup.problem, setup.start)
    seconds = time.process_time() - begin
    before, after = (
        true_measures(body, at, truth) for at in (setup.start, setup.start | solution.values)
    )
    return {
        "shape before": before[0].value,
        "offsets before": before[1].value,
        "shape": after[0].value,
        "offsets": after[1].value,
        "seconds": seconds,
    }


def measured(quick: bool) -> dict[str, object]:
    """Each row with every seed."""
    body, (_, held_out) = load_body("default"), read_recording(needed(RECORDING)).split()
    worn, seeds = default_markers(body), range(1 if quick else SEEDS)
    return {
        name: [fitted(body, worn, held_out.poses, seed, *how) for seed in seeds]
        for name, how in ROWS.items()
    }


def tables(found: dict[str, Any]) -> str:
    """Means over seeds."""
    columns = {"shape before": 1, "offsets before": 2, "shape": 2, "offsets": 2, "seconds": 1}
    rows = [
        (name, *(f"{np.mean([run[key] for run in runs]):.{n}f}" for key, n in columns.items()))
        for name, runs in found.items()
    ]
    seeds = len(next(iter(found.values())))
    head = (f"{seeds} people", "shape before, mm", "offsets before, mm", "shape, mm", "offsets, mm")
    return table((*head, "CPU s"), rows)
