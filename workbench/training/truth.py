"""What made-up registrations were made from, kept beside them to be compared with."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import check_numbers, read_expected, reals, wholes
from workbench.writing import replacing

Array = NDArray[np.float64]
FILE = "truth.npz"
EXPECTED = {
    "rest": reals("S", "N", 3),
    "joints": reals("S", "K", 3),
    "subject": wholes("J"),
    "poses": reals("J", "K", 3),
    "trans": reals("J", 3),
    "weights": reals("N", "K"),
}


@dataclass(frozen=True, eq=False)
class Truth:
    """S people in J poses, and the rig that linear blend skinning would use."""

    rest: Array  # (S, N, 3) m
    joints: Array  # (S, K, 3) m
    subject: NDArray[np.int64]  # (J,)
    poses: Array  # (J, K, 3) rad, the root's turn included
    trans: Array  # (J, 3) m
    weights: Array  # (N, K)

    def save(self, folder: Path) -> None:
        """As `truth.npz`."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        with replacing(folder / FILE) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **arrays)


def read_truth(folder: Path) -> Truth:
    """As saved. Raises BadFile if the registrations there were not made up, or it is damaged."""
    path = folder / FILE
    if not path.is_file():
        raise BadFile(
            f"{path} does not exist: what these registrations were made from is not known; "
            "`python -m workbench.training.sets` makes registrations that come with it"
        )
    with taken_for(path, "record of what registrations were made from", "make them anew"):
        with open_arrays(path) as archive:
            arrays = read_expected(archive, EXPECTED)
        check_numbers("subject", arrays["subject"], len(arrays["rest"]))
    return Truth(**arrays)
