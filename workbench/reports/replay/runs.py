"""Recordings of runs, diagnoses and posteriors."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.diagnostics import Diagnosis, Direction
from workbench.experiments.running import Outcome
from workbench.fitting.setup import Setup, View
from workbench.problem import Problem
from workbench.reports.replay.recording import (
    BodyNumbers,
    Recording,
    Series,
    ShownBody,
    landmarks_of_views,
    packed,
    recording,
    shown_with_row,
    view_data,
)
from workbench.reports.replay.sequences import OF_VIEWS, recorded_frames
from workbench.sampling import Posterior
from workbench.solvers import Iterate, Solution
from workbench.threads import limited_threads

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
    "The grey body is the start: turn its joints by the sliders, and pick a solver. "
    "Every iterate is shown as soon as it is there. "
)


def recorded_run(outcome: Outcome) -> Recording | None:
    """The replay of a run: the solvers' ways, directions that are hardly seen, and draws; stages
    and hypotheses, where there are any; the frames of a body that moves through frames.

    None if no body is fitted, or one that a page cannot pose.
    """
    setup, values = outcome.setup, outcome.values
    solution = outcome.solution

    def parts(shown: ShownBody, row: BodyNumbers) -> dict[str, Any]:
        known = outcome.data_alone or outcome.diagnosis
        alone = None if outcome.data_alone is None else known.problem
        return {
            "runs": tracks(outcome.compared, setup.problem, row, setup.start, alone),
            "directions": moving_directions(known, row, shown.surface),
            "draws": (OF_LAPLACE, GAUSSIAN, gaussian_draws(outcome.diagnosis, row)),
            "series": [*_stages(solution, row), *_ends(solution, row)],
        }

    replay = _recording(setup.body, setup.problem, values, OF_RUN, setup.views, parts)
    return recorded_frames(setup, values) if replay is None else replay


def recorded_solution(
    solution: Solution, problem: Problem, start: Values, body: Body
) -> Recording | None:
    """The replay of one solver's way from `start`, with its stages and hypotheses.

    None if the values do not determine the body, and for one that a page cannot pose.
    """
    values = dict(start) | dict(solution.values)

    def parts(shown: ShownBody, row: BodyNumbers) -> dict[str, Any]:
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

    def parts(shown: ShownBody, row: BodyNumbers) -> dict[str, Any] | None:
        directions = moving_directions(d, row, shown.surface)
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
    problem, values = posterior.problem, dict(cameras or {}) | dict(posterior.given)

    def parts(shown: ShownBody, row: BodyNumbers) -> dict[str, Any]:
        drawn = [row(values) for values in posterior.values(DRAWS)]
        if posterior.method == "laplace":
            return {"draws": (OF_LAPLACE, f"Laplace's approximation of {name}", drawn)}
        return {"draws": (OF_POSTERIOR, f"the posterior of {name}", drawn)}

    return _recording(body, problem, values, OF_DRAWS, views, parts)


def _recording(
    body: Body | None,
    problem: Problem,
    values: Values,
    caption: str,
    views: Sequence[View],
    parts: Callable[[ShownBody, BodyNumbers], dict[str, Any] | None],
) -> Recording | None:
    """The replay of `parts` with the cameras.

    None where a page cannot pose the body, or the parts are None.
    """
    posed = shown_with_row(body, problem, values)
    content = None if posed is None else parts(*posed)
    if posed is None or content is None:
        return None
    shown, row = posed
    landmarks = landmarks_of_views(shown.body, views)
    seen = [view_data(view, values) for view in views] if landmarks["names"] else []
    said = OF_VIEWS if seen else ""
    return recording(
        shown, row(values), (caption + said).rstrip(), landmarks=landmarks, views=seen, **content
    )


def _stages(solution: Solution, row: BodyNumbers) -> list[Series]:
    """The body where a solve in stages began, and at the end of each stage."""
    if len(solution.stages) < 2:
        return []
    ends = [0, *solution.stages]
    count = len(solution.stages)
    sentences = ["Where the first stage begins."]
    for k in range(1, count + 1):
        cost = solution.trace[ends[k]].cost
        steps = ends[k] - ends[k - 1]
        sentences.append(
            f"The end of stage {k} of {count}, after {steps} iterations, at cost {cost:.4g}."
        )
    labels = ["start", *(f"stage {k}" for k in range(1, count + 1))]
    rows = _rows(row, [solution.trace[i].values for i in ends])
    return [Series("stages", labels, sentences, rows=rows, opens=count)]


def _ends(solution: Solution, row: BodyNumbers) -> list[Series]:
    """The body at each of the ends to which several starts led."""
    ends = solution.hypotheses[:MOST_ENDS]
    if len(ends) < 2:
        return []
    sentences = [
        f"Hypothesis {k + 1} of {len(solution.hypotheses)}, at cost {end.cost:.4g}; "
        f"{len(end.starts)} of the starts led to it."
        for k, end in enumerate(ends)
    ]
    labels = [f"{k + 1}: cost {end.cost:.4g}" for k, end in enumerate(ends)]
    return [Series("hypotheses", labels, sentences, rows=_rows(row, [end.values for end in ends]))]


def _rows(row: BodyNumbers, each: Sequence[Values]) -> Array:
    return np.array([row(values) for values in each])[:, None]


MOST_ITERATES = 64  # of a solver that are kept
MOST_UNKNOWNS = 500  # unknowns, up to which the condition number is computed at every kept iterate


def kept_iterates(count: int, most: int = MOST_ITERATES) -> Index:
    """Which of `count` iterates are kept: the first and the last, and more at the beginning.

    >>> kept_iterates(3).tolist(), kept_iterates(1000, 5).tolist()
    ([0, 1, 2], [0, 5, 31, 177, 999])
    """
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.geomspace(1, count, most) - 1).astype(int))


def tracks(
    solutions: Mapping[str, Solution],
    problem: Problem,
    row: BodyNumbers,
    start: Mapping[str, Any],
    data: Problem | None = None,
) -> list[dict[str, Any]]:
    """The runs of solvers, by name, on one problem from one start.

    `data` is the same problem without its priors: what the data alone determine at each iterate.
    """
    with limited_threads():
        return [_track(name, s, problem, row, start, data) for name, s in solutions.items()]


def _track(
    name: str,
    solution: Solution,
    problem: Problem,
    row: BodyNumbers,
    start: Mapping[str, Any],
    data: Problem | None,
) -> dict[str, Any]:
    kept_rows = kept_iterates(len(solution.trace))
    iterates = [solution.trace[i] for i in kept_rows]
    ranks = [] if data is None else _ranks(data, iterates, start)
    return {
        "name": name,
        "status": solution.status.name.lower().replace("_", " "),
        "iterations": solution.iterations,
        "iterates": kept_rows.tolist(),
        "x": packed([row(iterate.values) for iterate in iterates], "f4"),
        "cost": [float(f"{iterate.cost:.12g}") for iterate in iterates],
        "optimality": as_numbers([iterate.optimality for iterate in iterates]),
        "damping": as_numbers([iterate.damping for iterate in iterates]),
        "condition": as_numbers(list(_conditions(problem, iterates, start))),
        "rank": as_numbers(ranks),
        "unknowns": problem.free.size,
        "seconds": as_numbers([iterate.seconds for iterate in iterates]),
        "evaluations": [iterate.evaluations.total for iterate in iterates],
    }


def _conditions(
    problem: Problem, iterates: Iterable[Iterate], start: Mapping[str, Any]
) -> Iterable[float]:
    for iterate in iterates:
        if problem.free.size > MOST_UNKNOWNS:
            yield float("nan")
        else:
            J = problem.linearize(dict(start) | iterate.values).dense
            s = np.linalg.svd(J, compute_uv=False)
            yield float(s[0] / s[-1]) if s.size and s[-1] > 0 else float("nan")


def _ranks(data: Problem, iterates: Iterable[Iterate], start: Mapping[str, Any]) -> list[float]:
    """How many directions the data alone see at each iterate; NaN where they cannot be asked."""
    if data.free.size > MOST_UNKNOWNS:
        return []
    ranks = []
    for iterate in iterates:
        here = data.linearize(dict(start) | iterate.values)
        finite = np.isfinite(here.dense).all()
        ranks.append(float(here.rank) if finite else float("nan"))
    return ranks


def as_numbers(array: ArrayLike) -> Any:
    """An array as nested lists of nine digits each, with null where there is no number."""
    numbers = np.asarray(array, dtype=float)
    if numbers.ndim:
        return [as_numbers(row) for row in numbers]
    return float(f"{numbers:.9g}") if np.isfinite(numbers) else None


MOST_DIRECTIONS = 40
UNSEEN_REACH = 0.5  # units along a direction that nothing holds
LONGEST_REACH = 1.0  # units: two sigmas may lie far outside of the linear range
EXACT_POINTS = 21  # at which the true change of the data is computed, from one end to the other
LEAST_MOTION = 1e-3  # m: a direction that moves no point of the body by this much is not shown
DRAWS = 40

Surface = Callable[[Array], Array]


def reach_along(direction: Direction, tolerance: float) -> float:
    """How far a body is moved along a direction, in its units: two standard deviations, or less.

    A direction whose change is at most the `tolerance` is not seen, and has no standard deviation.
    """
    if direction.change <= tolerance:
        return UNSEEN_REACH
    return min(2 / direction.change, LONGEST_REACH)


def moving_directions(
    diagnosis: Diagnosis, row: BodyNumbers, surface: Surface
) -> list[dict[str, Any]]:
    """Null and weak directions of a diagnosis that move the body, the unseen ones first.

    `surface` takes the body's numbers to its vertices (N, 3) m.
    """
    d = diagnosis
    moving: list[dict[str, Any]] = []
    x, fixed = d.problem.split(d.values)
    residual, known = d.problem.residual(x, fixed), row(d.values)
    here = surface(known)
    for k, direction in enumerate((*d.null_directions, *d.weak_directions)):
        if len(moving) == MOST_DIRECTIONS:
            break
        step = row(d.free.unpack(x + direction.vector, d.values)) - known
        reach = reach_along(direction, d.tolerance)
        away = np.linalg.norm(surface(known + reach * step) - here, axis=1).max()
        if away < LEAST_MOTION:
            continue
        exact = [
            float(np.linalg.norm(d.problem.residual(x + s * direction.vector, fixed) - residual))
            for s in reach * np.linspace(-1, 1, EXACT_POINTS)
        ]
        unseen = k < len(d.null_directions)
        moving.append(
            {
                "name": direction.name,
                "kind": "not seen by the data" if unseen else "hardly seen by the data",
                "change": float(f"{direction.change:.3g}"),
                "reach": reach,
                "step": packed(step, "f8"),
                "exact": [float(f"{number:.4g}") for number in exact],
            }
        )
    return moving


def gaussian_draws(
    diagnosis: Diagnosis, row: BodyNumbers, count: int = DRAWS, seed: int = 0
) -> list[Array]:
    """Rows of numbers drawn from N(x, (J'J)^-1) about the solution; none where J'J is singular."""
    d = diagnosis
    if d.rank < d.shape[1]:
        return []
    x = d.free.pack(d.values)
    variances, axes = np.linalg.eigh(d.here.covariance)
    root = axes * np.sqrt(np.maximum(variances, 0.0))  # by rounding, some may be below zero
    z = np.random.default_rng(seed).standard_normal((count, len(x)))
    return [row(d.free.unpack(x + root @ draw, d.values)) for draw in z]
