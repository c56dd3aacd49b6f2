"""Ensembles on disk, in emcee's own HDF5 format, whole or not at all."""

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.sampling.emcee_interface import emcee
from workbench.writing import Keeping, write_file

SETTINGS = "workbench"  # the attribute that says what was sampled, and how
SEAL = b"\nworkbench sha256 "  # after the end of the HDF5 file, with the digest of all before it
LONGEST = 1_000_000  # characters of settings
TWISTER = 624  # words in the state of NumPy's RandomState


@dataclass(frozen=True, eq=False)
class SavedEnsemble:
    """One ensemble as it was after its last stored step.

    Attributes:
        chain: (S, W, k) the draws: steps, walkers, entries.
        log_prob: (S, W) their log densities.
        accepted: (W,) how many proposals of each walker were accepted.
        random_state: the state of NumPy's RandomState.
    """

    chain: Array
    log_prob: Array
    accepted: Array
    random_state: Sequence[Any]


class Checkpoint:
    """A file that a run replaces every so many seconds by all that it has; without a path, none."""

    def __init__(self, path: Path | None, every: float, write: Callable[[Path], None]) -> None:
        self._path, self._every, self._write = path, every, write
        self._took, self._written = 0.0, time.perf_counter()
        self._keeping = Keeping()

    @property
    def failure(self) -> str:
        """Why the file could not be written last time; empty if it could."""
        return self._keeping.failure

    def save_now_and_then(self) -> None:
        """Save if the last time was long ago, so that saving takes at most 5 % of the time."""
        began = time.perf_counter()
        if began - self._written > max(self._every, 20 * self._took):
            self.save()
            self._written = time.perf_counter()
            self._took = self._written - began

    def save(self) -> None:
        """Write the file anew."""
        path = self._path
        if path is not None:
            self._keeping(lambda: self._write(path))


def group(ensemble: int) -> str:
    """What an ensemble is called in the file: `emcee.backends.HDFBackend(path, name)` opens it."""
    return f"ensemble {ensemble}"


def save(path: Path, ensembles: Sequence[SavedEnsemble], settings: Mapping[str, Any]) -> None:
    """Replace the file by another that is complete. Raises BadFile if it cannot be written.

    The file is made in memory: if HDF5 itself cannot write, it ends the process later.
    """
    content = image(ensembles, settings)
    write_file(path, content)


def image(ensembles: Sequence[SavedEnsemble], settings: Mapping[str, Any]) -> bytes:
    """What is in the file: an HDF5 file, and its seal."""
    with h5py.File("in memory", "w", driver="core", backing_store=False) as file:
        file.attrs[SETTINGS] = json.dumps(dict(settings))
        for e, saved in enumerate(ensembles):
            steps, walkers, k = saved.chain.shape
            inside = file.create_group(group(e))
            inside.attrs["version"] = emcee().__version__
            inside.attrs["nwalkers"], inside.attrs["ndim"] = walkers, k
            inside.attrs["has_blobs"], inside.attrs["iteration"] = False, steps
            for i, part in enumerate(saved.random_state):
                inside.attrs[f"random_state_{i}"] = part
            inside.create_dataset("accepted", data=saved.accepted)
            for name, values in (("chain", saved.chain), ("log_prob", saved.log_prob)):
                inside.create_dataset(name, data=values, maxshape=(None, *values.shape[1:]))
        file.flush()
        return sealed(file.id.get_file_image())


def sealed(content: bytes) -> bytes:
    """The bytes of an HDF5 file followed by their digest, which readers of HDF5 ignore."""
    return content + SEAL + hashlib.sha256(content).hexdigest().encode()


def load(path: Path) -> tuple[list[SavedEnsemble], dict[str, Any]]:
    """What `save` wrote; raises BadFile if that is not what the file holds.

    A damaged file can make the HDF5 library hang, or end the process. So it is shown nothing that
    has changed since it was written, and looks at bytes in memory.
    """
    try:
        content, seal, _ = (whole := path.read_bytes()).rpartition(SEAL)
        if not seal or sealed(content) != whole:
            raise BadFile("it is damaged, or was changed, or an earlier version wrote it")
        with h5py.File(h5py.h5f.open_file_image(content), "r") as file:
            settings = _settings(file)
            return [_ensemble(file, e, len(content)) for e in range(len(file))], settings
    except Exception as error:  # h5py raises many kinds where parts are missing or of other kinds
        raise BadFile(
            f"{path} is no checkpoint of `sample` ({error}); give another file, or remove it to "
            "begin anew"
        ) from error


def _settings(file: h5py.File) -> dict[str, Any]:
    said = file.attrs.get(SETTINGS)
    if not isinstance(said, str) or len(said) > LONGEST:
        raise BadFile(f"its attribute {SETTINGS!r} is no text that says how it was made")
    settings = json.loads(said)
    if not isinstance(settings, dict):
        raise BadFile(f"its attribute {SETTINGS!r} holds no settings by name")
    return settings


def _ensemble(file: h5py.File, e: int, size: int) -> SavedEnsemble:
    inside = file.get(group(e))
    if not isinstance(inside, h5py.Group):
        raise BadFile(f"it has no group {group(e)!r}, but {len(file)} groups")
    chain = _numbers(inside, "chain", 3, size)
    log_prob, accepted = (
        _numbers(inside, "log_prob", 2, size),
        _numbers(inside, "accepted", 1, size),
    )
    S, W, k = chain.shape
    if log_prob.shape != (S, W) or accepted.shape != (W,) or not S * W * k:
        raise BadFile(
            f"{group(e)} has draws of shape {chain.shape}, log densities of shape "
            f"{log_prob.shape} and accepted moves of shape {accepted.shape}, which do not fit"
        )
    if not ((accepted >= 0) & (accepted <= S)).all():
        raise BadFile(f"{group(e)} has accepted more or less moves than there were steps")
    return SavedEnsemble(chain, log_prob, accepted, _random_state(inside, e))


def _numbers(inside: h5py.Group, name: str, dimensions: int, size: int) -> Array:
    """A dataset, looked at before it is read: it takes no more room than the file."""
    there = inside.get(name)
    what = f"{inside.name[1:]}: {name}"
    if not isinstance(there, h5py.Dataset):
        raise BadFile(f"{what} is missing")
    if there.dtype != np.float64 or there.ndim != dimensions or 8 * (there.size or 0) > size:
        raise BadFile(
            f"{what} is no array of {dimensions} dimensions of numbers that are in the file"
        )
    found = np.asarray(there[...])
    if not np.isfinite(found).all():
        raise BadFile(f"{what} holds numbers that are not finite")
    return found


def _random_state(inside: h5py.Group, e: int) -> Sequence[Any]:
    """NumPy's state: its name, 624 words, a position, and a normal number that is left."""
    found: list[Any] = [inside.attrs.get(f"random_state_{i}") for i in range(5)]
    name, words, position, has_normal, normal = found
    try:
        if getattr(words, "shape", ()) != (TWISTER,) or words.dtype.kind != "u":
            raise ValueError(f"it takes {TWISTER} words")
        if not 0 <= position <= TWISTER or not np.isfinite(normal):
            raise ValueError("its position or its number is out of range")
        state = (str(name), words.astype(np.uint32), int(position), int(has_normal), float(normal))
        np.random.RandomState().set_state(state)
    except (TypeError, ValueError, OverflowError, IndexError) as error:
        raise BadFile(f"{group(e)} has no state of a random generator ({error})") from error
    return state


def refuse_other(path: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Raise BadFile unless a checkpoint is of the same posterior, sampled the same way."""
    for name, value in now.items():
        if before.get(name) != value:
            raise BadFile(
                f"{path} holds draws of another run: its {name} is {before.get(name)!r:.80}, not "
                f"{value!r:.80}; give another file, or the same settings"
            )


def refuse_unlike(
    path: Path, ensembles: Sequence[SavedEnsemble], count: int, shape: tuple[int, int, int]
) -> None:
    """Raise BadFile unless there are `count` ensembles of at most the `shape` (S, W, k).

    S may be smaller, because a chain may have fewer steps than the settings allow.
    """
    S, W, k = shape
    shapes = [saved.chain.shape for saved in ensembles]
    if len(shapes) != count or any(s > S or (w, d) != (W, k) for s, w, d in shapes):
        raise BadFile(
            f"{path} holds draws of other shapes than its settings say: {shapes}, not {count} "
            f"ensembles of up to {S} steps of {W} walkers in {k} dimensions; remove it to begin "
            "anew"
        )


def memory(saved: SavedEnsemble) -> Any:
    """A backend of emcee's in memory that continues from this state."""
    steps, walkers, k = saved.chain.shape
    backend = emcee().backends.Backend()
    backend.reset(walkers, k)
    backend.chain, backend.log_prob = saved.chain.copy(), saved.log_prob.copy()
    backend.accepted = saved.accepted.copy()
    backend.random_state, backend.iteration = tuple(saved.random_state), steps
    return backend
