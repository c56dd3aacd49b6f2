"""The ground truth of synthetic registrations, stored beside them."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from workbench.arrays import Array, Index
from workbench.errors import BadFile
from workbench.reading.arrays import check_numbers, opened, read_expected, reals, wholes
from workbench.writing import write_arrays

FILE = "truth.npz"
CARD = "made.json"  # beside it: how the registrations were made
EXPECTED = {
    "rest": reals("S", "N", 3),
    "joints": reals("S", "K", 3),
    "subject": wholes("J"),
    "poses": reals("J", "K", 3),
    "trans": reals("J", 3),
    "weights": reals("N", "K"),
}


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """S people in J poses, and the rig that linear blend skinning would use.

    Attributes:
        rest: (S, N, 3) m.
        joints: (S, K, 3) m.
        subject: (J,).
        poses: (J, K, 3) rad, the root's turn included.
        trans: (J, 3) m.
        weights: (N, K).
    """

    rest: Array
    joints: Array
    subject: Index
    poses: Array
    trans: Array
    weights: Array

    def save(self, folder: Path) -> None:
        """Write it as `truth.npz` into a folder."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        write_arrays(folder / FILE, arrays)


def read_ground_truth(folder: Path) -> GroundTruth:
    """Read the ground truth in a folder.

    Raises BadFile if there is none, because the registrations are not synthetic, or it is damaged.
    """
    path = folder / FILE
    if not path.is_file():
        raise BadFile(
            f"{path} does not exist: what these registrations were made from is not known; "
            "`python -m builder.sets`, in a checkout, makes registrations that come with it"
        )
    what = "record of what registrations were made from"
    with opened(path, what, "make them anew") as archive:
        arrays = read_expected(archive, EXPECTED)
        check_numbers("subject", arrays["subject"], len(arrays["rest"]))
    return GroundTruth(**arrays)
