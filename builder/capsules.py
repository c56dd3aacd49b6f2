"""Capsules of the embedded bodies, fitted to people of their own shape spaces.

    python -m builder.capsules --out workbench/data/bodies

The bodies must be there; neither the wheel nor a recording is needed. It takes about a minute.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from builder.packing import write_arrays
from workbench.bodies import Capsules, SkinnedBody, capsule_gaps, capsules_of
from workbench.bodies.capsule_fitting import fit_capsules
from workbench.bodies.catalogue import Embedded
from workbench.bodies.files.embedded import read_embedded
from workbench.priors.poses import draw_poses, shipped_mixture

DRAWS, NEAR = 4_000, 0.02  # poses of the prior, and m


def touching(body: SkinnedBody) -> Capsules:
    """The capsules of a body with the pairs that come within 2 cm in 4,000 draws of the prior.

    Pairs such as a foot and the head, which never meet, only cost time.
    """
    poses = draw_poses(shipped_mixture(), DRAWS, np.random.default_rng(0))
    capsules = capsules_of(body)
    near = (capsule_gaps(body, poses) < NEAR).any(axis=0)
    return replace(capsules, pairs=capsules.pairs[near])


def write_capsules(folder: Path) -> Path:
    """Write `capsules.npz`, the capsules of every skinned body in the folder, under its name."""
    arrays: dict[str, NDArray[Any]] = {}
    for name in get_args(Embedded):
        body = read_embedded(folder / f"{name}.npz")
        capsules = touching(replace(body, capsules=fit_capsules(body)))
        arrays |= {f"{name}/{key}": array for key, array in capsules.arrays().items()}
    path = folder / "capsules.npz"
    write_arrays(path, arrays)
    return path


def main() -> None:
    """Parse, fit, write."""
    parser = argparse.ArgumentParser(prog="python -m builder.capsules")
    parser.add_argument("--out", type=Path, required=True, help="folder of the bodies")
    print(f"wrote {write_capsules(parser.parse_args().out)}")


if __name__ == "__main__":
    main()
