"""A named problem with a start, what is known about its answer, and what came of solving it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.diagnostics import Diagnosis, diagnose
from workbench.errors import WorkbenchError
from workbench.geometry.camera import Camera
from workbench.problem import Problem
from workbench.solvers import SOLVERS, Callback, Solution, Solver, Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Measure:
    """One number of the summary, with its unit: `reprojection, camera 1`, 12.3, `px`."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True, eq=False)
class View:
    """A camera that saw the landmarks `landmarks` of the body; `held_out` if the fit did not."""

    name: str
    camera: Camera
    size: tuple[int, int]  # width, height in px
    landmarks: str  # a landmark set of the body, or `joints`
    observed: Array  # (M, 2) px
    confidence: Array  # (M,), 0: not seen
    held_out: bool = False


@dataclass(frozen=True, eq=False)
class Setup:
    """A problem ready to be solved, and what there is to look at afterwards."""

    problem: Problem
    start: Values
    question: str  # what this experiment asks, in a sentence or two
    body: SkinnedBody | None = None
    views: tuple[View, ...] = ()
    truth: Array | None = None  # (N, 3) m, the true surface, where it is known
    measures: Callable[[Values], tuple[Measure, ...]] = lambda values: ()
    priors: tuple[str, ...] = ()  # the residuals that are no data
    compared: tuple[str, ...] = ()  # names of SOLVERS to run on the same problem and start


@dataclass(frozen=True)
class Experiment:
    """A function that makes a setup, and its arguments: symbols do not pickle, this does."""

    name: str
    build: Callable[..., Setup]
    summary: str
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def setup(self) -> Setup:
        """Build it."""
        return self.build(**self.arguments)


@dataclass(frozen=True, eq=False)
class Overlay:
    """What one view shows of a solution, all in pixels of its image."""

    name: str
    size: tuple[int, int]
    held_out: bool
    landmarks: tuple[str, ...]
    observed: Array  # (M, 2)
    confidence: Array  # (M,)
    projected: Array  # (M, 2)
    surface: Array  # (N, 2), the body's vertices
    depth: Array  # (N,) m from the camera, for drawing near faces last


@dataclass(frozen=True, eq=False)
class Outcome:
    """All that a run found; what is drawn and written is drawn and written from here."""

    name: str
    setup: Setup
    solution: Solution
    values: Values  # of every block, free and fixed
    diagnosis: Diagnosis
    data_alone: Diagnosis | None  # the same without the priors, where there are any
    compared: Mapping[str, Solution]  # the same problem and start, by name of the solver
    measures: tuple[Measure, ...]
    overlays: tuple[Overlay, ...]
    surface: Array | None  # (N, 3) m, the posed body


Progress = Callable[[str], object]  # told what begins


def run(
    experiment: Experiment,
    solver: Solver | None = None,
    *,
    compare: bool = True,
    callback: Callback | None = None,
    progress: Progress = lambda text: None,
) -> Outcome:
    """Solve an experiment, look at its Jacobian, and solve it with the solvers it compares."""
    progress(f"building {experiment.name}")
    setup = experiment.setup()
    progress("deriving")  # before anything is timed
    _prepare(setup.problem, setup.compared if compare else ())
    progress("solving")
    solution = (solver or SOLVERS["levenberg-marquardt"]).solve(
        setup.problem, setup.start, callback=callback
    )
    values = setup.start | solution.values
    progress("looking at the Jacobian")
    diagnosis = diagnose(setup.problem, values)
    data_alone = diagnose(setup.problem.without(*setup.priors), values) if setup.priors else None
    compared: dict[str, Solution] = {}
    stopped = solution.status is Status.STOPPED  # whoever stops a solve wants no more of them
    for name in setup.compared if compare and not stopped else ():
        progress(f"comparing: {name}")
        try:
            compared[name] = SOLVERS[name].solve(setup.problem, setup.start)
        except WorkbenchError as error:
            progress(f"{name} cannot solve this: {error}")
    body = setup.body
    return Outcome(
        name=experiment.name,
        setup=setup,
        solution=solution,
        values=values,
        diagnosis=diagnosis,
        data_alone=data_alone,
        compared=compared,
        measures=setup.measures(values),
        overlays=tuple(overlay(body, view, values) for view in setup.views) if body else (),
        surface=body.vertices(*_arguments(body, values)) if body else None,
    )


def _prepare(problem: Problem, compared: tuple[str, ...]) -> None:
    """Build the functions that the solvers will call."""
    problem.prepare()
    if "ipopt-exact" in compared:
        _ = problem.hessian


def overlay(body: SkinnedBody, view: View, values: Values) -> Overlay:
    """Project a body's landmarks and surface into a view."""
    arguments = _arguments(body, values)
    surface = body.vertices(*arguments)
    found = body.landmark(view.landmarks, *arguments)
    return Overlay(
        name=view.name,
        size=view.size,
        held_out=view.held_out,
        landmarks=body.landmark_names(view.landmarks),
        observed=view.observed,
        confidence=view.confidence,
        projected=view.camera.pixels(found, values),
        surface=view.camera.pixels(surface, values),
        depth=view.camera.depths(surface, values),
    )


def _arguments(body: SkinnedBody, values: Values) -> tuple[Array, Array, Array]:
    pose, betas, trans = (values[block.name] for block in body.blocks())
    return pose, betas, trans
