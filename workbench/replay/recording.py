"""What a replay shows, as data for the page: the body, the runs, the directions and the draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.diagnostics import Diagnosis
from workbench.errors import BadArgument
from workbench.experiments.running import Outcome
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.setup import Setup, View
from workbench.problem import Problem
from workbench.replay.arguments import Row, row_of_body
from workbench.replay.browser_bodies import skinned_data
from workbench.replay.moves import DRAWS, gaussian_draws, moves
from workbench.replay.packing import packed
from workbench.replay.tracks import tracks
from workbench.sampling import Posterior

VERSION = 1
GAUSSIAN = "the Gaussian about the solution, whose covariance is (J'J)^-1"
OF_RUN = (
    "The body at the iterates of each solver. The slider and the play button move all solvers "
    "along one clock. The curves follow; drag one to go to a place of it. "
)
OF_MOVES = (
    "The body moves along a direction that the data hardly determine, to both sides of the "
    "solution. The farther a point moves, the more orange it is, up to 5 cm. "
)
OF_DRAWS = "Bodies drawn from the posterior. "
OF_LIVE = (
    "The grey body is the start: turn its joints by the sliders, or leave it, and press a solver. "
    "Every iterate is shown as soon as it is there. "
)
OF_VIEWS = (
    "Red lines lead from points of the body to the rays along which the cameras observed them."
)


@dataclass(frozen=True, eq=False)
class Recording:
    """A replay for a page.

    Attributes:
        body: the arrays of the body, once for all replays of a page.
        data: what else `replay.js` takes, as JSON.
        caption: what there is to see, in words.
    """

    body: dict[str, Any]
    data: dict[str, Any]
    caption: str


def recorded_run(outcome: Outcome) -> Recording | None:
    """The replay of a run: the solvers' ways, directions that are hardly seen, and draws.

    None if no body is fitted, or one that a page cannot pose.
    """
    setup, values = outcome.setup, outcome.values
    shown = _shown(setup.body, setup.problem, values)
    if shown is None:
        return None
    known = outcome.data_alone or outcome.diagnosis
    draws = gaussian_draws(outcome.diagnosis, shown.row)
    return _recording(
        shown,
        values,
        OF_RUN,
        runs=tracks(outcome.compared, setup.problem, shown.row, setup.start),
        directions=moves(known, shown.row, shown.surface),
        draws=(GAUSSIAN, draws),
        views=setup.views,
    )


def recorded_start(setup: Setup) -> Recording | None:
    """The body where a problem starts, for a page on which runs come in live.

    None if no body is fitted, or one that a page cannot pose.
    """
    shown = _shown(setup.body, setup.problem, setup.start)
    if shown is None:
        return None
    return _recording(shown, setup.start, OF_LIVE, views=setup.views, live=True)


def recorded_diagnosis(
    d: Diagnosis, body: Body | None, views: Sequence[View] = ()
) -> Recording | None:
    """The replay of a diagnosis: directions that change no residual, or hardly any.

    None if no body moves along them, or one that a page cannot pose.
    """
    shown = _shown(body, d.problem, d.values)
    found = [] if shown is None else moves(d, shown.row, shown.surface)
    if shown is None or not found:
        return None
    return _recording(shown, d.values, OF_MOVES, directions=found, views=views)


def recorded_posterior(
    posterior: Posterior, name: str, body: Body | None, views: Sequence[View] = ()
) -> Recording | None:
    """The replay of the posterior of the unknowns that are called `name`: bodies drawn from it.

    None if no body is sampled, or one that a page cannot pose.
    """
    at = posterior.given
    shown = _shown(body, posterior.problem, at)
    if shown is None:
        return None
    draws = [shown.row(values) for values in posterior.values(DRAWS)]
    return _recording(shown, at, OF_DRAWS, draws=(f"the posterior of {name}", draws), views=views)


@dataclass(frozen=True, eq=False)
class _Shown:
    """A body that a page can pose, its arrays, and how values become its numbers."""

    body: SkinnedBody
    arrays: dict[str, Any]
    row: Row

    def surface(self, numbers: Array) -> Array:
        """The vertices (N, 3) m of a row of numbers."""
        K, B = self.body.n_joints, self.body.n_betas
        pose, betas, trans = np.split(numbers, [3 * K, 3 * K + B])
        return np.asarray(self.body.vertices(pose.reshape(K, 3), betas, trans))


def _shown(body: Body | None, problem: Problem, known: Values) -> _Shown | None:
    if not isinstance(body, SkinnedBody):
        return None
    row = row_of_body(body, problem, known)
    try:
        return None if row is None else _Shown(body, skinned_data(body, "f4"), row)
    except BadArgument:
        return None


def _recording(
    shown: _Shown,
    at: Values,
    caption: str,
    runs: Sequence[dict[str, Any]] = (),
    directions: Sequence[dict[str, Any]] = (),
    draws: tuple[str, Sequence[Array]] = ("", ()),
    views: Sequence[View] = (),
    live: bool = False,
) -> Recording:
    by, drawn = draws
    landmarks = _landmarks(shown.body, views)
    seen = [_view(view, at) for view in views] if landmarks["names"] else []
    data = {
        "kind": "replay",
        "version": VERSION,
        "here": packed(shown.row(at), "f4"),
        "runs": list(runs),
        "directions": list(directions),
        "draws": {"by": by, "count": len(drawn), "x": packed(drawn, "f4")},
        "landmarks": landmarks,
        "views": seen,
        "least_confidence": LEAST_CONFIDENCE,
        "live": live,
    }
    return Recording(shown.arrays, data, caption + (OF_VIEWS if seen else ""))


def _landmarks(body: SkinnedBody, views: Sequence[View]) -> dict[str, Any]:
    """The points that the views observed, as means of vertices."""
    names = {view.landmarks for view in views}
    if len(names) != 1 or not names <= body.landmarks.keys():
        return {"names": [], "rows": [], "columns": [], "weights": []}
    (landmarks,) = (body.landmarks[name] for name in names)
    entries = landmarks.regressor.tocoo()
    return {
        "names": list(landmarks.names),
        "rows": entries.row.tolist(),
        "columns": entries.col.tolist(),
        "weights": [float(f"{weight:.9g}") for weight in entries.data],
    }


def _view(view: View, values: Values) -> dict[str, Any]:
    numbers = {
        name: np.ravel(values[getattr(view.camera, name).name]).tolist()
        for name in ("focal", "centre", "distortion", "rotation", "translation")
    }
    return {
        "name": view.name,
        "size": list(view.size),
        "held_out": view.held_out,
        "observed": np.round(view.observed, 2).tolist(),
        "confidence": np.round(view.confidence, 3).tolist(),
        **numbers,
    }
