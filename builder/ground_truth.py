"""What synthetic registrations were made from, and the least errors that skinning can have on them.

`ideal_skinning_errors` gives the ground truth to linear blend skinning, alone and with the best
linear predictor of blend shapes, which is learned from the true un-posed errors.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from builder.ridge import Pair, RidgeSums, ridge_learned
from builder.training import training_and_held_out
from workbench.arrays import Array, Index
from workbench.errors import BadFile
from workbench.reading.arrays import check_numbers, opened, read_expected, reals, wholes
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.evaluation import mean_and_rms, vertex_distances
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.registrations import (
    Registrations,
    RegistrationSubset,
    batches,
)
from workbench.writing import write_arrays

FILE = "truth.npz"
AT_REST = "people.npz"  # above both sets: everybody at rest, `train` and `held_out` (P, N, 3) m
EXPECTED = {
    "rest": reals("S", "N", 3),
    "joints": reals("S", "K", 3),
    "subject": wholes("J"),
    "poses": reals("J", "K", 3),
    "trans": reals("J", 3),
    "weights": reals("N", "K"),
}
RIDGES = (1e-3, 3e-3, 1e-2, 3e-2)  # per pose


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


def ideal_skinning_errors(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None
) -> dict[str, float]:
    """The errors of ideal skinning in mm, as a model card lists them.

    They are those of linear blend skinning alone and, given `posedirs`, with these blend shapes.
    """
    alone = errors_of_ideal_skinning(truth, registrations, start)
    mean, rms = mean_and_rms(alone)
    found = {"ideal_skinning_mean_mm": mean, "ideal_skinning_rms_mm": rms}
    if posedirs is not None:
        best = errors_of_ideal_skinning(truth, registrations, start, posedirs)
        found["ideal_linear_mean_mm"], found["ideal_linear_rms_mm"] = mean_and_rms(best)
    return found


def ideal_skinning(
    truth: GroundTruth, parents: tuple[int, ...], posedirs: Array | None = None
) -> Estimate:
    """The estimate that training would have to find: the ground truth itself."""
    K, N = len(parents), truth.rest.shape[1]
    P = np.zeros((N, 3, 9 * (K - 1))) if posedirs is None else posedirs
    return Estimate(truth.rest, truth.joints, P, truth.weights, truth.poses, parents)


def errors_of_ideal_skinning(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None = None
) -> Array:
    """The distances (J, N) m that linear blend skinning leaves with the ground truth."""
    estimate = ideal_skinning(truth, start.parents, posedirs)
    held = Objective(registrations, start.rings(), truth.weights, None, Sigmas())
    return vertex_distances(held, estimate)


def best_linear(truth: GroundTruth, registrations: Registrations, start: Start) -> Array:
    """Posedirs (N, 3, F) by ridge regression of the true un-posed errors.

    The ridge is chosen by the errors on a fifth of the subjects, which is held out until then.
    """
    learned, held_out = (
        RidgeSums.of(_errors(truth, registrations, start, rows)).with_reflections(start.mirror())
        for rows in training_and_held_out(truth.subject)
    )
    whole = np.ones_like(learned.products[:, 0], dtype=bool)
    found, _ = ridge_learned(learned, held_out, whole, RIDGES)
    return found


def _errors(
    truth: GroundTruth, registrations: Registrations, start: Start, rows: Index
) -> Iterator[Pair]:
    """Features, and what must be added at rest for skinning to be right."""
    estimate = replace(ideal_skinning(truth, start.parents), poses=truth.poses[rows])
    for batch in batches(RegistrationSubset(registrations, rows)):
        passed = SkinningPass.of(estimate, batch.some, batch.subject)
        away = batch.vertices - truth.trans[rows[batch.some], None] - passed.points
        yield passed.features, passed.at_rest(away)
