"""Ensembles on disk, in emcee's own HDF5 format, whole or not at all."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import emcee
import h5py
import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile
from workbench.writing import replacing

Array = NDArray[np.float64]
SETTINGS = "workbench"  # the attribute that says what was sampled, and how


@dataclass(frozen=True, eq=False)
class Saved:
    """One ensemble as it was after its last step that was kept."""

    chain: Array  # (S, W, k)
    log_prob: Array  # (S, W)
    accepted: Array  # (W,)
    random_state: Sequence[Any]  # of NumPy's RandomState


def group(ensemble: int) -> str:
    """What an ensemble is called in the file: `emcee.backends.HDFBackend(path, name)` opens it."""
    return f"ensemble {ensemble}"


def save(path: Path, ensembles: Sequence[Saved], settings: Mapping[str, Any]) -> None:
    """Replace the file by another that is complete. Raises BadFile if it cannot be written."""
    with replacing(path) as temporary:
        for e, saved in enumerate(ensembles):
            steps, walkers, k = saved.chain.shape
            backend = emcee.backends.HDFBackend(str(temporary), name=group(e))
            backend.reset(walkers, k)
            backend.grow(steps, None)
            with backend.open("a") as file:
                inside = file[group(e)]
                inside["chain"][...] = saved.chain
                inside["log_prob"][...] = saved.log_prob
                inside["accepted"][...] = saved.accepted
                inside.attrs["iteration"] = steps
                for i, part in enumerate(saved.random_state):
                    inside.attrs[f"random_state_{i}"] = part
        with h5py.File(temporary, "a") as file:
            file.attrs[SETTINGS] = json.dumps(dict(settings))


def load(path: Path) -> tuple[list[Saved], dict[str, Any]]:
    """What `save` wrote; raises BadFile if that is not what the file holds."""
    try:
        with h5py.File(path, "r") as file:
            settings = json.loads(file.attrs[SETTINGS])
            count = len(file)
        found = []
        for e in range(count):
            backend = emcee.backends.HDFBackend(str(path), name=group(e), read_only=True)
            found.append(
                Saved(
                    backend.get_chain(), backend.get_log_prob(), backend.accepted,
                    tuple(backend.random_state),
                )
            )  # fmt: skip
        return found, settings
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise BadFile(
            f"{path} is no checkpoint of `sample` ({error}); give another file, or remove it to "
            "begin anew"
        ) from error


def refuse_other(path: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Raise BadFile unless a checkpoint is of the same posterior, sampled the same way."""
    for name, value in now.items():
        if before.get(name) != value:
            raise BadFile(
                f"{path} holds draws of another run: its {name} is {before.get(name)!r:.80}, not "
                f"{value!r:.80}; give another file, or the same settings"
            )


def memory(saved: Saved) -> emcee.backends.Backend:
    """A backend in memory that goes on from there."""
    steps, walkers, k = saved.chain.shape
    backend = emcee.backends.Backend()
    backend.reset(walkers, k)
    backend.chain, backend.log_prob = saved.chain.copy(), saved.log_prob.copy()
    backend.accepted = saved.accepted.copy()
    backend.random_state, backend.iteration = tuple(saved.random_state), steps
    return backend
