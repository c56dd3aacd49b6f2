"""The steps of a rig that take long, kept in a file from which the same rig continues.

A rig is determined by its arguments, and nearly all of its time is spent in refinements. So the
results of those, in their order, are its whole state: made again with them, it takes the same way.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.arrays import doubles, opened, read_expected, texts
from workbench.training.checkpoint import REMOVE
from workbench.training.estimate import Estimate
from workbench.training.rigging.bones import RigidBones
from workbench.writing import Keeping, write_arrays

Stage = TypeVar("Stage", RigidBones, Estimate)
RigProgress = Callable[[str, int, int], None]
RIG_VERSION = 1  # of what the steps are
DIGEST = "digest"  # the name of the digest of the rig's arguments


def silent(what: str, done: int, of: int) -> None:
    """A report that shows nothing."""


@dataclass(eq=False)
class RigSteps:
    """The refinements of one rig, in their order; each is made once.

    Attributes:
        path: the .npz that is written after every step, and read by `begin` if it is there.
        arrays: what each step found, as `NUMBER.NAME`.
        unfinished: no further step is made, so that the rig ends with what there is.
        report: called with what is going on, and how much of how much of it is done.
    """

    path: Path | None = None
    arrays: dict[str, Array] = field(default_factory=dict)
    unfinished: bool = False
    report: RigProgress = silent
    _number: int = 0
    _digest: str = ""
    _keep: Keeping = field(default_factory=Keeping)

    def so_far(self) -> "RigSteps":
        """The steps that were made, for a rig that makes no other."""
        return RigSteps(None, self.arrays, unfinished=True)

    def begin(self, report: RigProgress, settings: object, *arrays: NDArray[Any]) -> None:
        """Begin a rig from its first step, with those of the file.

        Raises BadFile if the file is damaged, or of other settings or arrays.
        """
        self.report, self._number = report, 0
        digest = hashlib.sha256(repr((RIG_VERSION, settings, [a.shape for a in arrays])).encode())
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        self._digest = digest.hexdigest()
        if self.path is None or not self.path.exists():
            return
        with opened(self.path, "checkpoint of this rig", REMOVE) as archive:
            names = archive.headers.keys() - {DIGEST}
            expected = {name: doubles(*archive.headers[name].shape) for name in names}
            if str(read_expected(archive, {DIGEST: texts()})[DIGEST]) != self._digest:
                raise BadFile("it is of other meshes, or of another number of bones or tolerance")
            self.arrays = read_expected(archive, expected)

    def remove(self) -> None:
        """Remove the file of a rig that is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def __call__(self, start: Stage, refined: Callable[[Stage], Stage]) -> Stage:
        """What a refinement makes of its start, which is found once."""
        number, self._number = self._number, self._number + 1
        names = {name: f"{number}.{name}" for name in start.arrays()}
        if self.arrays.keys() >= set(names.values()):
            stored: dict[str, Any] = {name: self.arrays[key] for name, key in names.items()}
            return replace(start, **stored)
        if self.unfinished:
            return start
        result = refined(start)
        self.arrays |= {names[name]: array for name, array in result.arrays().items()}
        if (path := self.path) is not None:
            stored = {DIGEST: np.array(self._digest), **self.arrays}
            self._keep(lambda: write_arrays(path, stored))
        return result
