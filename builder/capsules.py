"""Capsules of the embedded bodies, fitted to people of their own shape spaces.

    python -m builder.capsules --out workbench/data/bodies

The bodies must be there; neither the wheel nor a recording is needed. It takes three minutes.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from builder.stored import write_arrays
from workbench.bodies import Capsules, SkinnedBody, capsule_gaps, capsules_of
from workbench.bodies.capsule_fitting import fit_capsules
from workbench.bodies.catalogue import Embedded, read_embedded
from workbench.geometry.mirror import opposite
from workbench.priors.poses import draw_poses, shipped_mixture

DRAWS, OFTEN = 4_000, 2  # poses of the prior, and in how many of them a pair overlaps at least


def touching(body: SkinnedBody) -> Capsules:
    """The capsules of a body with the pairs that overlap in at least 2 of 4,000 draws of the prior.

    Poses are drawn and betas are not: it is the mean person who takes them. A pair and its mirror
    image count together. Pairs such as a foot and the head, which never meet, only cost time.
    """
    poses = draw_poses(shipped_mixture(), DRAWS, np.random.default_rng(0))
    capsules = capsules_of(body)
    overlaps = (capsule_gaps(body, poses) < 0).sum(axis=0)
    pairs = [frozenset(capsules.names[k] for k in pair) for pair in capsules.pairs]
    counts = dict(zip(pairs, overlaps.tolist(), strict=True))
    met = [_with_mirrored(pair, counts) >= OFTEN for pair in pairs]
    return replace(capsules, pairs=capsules.pairs[met])


def _with_mirrored(pair: frozenset[str], counts: dict[frozenset[str], int]) -> int:
    """How often a pair overlaps, and its mirror image, if that is another one."""
    mirrored = frozenset(opposite(name) for name in pair)
    return counts[pair] + (counts.get(mirrored, 0) if mirrored != pair else 0)


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
