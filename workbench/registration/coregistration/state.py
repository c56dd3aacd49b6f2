"""What a coregistration has found so far, and the checkpoint that it is written to."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.arrays import doubles, nothing_else, opened, read_expected, texts
from workbench.reading.facts import facts_in
from workbench.registration.coregistration.scan_block import Scans
from workbench.training.checkpoint import FACTS, REMOVE, log_entry
from workbench.training.estimate import Estimate
from workbench.training.execution import LogEntry
from workbench.writing import replacing

FILE, VERSION = "coregistration.npz", "2:"
OWN = ("vertices", "trans", "targets", "confidence", "scan_costs")


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns of a coregistration of J scans.

    Attributes:
        estimate: templates, joints, pose blend shapes, weights, and the pose of every scan.
        vertices: (J, N, 3) m, the registrations.
        trans: (J, 3) m.
        targets: (J, N, 3) m, where the scans alone would put the vertices.
        confidence: (J, N, 3, 3), how surely; see `softness`.
        scan_costs: (J,) E_S of each registration.
        log: the blocks that have run, in order.
    """

    estimate: Estimate
    vertices: Array
    trans: Array
    targets: Array
    confidence: Array
    scan_costs: Array
    log: tuple[LogEntry, ...] = ()

    def arrays(self) -> dict[str, Array]:
        """All arrays by name, as they are stored."""
        return self.estimate.arrays() | {name: getattr(self, name) for name in OWN}

    def save(self, folder: Path, fingerprint: str) -> None:
        """Write the checkpoint, completely or not at all."""
        told = {"fingerprint": fingerprint, "log": [asdict(entry) for entry in self.log]}
        stored: dict[str, Any] = {FACTS: np.array(json.dumps(told)), **self.arrays()}
        with replacing(folder / FILE) as temporary, temporary.open("wb") as file:
            np.savez(file, **stored)


def read_state(folder: Path, fingerprint: str, first: State) -> State | None:
    """The state of an earlier run in `folder`, or None if there is no file.

    `first` is the state that the run began with, whose sizes do not change. Raises BadFile if the
    file is of other scans or settings, of another version, or damaged.
    """
    path = folder / FILE
    if not path.exists():
        return None
    with opened(path, "checkpoint of this coregistration", REMOVE) as archive:
        told = facts_in(read_expected(archive, {FACTS: texts()})[FACTS])
        if (digest := told.text("fingerprint")) != fingerprint:
            raise BadFile(
                "it is of other scans, another body or other settings"
                if digest.startswith(VERSION)
                else "another version of the workbench wrote it, which cannot be continued"
            )
        expected = {name: doubles(*array.shape) for name, array in first.arrays().items()}
        nothing_else(archive, (*expected, FACTS))
        found = read_expected(archive, expected)
        log = told.several("log", log_entry)
    regressor = csr_array(found.pop("regressor"))
    own = {name: found.pop(name) for name in OWN}
    given: dict[str, Any] = dict(found)
    return State(replace(first.estimate, **given, regressor=regressor), **own, log=log)


def fingerprint(scans: Scans, first: State, settings: str) -> str:
    """A digest of all that determines a coregistration. It reads every scan once."""
    digest = hashlib.sha256(settings.encode())
    arrays = [*first.arrays().values(), scans.subject]
    for row in range(len(scans.subject)):
        scan = scans.read(row)
        arrays += [a for a in (scan.points, scan.normals, scan.weights) if a is not None]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return VERSION + digest.hexdigest()
