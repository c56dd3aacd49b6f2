"""What a training run leaves on disk after every block, so that nothing is lost."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.errors import BadFile
from workbench.training.estimate import Estimate
from workbench.training.registrations import Registrations, batches
from workbench.writing import replacing

FILE = "checkpoint.npz"


@dataclass(frozen=True)
class Entry:
    """One block that has run."""

    block: str
    before: dict[str, float]  # costs by term
    after: dict[str, float]
    facts: dict[str, float]
    seconds: float


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Where a run is."""

    estimate: Estimate
    log: tuple[Entry, ...]
    fingerprint: str

    def save(self, folder: Path) -> None:
        """Whole or not at all."""
        said = {
            "fingerprint": self.fingerprint,
            "parents": list(self.estimate.parents),
            "log": [asdict(entry) for entry in self.log],
        }
        arrays: dict[str, Any] = dict(self.estimate.arrays())
        with replacing(folder / FILE) as temporary, temporary.open("wb") as file:
            np.savez(file, said=np.array(json.dumps(said)), **arrays)


def read_checkpoint(folder: Path, fingerprint: str) -> Checkpoint | None:
    """What an earlier run left, or None. Raises BadFile if it was another training's."""
    path = folder / FILE
    if not path.exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            said = json.loads(str(file["said"]))
            arrays = {name: file[name] for name in file.files if name != "said"}
            regressor = csr_array(arrays.pop("regressor")) if "regressor" in arrays else None
            estimate = Estimate(**arrays, parents=tuple(said["parents"]), regressor=regressor)
            log = tuple(Entry(**entry) for entry in said["log"])
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise BadFile(f"{path} is no checkpoint ({error}); remove it to start anew") from error
    if said["fingerprint"] != fingerprint:
        raise BadFile(
            f"{path} is of a training with other registrations, another start or another plan; "
            "remove it to start anew, or choose another folder"
        )
    return Checkpoint(estimate, log, fingerprint)


def fingerprint(
    registrations: Registrations, first: Estimate, plan: object, *fixed: NDArray[Any]
) -> str:
    """The same for the same training: a digest of all that goes in, `fixed` being what stays."""
    digest = hashlib.sha256(repr((plan, first.parents)).encode())
    for array in (*first.arrays().values(), *fixed):
        digest.update(np.ascontiguousarray(array).tobytes())
    for batch in batches(registrations):
        for array in (batch.vertices, batch.seen, batch.subject):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
