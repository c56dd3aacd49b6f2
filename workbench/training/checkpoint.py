"""The checkpoint that a training writes after every block, so that it can be continued."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.validation import ROW_SUM_TOLERANCE
from workbench.errors import BadFile, listed, shown
from workbench.reading.arrays import doubles, nothing_else, opened, optional, read_expected, texts
from workbench.reading.facts import amount, facts, facts_in, number
from workbench.training.estimate import Estimate
from workbench.training.execution import LogEntry
from workbench.training.registrations import FARTHEST, Registrations, batches
from workbench.writing import replacing

VERSION = "2:"  # of fingerprints
FILE, FACTS, FORMER_FACTS = "checkpoint.npz", "facts", "said"  # the former name is read as well
SHARES = ("weights", "regressor")  # the arrays whose rows sum to one
REMOVE = "remove it to start anew, or choose another folder"


@dataclass(frozen=True, eq=False)
class TrainingCheckpoint:
    """The state of a training after a block.

    Attributes:
        estimate: what was found so far.
        log: the blocks that have run.
        fingerprint: identifies the training, see `fingerprint`.
    """

    estimate: Estimate
    log: tuple[LogEntry, ...]
    fingerprint: str

    def save(self, folder: Path) -> None:
        """Write the file in `folder`, completely or not at all."""
        stored = {
            "fingerprint": self.fingerprint,
            "parents": list(self.estimate.parents),
            "log": [asdict(entry) for entry in self.log],
        }
        arrays: dict[str, Any] = {FACTS: np.array(json.dumps(stored)), **self.estimate.arrays()}
        with replacing(folder / FILE) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)


def read_checkpoint(
    folder: Path, fingerprint: str, first: Estimate, blocks: Sequence[str]
) -> TrainingCheckpoint | None:
    """The checkpoint of an earlier run in `folder`, or None if there is no file.

    `first` is the estimate that the run began with, whose sizes and tree do not change; `blocks`
    are those of its plan, in order. Raises BadFile if the file belongs to another training, was
    written by another version, or is damaged.
    """
    path = folder / FILE
    if not path.exists():
        return None
    with opened(path, "checkpoint of this training", REMOVE) as archive:
        named = FORMER_FACTS if FORMER_FACTS in archive.headers else FACTS
        stored = facts_in(read_expected(archive, {named: texts()})[named])
        if (digest := stored.text("fingerprint")) != fingerprint:
            raise BadFile(
                "it is of other registrations, another start or another plan"
                if digest.startswith(VERSION)
                else "another version of the workbench wrote it, which cannot be continued"
            )
        if stored.several("parents", lambda parent, _: parent) != first.parents:
            raise BadFile(f"its tree has the parents {shown(stored.entries['parents'])}")
        log = stored.several("log", log_entry)
        if [entry.block for entry in log] != list(blocks[: len(log)]):
            raise BadFile("its log tells of other blocks than the plan's")
        expected = {name: doubles(*array.shape) for name, array in first.arrays().items()}
        regressor_shape = doubles(*first.weights.T.shape)
        learned = any(entry.block == "regressor" for entry in log)  # and kept from there on
        expected["regressor"] = regressor_shape if learned else optional(regressor_shape)
        nothing_else(archive, (*expected, named))
        arrays = read_expected(archive, expected)
        for name, array in arrays.items():
            if abs(array).max(initial=0) > FARTHEST:
                raise BadFile(f"{name} holds {abs(array).max():.3g}, as no training leaves it")
            if name in SHARES and (
                array.min(initial=0) < 0 or (abs(array.sum(axis=1) - 1) > ROW_SUM_TOLERANCE).any()
            ):
                raise BadFile(f"{name} are no shares: some are negative, or do not sum to 1")
    regressor = csr_array(arrays.pop("regressor")) if "regressor" in arrays else None
    estimate = Estimate(**arrays, parents=first.parents, regressor=regressor)
    return TrainingCheckpoint(estimate, log, fingerprint)


def log_entry(stored: object, name: str) -> LogEntry:
    """An entry of the log. Raises BadFile if it is none."""
    fields = facts(stored, name)
    entry = LogEntry(
        block=fields.text("block"),
        before=fields.named("before", amount),
        after=fields.named("after", amount),
        facts=fields.named("facts", number),
        seconds=fields.amount("seconds"),
    )
    if entry.before.keys() != entry.after.keys():
        raise BadFile(f"{name} has costs {listed(entry.before)}, and later {listed(entry.after)}")
    if not all(map(isfinite, (entry.seconds, *entry.before.values(), *entry.after.values()))):
        raise BadFile(f"{name} holds costs or seconds that are not finite")
    return entry


def fingerprint(
    registrations: Registrations, first: Estimate, settings: object, *fixed: NDArray[Any]
) -> str:
    """A digest of all that determines a training, which is the same for the same training.

    `first` is the estimate that it begins with; `settings` is a text, or a tuple of numbers and
    texts as `dataclasses.astuple` makes it, so that no name of a class is in the digest; `fixed`
    are further arrays.
    """
    digest = hashlib.sha256(repr((settings, first.parents)).encode())
    for array in (*first.arrays().values(), *fixed):
        digest.update(np.ascontiguousarray(array).tobytes())
    for batch in batches(registrations):
        for array in (batch.vertices, batch.confidence, batch.subject):
            digest.update(np.ascontiguousarray(array).tobytes())
    return VERSION + digest.hexdigest()
