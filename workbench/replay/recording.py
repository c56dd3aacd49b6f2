"""The replays of runs, of starts, of diagnoses and of posteriors."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.diagnostics import Diagnosis
from workbench.experiments.running import Outcome
from workbench.fitting.setup import Setup, View
from workbench.problem import Problem
from workbench.replay.arguments import Row
from workbench.replay.assembling import recording
from workbench.replay.frames import OF_POINTS, OF_VIEWS, recorded_frames
from workbench.replay.moves import DRAWS, gaussian_draws, moves
from workbench.replay.observations import landmarks_of_views, observed_data, view_data
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording, ShownBody, shown_with_row
from workbench.replay.tracks import tracks
from workbench.sampling import Posterior
from workbench.solvers import Solution

MOST_ENDS = 12  # hypotheses that are shown
OF_LAPLACE, OF_POSTERIOR = "Laplace's draws", "draws from the posterior"
GAUSSIAN = "the Gaussian about the solution, whose covariance is (J'J)^-1"
OF_RUN = (
    "The body at the iterates of each solver. The slider and the play button move all solvers "
    "along one clock. A mark moves along the curves; drag it to go to another iterate. "
)
OF_MOVES = (
    "The body moves along a direction that the data hardly determine, to both sides of the "
    "solution. The farther a point moves, the more orange it is, up to 5 cm. "
)
OF_DRAWS = "Bodies drawn from the posterior. "
OF_LIVE = (
    "The grey body is the start: drag its joints (the blue dots), or turn them by the sliders, and "
    "press a solver. Every iterate is shown as soon as it is there. To find basins, a solver goes "
    "from many starts about this one; ends that the residuals cannot tell apart have one colour. "
)


def recorded_run(outcome: Outcome) -> Recording | None:
    """The replay of a run: the solvers' ways, directions that are hardly seen, and draws; stages
    and hypotheses, where there are any; the frames of a body that moves through frames.

    None if no body is fitted, or one that a page cannot pose.
    """
    setup, values = outcome.setup, outcome.values
    solution = outcome.solution

    def parts(shown: ShownBody, row: Row) -> dict[str, Any]:
        known, alone = outcome.data_alone or outcome.diagnosis, _data_alone(outcome)
        return {
            "runs": tracks(outcome.compared, setup.problem, row, setup.start, alone),
            "directions": moves(known, row, shown.surface),
            "draws": (OF_LAPLACE, GAUSSIAN, gaussian_draws(outcome.diagnosis, row)),
            "series": [*_stages(solution, row), *_ends(solution, row)],
        }

    found = _recording(setup.body, setup.problem, values, OF_RUN, setup.views, parts)
    return recorded_frames(setup, values) if found is None else found


def _data_alone(outcome: Outcome) -> Problem | None:
    """The problem of an outcome without its priors; None if it has none."""
    return None if outcome.data_alone is None else outcome.data_alone.problem


def recorded_solution(
    solution: Solution, problem: Problem, start: Values, body: Body
) -> Recording | None:
    """The replay of one solver's way from `start`, with its stages and hypotheses.

    None if the values do not determine the body, and for one that a page cannot pose.
    """
    values = dict(start) | dict(solution.values)

    def parts(shown: ShownBody, row: Row) -> dict[str, Any]:
        runs = tracks({solution.solver: solution}, problem, row, start)
        return {"runs": runs, "series": [*_stages(solution, row), *_ends(solution, row)]}

    return _recording(body, problem, values, OF_RUN, (), parts)


def recorded_start(setup: Setup) -> Recording | None:
    """The body where a problem starts, for a page on which runs come in live.

    None if no body is fitted, or one that a page cannot pose.
    """
    live = {"live": True}
    views = setup.views
    return _recording(setup.body, setup.problem, setup.start, OF_LIVE, views, lambda *_: live)


def recorded_diagnosis(
    d: Diagnosis, body: Body | None, views: Sequence[View] = ()
) -> Recording | None:
    """The replay of a diagnosis: directions that change no residual, or hardly any.

    None if no body moves along them, or one that a page cannot pose.
    """

    def parts(shown: ShownBody, row: Row) -> dict[str, Any] | None:
        directions = moves(d, row, shown.surface)
        return {"directions": directions} if directions else None

    return _recording(body, d.problem, d.values, OF_MOVES, views, parts)


def recorded_posterior(
    posterior: Posterior,
    name: str,
    body: Body | None,
    views: Sequence[View] = (),
    cameras: Values | None = None,
) -> Recording | None:
    """The replay of the posterior of the unknowns that are called `name`: bodies drawn from it.

    `cameras` are the numbers of cameras that the problem does not read, such as held-out ones. None
    if no body is sampled, or one that a page cannot pose.
    """
    problem, at = posterior.problem, dict(cameras or {}) | dict(posterior.given)

    def parts(shown: ShownBody, row: Row) -> dict[str, Any]:
        drawn = [row(values) for values in posterior.values(DRAWS)]
        if posterior.method == "laplace":
            return {"draws": (OF_LAPLACE, f"Laplace's approximation of {name}", drawn)}
        return {"draws": (OF_POSTERIOR, f"the posterior of {name}", drawn)}

    return _recording(body, problem, at, OF_DRAWS, views, parts)


def _recording(
    body: Body | None,
    problem: Problem,
    at: Values,
    caption: str,
    views: Sequence[View],
    parts: Callable[[ShownBody, Row], dict[str, Any] | None],
) -> Recording | None:
    """The replay of `parts` with the cameras, and with the points in space that were observed.

    None where a page cannot pose the body, or the parts are None.
    """
    found = shown_with_row(body, problem, at)
    content = None if found is None else parts(*found)
    if found is None or content is None:
        return None
    shown, row = found
    landmarks = landmarks_of_views(shown.body, views)
    seen = [view_data(view, at) for view in views] if landmarks["names"] else []
    observed = observed_data(problem, problem.read(at), shown.body)
    said = (OF_VIEWS if seen else "") + (OF_POINTS if observed is not None else "")
    return recording(
        shown,
        row(at),
        (caption + said).rstrip(),
        landmarks=landmarks,
        views=seen,
        observed=observed,
        **content,
    )


def _stages(solution: Solution, row: Row) -> list[Series]:
    """The body where a solve in stages began, and at the end of each stage."""
    if len(solution.stages) < 2:
        return []
    at = [0, *solution.stages]
    count = len(solution.stages)
    said = ["Where the first stage begins."]
    for k in range(1, count + 1):
        cost = solution.trace[at[k]].cost
        steps = at[k] - at[k - 1]
        said.append(
            f"The end of stage {k} of {count}, after {steps} iterations, at cost {cost:.4g}."
        )
    labels = ["start", *(f"stage {k}" for k in range(1, count + 1))]
    rows = _rows(row, [solution.trace[i].values for i in at])
    return [Series("stages", labels, said, rows=rows, opens=count)]


def _ends(solution: Solution, row: Row) -> list[Series]:
    """The body at each of the ends to which several starts led."""
    ends = solution.hypotheses[:MOST_ENDS]
    if len(ends) < 2:
        return []
    said = [
        f"Hypothesis {k + 1} of {len(solution.hypotheses)}, at cost {one.cost:.4g}; "
        f"{len(one.starts)} of the starts led to it."
        for k, one in enumerate(ends)
    ]
    labels = [f"{k + 1}: cost {one.cost:.4g}" for k, one in enumerate(ends)]
    return [Series("hypotheses", labels, said, rows=_rows(row, [one.values for one in ends]))]


def _rows(row: Row, each: Sequence[Values]) -> Array:
    return np.array([row(values) for values in each])[:, None]
