"""A named problem with a start, what is known about its answer, and what came of solving it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.behind import arguments_behind
from workbench.diagnostics import Diagnosis, diagnose_whole
from workbench.errors import BadSetup, UnknownName, WorkbenchError
from workbench.experiments import comparison
from workbench.experiments.arguments import names
from workbench.experiments.blame import blaming
from workbench.experiments.known import Known
from workbench.geometry.camera import Camera
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.solvers import SOLVERS, Callback, Solution, Solver, Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Measure:
    """One number of the summary, with its unit: `reprojection, camera 1`, 12.3, `px`."""

    name: str
    value: float
    unit: str
    over: str = ""  # what it is a mean over: `17 keypoints with a confidence above 0.2`


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
    """A problem ready to be solved, and what there is to look at afterwards.

    Raises BadSetup, UnknownName, or what Problem.split says about a start that does not do.
    """

    problem: Problem
    start: Values
    question: str  # what this experiment asks, in a sentence or two
    body: SkinnedBody | None = None
    views: tuple[View, ...] = ()
    truth: Array | None = None  # (N, 3) m, the true surface, where it is known
    measures: Callable[[Values], tuple[Measure, ...]] = lambda values: ()
    priors: tuple[str, ...] = ()  # the residuals that are no data
    compared: tuple[str, ...] = ()  # names of SOLVERS to run on the same problem and start
    known: Known | None = None  # the answer, or the best cost, where there is one beforehand
    synthetic: str = ""  # what was made up, in a sentence, where not all was measured
    notes: tuple[str, ...] = ()  # sentences on data that were given and not used, or taken on trust
    made_of: Values | None = None  # blocks that synthetic data were made of, before any noise

    def __post_init__(self) -> None:
        _expect("problem", self.problem, Problem, "a Problem")
        _expect("start", self.start, Mapping, "a dict of arrays by the names of blocks")
        _expect("body", self.body, (SkinnedBody, NoneType), "a SkinnedBody or None")
        _expect("question", self.question, str, "a text")
        _expect("known", self.known, (Known, NoneType), "a Known or None")
        _expect("views", self.views, (tuple, list), "several Views")
        for view in self.views:
            _expect("views", view, View, "several Views")
        shape = None if self.body is None else self.body.template.shape
        if self.truth is not None and shape not in (None, np.shape(self.truth)):
            raise BadSetup(
                f"`truth` of a setup must have the shape {shape} of the body's vertices, not "
                f"{np.shape(self.truth)}"
            )
        for name, known, kind in (
            ("compared", SOLVERS, "solver"),
            ("priors", self.problem.rows, "residual"),
        ):
            _expect(name, getattr(self, name), (Iterable, Residual), f"names of {kind}s")
            several = names(getattr(self, name))
            object.__setattr__(self, name, several)  # a single name is one, not its letters
            for one in several:
                if one not in known:
                    raise UnknownName(kind, one, known)
        object.__setattr__(self, "notes", names(self.notes))
        _expect("synthetic", self.synthetic, str, "a text")
        self.problem.split(self.start)
        if self.known is not None:
            self.known.check(self.problem)
        _expect("made_of", self.made_of, (Mapping, NoneType), "a dict of arrays by block, or None")
        if self.made_of is not None:
            self.problem.free.pack(dict(self.start) | dict(self.made_of))


def _expect(name: str, value: object, kind: type | tuple[type, ...], wanted: str) -> None:
    if not isinstance(value, kind):
        raise BadSetup(f"`{name}` of a setup must be {wanted}, not {value!r:.80}")


@dataclass(frozen=True)
class Experiment:
    """A function that makes a setup, and its arguments: symbols do not pickle, this does."""

    name: str
    build: Callable[..., Setup]
    summary: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""  # the file that it is from or about; "" for what comes with the workbench

    def setup(self) -> Setup:
        """Build it.

        Raises BadFile where the file that it is from is wrong, with the line, and BadArgument
        where an argument is.
        """
        with blaming(self.source, self.name, self.arguments):
            setup = self.build(**self.arguments)
            if not isinstance(setup, Setup):
                raise BadSetup(
                    f"the function that builds it must return a Setup, not {setup!r:.80}"
                )
            return setup


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
    solver: str  # that was asked; its name in SOLVERS if it is there as it was
    solution: Solution  # what it found
    values: Values  # of every block, free and fixed
    costs: Mapping[str, float]  # what each residual adds to the cost, by name
    diagnosis: Diagnosis
    data_alone: Diagnosis | None  # the same without the priors, where there are any
    compared: Mapping[str, Solution]  # the same problem and start, by solver; this one's too
    skipped: tuple[str, ...]  # solvers that were to be compared, but for an interrupt
    measures: tuple[Measure, ...]
    overlays: tuple[Overlay, ...]
    surface: Array | None  # (N, 3) m, the posed body
    source: str = ""  # the file that it is about

    @property
    def best_cost(self) -> float:
        """The lowest cost that any of the compared solvers found."""
        return comparison.best_cost(self.compared)

    def excess(self, name: str) -> float:
        """How far a solver's cost is above the best one, as a share of that."""
        return comparison.excess(self.compared[name], self.compared)

    @property
    def better(self) -> str | None:
        """The first solver of those that found less cost than this one by more than a millionth."""
        good = comparison.as_good(self.compared)
        return good[0] if good and self.solver not in good else None

    @property
    def interrupted(self) -> bool:
        """Whether the keyboard stopped a solver."""
        stopped = any(s.status is Status.STOPPED for s in self.compared.values())
        return stopped or bool(self.skipped)

    @property
    def prior_share(self) -> float:
        """What the priors' part of the cost is, 0 to 1; NaN of a cost of zero."""
        whole = sum(self.costs.values())
        return sum(self.costs[name] for name in self.setup.priors) / whole if whole else np.nan


Progress = Callable[[str], object]  # told what begins


def run(
    experiment: Experiment,
    solver: Solver | None = None,
    *,
    compare: bool = True,
    callback: Callback | None = None,
    progress: Progress = lambda text: None,
) -> Outcome:
    """Solve an experiment, look at its Jacobian, and solve it with the solvers it compares.

    An interrupt from the keyboard ends a solve, and all that would come after it; what was found
    until then is kept.
    """
    progress(f"building {experiment.name}")
    setup = experiment.setup()
    _measured(experiment, setup, setup.start)  # a mistake in there is better found now
    solver = solver or SOLVERS["levenberg-marquardt"]
    wanted = setup.compared if compare else ()
    progress("deriving")  # before anything is timed
    _prepare(setup.problem, solver, wanted)
    progress("solving")
    solution = solver.solve(setup.problem, setup.start, callback=callback)
    if not np.isfinite(solution.cost):
        raise WorkbenchError(
            f"{experiment.name} has no finite cost, or no slope, where it starts: "
            f"{solution.message}"
        )
    own = comparison.catalogue_name(solver) or f"{solution.solver} (with other options)"
    values = dict(setup.start) | solution.values
    progress("looking at the Jacobian")
    diagnosis = diagnose_whole(setup.problem, values, priors=setup.priors)
    data_alone = (
        diagnose_whole(setup.problem.without(*setup.priors), values)
        if 0 < len(setup.priors) < len(setup.problem.residuals)
        else None
    )
    compared, skipped = comparison.compare(
        setup.problem, setup.start, {own: solution}, wanted, progress
    )
    body = setup.body
    read = [points for residual in setup.problem.residuals for points in residual.points]
    arguments = arguments_behind(body, read, values) if body else None
    return Outcome(
        name=experiment.name,
        setup=setup,
        solver=own,
        solution=solution,
        values=values,
        costs={
            name: 0.5 * float(diagnosis.here.residual[rows] @ diagnosis.here.residual[rows])
            for name, rows in setup.problem.rows.items()
        },
        diagnosis=diagnosis,
        data_alone=data_alone,
        compared=compared,
        skipped=skipped,
        measures=_measured(experiment, setup, values),
        overlays=tuple(overlay(body, view, values, arguments) for view in setup.views)
        if body and arguments
        else (),
        surface=body.vertices(*arguments) if body and arguments else None,
        source=experiment.source,
    )


def _measured(experiment: Experiment, setup: Setup, values: Values) -> tuple[Measure, ...]:
    with blaming(experiment.source):
        found = setup.measures(values)
        _expect("measures", found, (tuple, list), "a function that returns several Measures")
        for one in found:
            _expect("measures", one, Measure, "a function that returns several Measures")
        return tuple(found)


def _prepare(problem: Problem, solver: Solver, compared: Iterable[str]) -> None:
    """Build the functions that the solvers will call."""
    problem.prepare()
    exact = SOLVERS["ipopt-exact"]
    if solver == exact or "ipopt-exact" in compared:
        _ = problem.hessian


def overlay(
    body: SkinnedBody, view: View, values: Values, arguments: tuple[Array, Array, Array]
) -> Overlay:
    """Project the landmarks and the surface of a body, at pose, betas and trans, into a view."""
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
