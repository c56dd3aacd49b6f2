"""Ensembles on disk, in an .npz that is replaced whole or not at all."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.arrays import (
    Archive,
    opened,
    read_expected,
    reals,
    texts,
    wholes,
)
from workbench.reading.facts import parsed
from workbench.writing import Keeping, replacing

WHAT, DO = "checkpoint of `sample`", "give another file, or remove it to begin anew"
TWISTER = 624  # words in the state of NumPy's RandomState


@dataclass(frozen=True, eq=False)
class SavedEnsemble:
    """One ensemble as it was after its last stored step."""

    chain: Array  # (S, W, k) the draws: steps, walkers, entries
    log_prob: Array  # (S, W) their log densities
    accepted: Array  # (W,) how many proposals of each walker were accepted
    random_state: Sequence[Any]  # the state of NumPy's RandomState


class Checkpoint:
    """A file that a run replaces every so many seconds by all that it has; without a path, none."""

    def __init__(self, path: Path | None, every: float, write: Callable[[Path], None]) -> None:
        self._path, self._every, self._write = path, every, write
        self._seconds, self._saved_at = 0.0, time.perf_counter()
        self._keeping = Keeping()

    @property
    def failure(self) -> str:
        """Why the file could not be written last time; empty if it could."""
        return self._keeping.failure

    def save_now_and_then(self) -> None:
        """Save if the last time was long ago, so that saving takes at most 5 % of the time."""
        began = time.perf_counter()
        if began - self._saved_at > max(self._every, 20 * self._seconds):
            self.save()
            self._saved_at = time.perf_counter()
            self._seconds = self._saved_at - began

    def save(self) -> None:
        """Write the file anew."""
        path = self._path
        if path is not None:
            self._keeping(lambda: self._write(path))


def save(path: Path, ensembles: Sequence[SavedEnsemble], settings: Mapping[str, Any]) -> None:
    """Replace the file by another that is complete. Raises BadFile if it cannot be written.

    Nothing is compressed, which would take seconds and gain little on random numbers.
    """
    arrays: dict[str, Any] = {"settings": np.array(json.dumps(dict(settings)))}
    for e, saved in enumerate(ensembles):
        _, words, position, has_normal, normal = saved.random_state
        arrays |= {
            f"chain_{e}": saved.chain,
            f"log_prob_{e}": saved.log_prob,
            f"accepted_{e}": saved.accepted,
            f"random_words_{e}": words,
            f"random_place_{e}": np.array([position, has_normal]),
            f"random_normal_{e}": np.array(float(normal)),
        }
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def load(path: Path, settings: Mapping[str, Any]) -> list[SavedEnsemble]:
    """The ensembles that `save` wrote with these settings.

    The settings must have `ensembles`, `walkers`, `steps`, `thin` and `entries`. Raises BadFile if
    that is not what the file holds, or if it was written with other settings.
    """
    with opened(path, WHAT, DO) as archive:
        text = str(read_expected(archive, {"settings": texts()})["settings"])
        before = parsed(text)
        if not isinstance(before, dict):
            raise BadFile("its settings are no settings by name")
        other = [name for name, value in settings.items() if before.get(name) != value]
        count = 0 if other else settings["ensembles"]
        ensembles = [_ensemble(archive, e, settings) for e in range(count)]
    if other:
        name = other[0]
        raise BadFile(
            f"{path} holds draws of another run: its {name} is {before.get(name)!r:.80}, not "
            f"{settings[name]!r:.80}; give another file, or the same settings"
        )
    return ensembles


def _ensemble(archive: Archive, e: int, settings: Mapping[str, Any]) -> SavedEnsemble:
    W, k = settings["walkers"], len(settings["entries"])
    expected = {
        f"chain_{e}": reals("steps", W, k),
        f"log_prob_{e}": reals("steps", W),
        f"accepted_{e}": reals(W),
        f"random_words_{e}": wholes(TWISTER),
        f"random_place_{e}": wholes(2),
        f"random_normal_{e}": reals(),
    }
    chain, log_prob, accepted, words, (position, has_normal), normal = read_expected(
        archive, expected
    ).values()
    if not 0 < len(chain) <= settings["steps"] // settings["thin"]:
        raise BadFile(f"chain_{e} has {len(chain)} steps, none or more than its settings say")
    if not ((accepted >= 0) & (accepted <= len(chain))).all():
        raise BadFile(f"accepted_{e} has more or less moves than there were steps")
    if not (words.min() >= 0 and words.max() < 2**32 and 0 <= position <= TWISTER):
        raise BadFile(f"random_words_{e} and its place are no state of a random generator")
    state = ("MT19937", words.astype(np.uint32), int(position), int(has_normal), float(normal))
    return SavedEnsemble(chain, log_prob, accepted, state)
