"""`workbench fit MARKERS.npz`: MoSh on a recording of markers, with its results as arrays."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.cli.output import say_notes
from workbench.cli.run import carry_out
from workbench.errors import BadArgument, NotSupported
from workbench.experiments import Experiment
from workbench.fitting.marker_files import MarkerRecording, read_markers
from workbench.fitting.marker_sets import (
    OUT,
    MarkerSet,
    default_markers,
    matched,
    read_marker_set,
)
from workbench.fitting.markers import SIGMA, marker_solver, rms_of_markers
from workbench.fitting.mosh import mosh
from workbench.fitting.setup import Setup
from workbench.geometry.guesses import sizes_of
from workbench.solvers import Solver
from workbench.writing import write_arrays

WORST = 5  # markers that are named
HIGHEST = 0.1  # m above the skin: what is given in mm by mistake is above it


@dataclass(frozen=True)
class Worn:
    """What is known of the markers that a person wears. Raises BadArgument for lengths in mm.

    Attributes:
        file: the marker set, in JSON; None for the body's own 41 markers.
        height: of their centres above the skin, in m.
        across: its standard deviation in m, or None where places are uncertain in all directions.
    """

    file: Path | None = None
    height: float = OUT
    across: float | None = None

    def __post_init__(self) -> None:
        for option, length in (("--marker-height", self.height), ("--across", self.across)):
            if length is not None and not 0 < length < HIGHEST:
                raise BadArgument(
                    f"{option} takes a length in m, above 0 and below {HIGHEST:g}, such as 0.001 "
                    f"for 1 mm; not {length:g}"
                )

    def on(self, body: SkinnedBody) -> MarkerSet:
        """The markers on a body. Raises BadFile as `read_marker_set` does."""
        placed = default_markers(body) if self.file is None else read_marker_set(self.file, body)
        vertices = dict(zip(placed.names, placed.vertices, strict=True))
        return MarkerSet.of(body, vertices, self.height)


def fit_markers(
    console: Console,
    file: Path,
    body: Body,
    markers_worn: Worn,
    fps: float | None,
    sigma: float | None,
    solver: Solver,
    out: Path,
) -> None:
    """Find shape and offsets from some frames, report on them, and find the pose of every frame.

    The report's folder gets `motion.npz`: `poses` (T, K, 3) rad, `trans` (T, 3) m, `betas` (B,),
    `offsets` (M, 3) m, `labels` (M,), `frames`, from which shape and offsets were found, `errors`
    (T, M) m, `joint_names`, and `fps`, if it is known. `read_motion` reads it.
    """
    if not isinstance(body, SkinnedBody):
        raise NotSupported(why_not_skinned(body, "a fit to markers", "take a SkinnedBody"))
    recording = read_markers(file, sizes=sizes_of(body.joint_names))
    worn, places, notes = matched(recording.labels, markers_worn.on(body))
    say_notes(console, (*recording.notes, *notes))
    markers, precision = recording.markers[:, list(places)], SIGMA if sigma is None else sigma
    folders: list[Path] = []

    def solve(setup: Setup) -> Values:
        question = (
            f"Which shape of the body, and which places of {len(worn.names)} markers on it, "
            f"explain {len(setup.start['observed'])} of the {len(markers)} frames of {file.name}?"
        )
        experiment = Experiment(
            file.stem,
            lambda: replace(setup, question=question),
            "a user's own file",
            source=str(file.resolve()),
        )
        values, folder = carry_out(console, experiment, marker_solver(solver), False, out)
        folders.append(folder)
        return values

    found = mosh(
        markers,
        body,
        worn,
        sigma=precision,
        across=markers_worn.across,
        solve=solve,
        progress=lambda text: console.print(f"[dim]{text}[/]", highlight=False),
    )
    (folder,) = folders
    arrays: dict[str, NDArray[Any]] = {
        "poses": found.pose,
        "trans": found.trans,
        "errors": found.errors,
        "frames": found.frames,
        "betas": found.betas,
        "offsets": found.offsets,
        "labels": np.array(worn.names),
        "joint_names": np.array(body.joint_names),
        "up_axis": np.array("y"),
    }
    rate = recording.fps if fps is None else fps
    if rate is not None:
        arrays["fps"] = np.array(rate)
    write_arrays(folder / "motion.npz", arrays)
    console.print(_worst(worn, found.errors, recording), highlight=False, soft_wrap=True)
    console.print(f"motion: {folder / 'motion.npz'}", highlight=False, soft_wrap=True)


def _worst(worn: MarkerSet, errors: np.ndarray, recording: MarkerRecording) -> str:
    """A sentence on the markers that fit worst over all frames."""
    off = 1e3 * errors
    each = rms_of_markers(off)
    worst = np.argsort(-each, kind="stable")[:WORST]
    named = ", ".join(f"{escape(worn.names[m])} {each[m]:.1f}" for m in worst)
    whole = float(np.sqrt(np.nanmean(off**2)))
    return (
        f"markers are {whole:.1f} mm from those of the body (root mean square over "
        f"{len(recording.markers)} frames); the worst are, in mm: {named}"
    )
