"""Capsules of the embedded bodies, fitted to people of their own shape spaces.

    python -m builder.capsules --out workbench/data/bodies

The bodies must be there; neither the wheel nor a recording is needed. It takes about a minute.
"""

import argparse
from pathlib import Path
from typing import Any, get_args

from numpy.typing import NDArray

from builder.packing import write_arrays
from workbench.bodies.capsule_fitting import fit_capsules
from workbench.bodies.catalogue import Embedded
from workbench.bodies.files.embedded import read_embedded


def write_capsules(folder: Path) -> Path:
    """Write `capsules.npz`, the capsules of every skinned body in the folder, under its name."""
    arrays: dict[str, NDArray[Any]] = {}
    for name in get_args(Embedded):
        capsules = fit_capsules(read_embedded(folder / f"{name}.npz"))
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
