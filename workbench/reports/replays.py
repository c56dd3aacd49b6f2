"""Pages that move: `wb.show`, replays, planar figures and the live page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from markupsafe import Markup

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.catalogue import load_body
from workbench.diagnostics import Diagnosis
from workbench.errors import BadArgument, NotSupported
from workbench.experiments.running import Outcome, warm_up
from workbench.fitting.setup import Setup
from workbench.motions import Motion
from workbench.problem import Problem
from workbench.registration import Registration
from workbench.reports.page import page
from workbench.reports.replay import (
    Recording,
    recorded_diagnosis,
    recorded_motion,
    recorded_posterior,
    recorded_registration,
    recorded_run,
    recorded_solution,
)
from workbench.reports.replay.live import LiveServer, moved_by_hand
from workbench.reports.replay.runs import recorded_start
from workbench.sampling import Posterior
from workbench.solvers import SOLVERS, Solution
from workbench.solvers.abilities import refuse
from workbench.writing import write_file

FRAME_HEIGHT = 680  # px of the frame in a notebook
DEFAULT_BODY = "default"  # the body that a motion is shown on
NO_WEBGL = "This page needs a browser with scripts and WebGL 2 to show the body."
SHOWABLE = "an outcome of a run, a Motion, a Registration, a Solution, a Diagnosis or a Posterior"


@dataclass(frozen=True, eq=False)
class ReplayPage:
    """A page that holds everything it needs; a notebook shows it as the last line of a cell.

    Attributes:
        html: the page.
        caption: what there is to see, in words.
    """

    html: str
    caption: str

    def __repr__(self) -> str:
        return f"[page of {len(self.html) / 1e3:,.0f} kB] {self.caption}"

    def _repr_html_(self) -> str:
        """The page in a frame that may run its own scripts and reach nothing else."""
        return (
            f'<iframe srcdoc="{escape(self.html)}" sandbox="allow-scripts" title="replay" '
            f'style="width: 100%; height: {FRAME_HEIGHT}px; border: 0"></iframe>'
        )

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, whole or not at all, and return its path. Raises BadFile."""
        write_file(Path(path), self.html)
        return Path(path)


def show(
    what: object,
    *,
    body: Body | None = None,
    problem: Problem | None = None,
    start: Values | None = None,
) -> ReplayPage:
    """A page on which a body moves: in a notebook the last line of a cell, `show(motion)`.

    `what` is an outcome of a run, a `Motion` (on `body`, or on the default one), a `Registration`,
    a `Diagnosis` or a `Posterior` of a `body`, or a `Solution`, for which the `problem`, the
    `start` and the `body` are given too. `page.save(path)` writes the page to a file.

    Raises BadArgument for anything else, for a body that is missing, and for a motion that has no
    joint in common with the body; NotSupported where no body moves that a page can pose.
    """
    recording = _recorded(what, body, problem, start)
    if recording is None:
        raise NotSupported(
            f"nothing moves on a page of this {type(what).__name__}: a page shows skinned bodies "
            "of SMPL's form, whose pose, betas and trans the values determine"
        )
    return replay_page(recording)


def _recorded(
    what: object, body: Body | None, problem: Problem | None, start: Values | None
) -> Recording | None:
    if isinstance(what, Outcome):
        return recorded_run(what)
    if isinstance(what, Motion):
        return recorded_motion(what, load_body(DEFAULT_BODY) if body is None else body)
    if isinstance(what, Registration):
        return recorded_registration(what)
    if not isinstance(what, Solution | Diagnosis | Posterior):
        raise BadArgument(f"what can be shown is {SHOWABLE}, not {what!r:.60}")
    if body is None:
        raise BadArgument(f"a {type(what).__name__} does not know its body; give body=...")
    if isinstance(what, Diagnosis):
        return recorded_diagnosis(what, body)
    if isinstance(what, Posterior):
        return recorded_posterior(what, "the unknowns", body)
    if problem is None or not isinstance(start, Mapping):
        raise BadArgument(
            "a Solution does not know its problem; give problem=... and start=..., as to `solve`"
        )
    return recorded_solution(what, problem, start, body)


def replay_page(recording: Recording, title: str = "", said: Sequence[str] = ()) -> ReplayPage:
    """A page with a replay, sentences above it, and nothing else."""
    text = page("replay_page.html", title=title, said=said, recording=recording, without=NO_WEBGL)
    return ReplayPage(text, recording.caption)


def motion_page(
    motion: Motion, body: Body, title: str, betas: Array | None = None, said: Sequence[str] = ()
) -> ReplayPage:
    """The page of a motion on a body; `betas` (T, B) take the place of the motion's own.

    `said` are further sentences above the body.

    Raises BadArgument if they have no joint in common, and NotSupported for a body that a page
    cannot pose.
    """
    recording = recorded_motion(motion, body, betas)
    if recording is None:
        raise NotSupported(
            f"a page cannot pose body {body.name!r}; take a skinned body of SMPL's form, such as "
            f"{DEFAULT_BODY}"
        )
    count = f"{len(motion):,} frames at {motion.fps:g} frames a second, {motion.seconds:.2f} s"
    notes = tuple(f"{note[0].upper()}{note[1:]}." for note in motion.named(body).notes if note)
    return replay_page(recording, title, (f"{count}, on body {body.name!r}.", *notes, *said))


def flat_page(script: Path, data: Mapping[str, Any], caption: str) -> ReplayPage:
    """The page of a script that draws with `flat.js`.

    The script defines `figure(root, data)`, which returns a `Flat`. What `packed` made of arrays
    in `data` are arrays there.
    """
    text = Markup(script.read_text(encoding="utf-8"))
    without = "This page needs a browser with scripts to show the figure."
    html = page(
        "flat.html", title="", script=text, data=dict(data), caption=caption, without=without
    )
    return ReplayPage(html, caption)


MOST_SOLVERS = 12  # solvers on a page at most, those that the problem compares first


def live_server(name: str, setup: Setup, port: int = 0) -> LiveServer:
    """A server for a setup: its page offers the solvers that can take the problem.

    Raises BadArgument where no start can be set by hand, or for a body that a page cannot pose, and
    OSError for a port that is taken.
    """
    moved_by_hand(setup)
    recording = recorded_start(setup)
    if recording is None:
        raise BadArgument(f"a page cannot pose the body of {name}; take a skinned body of SMPL's")
    order = dict.fromkeys((*setup.compared, *SOLVERS))
    able = [solver for solver in order if _takes(solver, setup)][:MOST_SOLVERS]
    solvers = {
        solver: SOLVERS[solver] if setup.strategy is None else setup.strategy(SOLVERS[solver])
        for solver in able
    }
    text = page("live.html", title=name, question=setup.question, recording=recording, solvers=able)
    warm_up(setup, solvers.values())  # so that no press waits
    return LiveServer(setup, solvers, text, port)


def _takes(name: str, setup: Setup) -> bool:
    try:
        refuse(name, SOLVERS[name].abilities, setup.problem)
    except NotSupported:
        return False
    return True
