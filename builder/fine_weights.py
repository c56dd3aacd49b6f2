"""The weights of the finer rig, 24 joints and 8 half limbs, as they are shipped."""

from pathlib import Path
from typing import Any

import numpy as np

from builder.base_mesh import read_base_mesh, read_rig, read_topology
from builder.packing import write_arrays
from builder.wheel import Wheel
from workbench.synthetic.teacher import BODIES, FILE_NAME, SHARES


def write_fine_weights(wheel: Wheel, folder: Path) -> Path:
    """Write `fine_weights.npz`: for each body the shares (N, 32) of 32,768 that are not zero."""
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    arrays: dict[str, Any] = {}
    for name in BODIES:
        weights = read_topology(wheel, name, mesh).follows @ rig.fine_weights
        shares = np.rint(weights * SHARES).astype(np.int64)
        shares[np.arange(len(shares)), shares.argmax(axis=1)] += SHARES - shares.sum(axis=1)
        rows, columns = np.nonzero(shares)
        arrays |= {
            f"{name}_rows": rows.astype(np.uint16),
            f"{name}_columns": columns.astype(np.uint8),
            f"{name}_shares": shares[rows, columns].astype(np.uint16),
        }
    path = folder / FILE_NAME
    write_arrays(path, arrays)
    return path
