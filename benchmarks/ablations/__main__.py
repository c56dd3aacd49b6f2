"""What each term of training does, in numbers.

    python -m benchmarks.ablations FOLDER --out PLACE [--rounds 2]

`FOLDER` holds `train` and `held_out` as `builder/sets.py` writes them.
"""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.ablations.study import Ablated, Sets, ablate, turn_errors
from workbench.bodies.catalogue import load_skinned
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.reports.page import as_json
from workbench.training.estimate import Sigmas
from workbench.training.first_guess import read_start
from workbench.training.folder import open_folder
from workbench.writing import replacing

PEOPLE = 60  # whose poses are fitted to edges and to vertices


def in_words(result: Ablated) -> str:
    """The numbers of one training as a line of text."""
    shares = ", ".join(f"{100 * share:.1f}" for share in result.pose_in_shape)
    return (
        f"{result.name:20} training {1e3 * result.training_rms:.3f} mm per coordinate, held out "
        f"{1e3 * result.held_out_rms:.3f} mm per vertex, asymmetry {1e3 * result.asymmetry:.3f} "
        f"mm, posedirs {1e3 * result.posedirs_rms:.3f} mm, pose in shape {shares} %"
    )


def write_ablations(results: Sequence[Ablated], place: Path, body: str) -> None:
    """Write `ablations.json`."""
    model = load_skinned(body)
    poses = draw_poses(shipped_mixture(), PEOPLE, np.random.default_rng(0))
    errors = turn_errors(model, poses, seed=1)
    place.mkdir(parents=True, exist_ok=True)
    said = {
        "results": [asdict(result) for result in results],
        "mean_error_degrees": {n: float(np.degrees(e[:, 1:].mean())) for n, e in errors.items()},
    }
    with replacing(place / "ablations.json") as temporary:
        temporary.write_text(as_json(said), encoding="utf-8")


def main() -> None:
    """Parse, train, print, write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ablations")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--body", default="small", help="whose pose is fitted by edges or vertices")
    arguments = parser.parse_args()
    start = read_start(arguments.folder / "train" / "start.npz")
    train, held_out = (
        open_folder(arguments.folder / name, len(start.template), start.faces)
        for name in ("train", "held_out")
    )
    sets = Sets(train.only("poses"), train.only("shapes"), held_out.only("poses"), start)
    results = ablate(
        sets,
        Sigmas(),
        rounds=arguments.rounds,
        done=lambda result: print(in_words(result), flush=True),
    )
    write_ablations(results, arguments.out, arguments.body)


if __name__ == "__main__":
    main()
