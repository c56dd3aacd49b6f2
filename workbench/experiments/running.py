"""Running an experiment: its solution and diagnosis, other solvers, and what figures need."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values, checks
from workbench.bodies.body import Body
from workbench.bodies.forward.sources import arguments_from_values
from workbench.diagnostics import Diagnosis, diagnose_whole
from workbench.errors import BadSetup, WorkbenchError
from workbench.experiments.experiment import Experiment, user_errors
from workbench.fitting.doubts import doubts
from workbench.fitting.measures import Measurement, measurements
from workbench.fitting.setup import Measure, Setup, View
from workbench.interrupts import caused_by
from workbench.problem import Problem
from workbench.solvers import DEFAULT, SOLVERS, Callback, Solution, Solver, Status
from workbench.solvers.starts import AS_GOOD
from workbench.threads import limited_threads

COST_ROUNDING = 1e-16  # of the cost at the start: below it a difference of costs is rounding


def best_cost(solutions: Mapping[str, Solution]) -> float:
    """The lowest cost among solutions; NaN if none is finite."""
    return min((s.cost for s in solutions.values() if math.isfinite(s.cost)), default=math.nan)


def excess(solution: Solution, among: Mapping[str, Solution]) -> float:
    """By which share of the lowest of several costs a solution's cost exceeds it."""
    return relative_excess(solution.cost, best_cost(among), start_cost(among))


def relative_excess(cost: float, best: float, start: float) -> float:
    """(cost - best) / best; 0 where the difference is rounding of the cost at the start.

    It is infinite for a cost above a best cost of 0.
    """
    above = cost - best
    if above <= COST_ROUNDING * start:
        return 0.0
    return above / abs(best) if best else math.inf * above


def share_left(costs: ArrayLike, best: float, start: float) -> Array:
    """(costs - best) / (start - best): 1 at the start, 0 at the best.

    Where the start is no higher than the best, the differences costs - best are returned.
    """
    whole = start - best
    return (np.asarray(costs, dtype=float) - best) / (whole if whole > 0 else 1.0)


def start_cost(among: Mapping[str, Solution]) -> float:
    """The largest finite cost at which one of the solutions began; 0 if none is known."""
    starts = [s.trace[0].cost for s in among.values() if s.trace]
    return max((cost for cost in starts if math.isfinite(cost)), default=0.0)


def as_good(solutions: Mapping[str, Solution]) -> tuple[str, ...]:
    """The names of solutions within one millionth of the lowest cost, in the order given.

    They count as equally good, whatever their times and the rounding of their costs.
    """
    return tuple(name for name, s in solutions.items() if excess(s, solutions) <= AS_GOOD)


def ending_in_words(status: Status, above: bool) -> str:
    """How a solver ended: `converged, not lowest` where one of several costs is lower."""
    words = status.name.lower().replace("_", " ")
    return f"{words}, not lowest" if above and status is Status.CONVERGED else words


@dataclass(frozen=True, eq=False)
class Overlay:
    """A fitted body as one camera sees it, in pixels of its image."""

    view: View  # the camera and what it observed
    landmarks: tuple[str, ...]  # the names of the M landmarks
    projected: Array  # (M, 2) where the fitted body has them
    surface: Array  # (N, 2) the body's vertices
    depth: Array  # (N,) their distances from the camera's plane in m
    vertices: Array  # (N, 3) the vertices in space, in m


@dataclass(frozen=True, eq=False)
class Outcome:
    """All that a run of an experiment found; figures and reports are made from it."""

    name: str  # the experiment's name
    setup: Setup  # what was solved
    solver: str  # the solver's name in `SOLVERS`, or what it calls itself if it has other options
    solution: Solution  # what that solver found
    values: Values  # the values of every block at the solution, free and fixed
    costs: Mapping[str, float]  # what each residual adds to the cost, by its name
    diagnosis: Diagnosis  # the diagnosis at the solution
    # the diagnosis without the priors, if there are both priors and data
    data_alone: Diagnosis | None
    compared: Mapping[str, Solution]  # the solutions of all solvers from the same start, by name
    skipped: tuple[str, ...]  # the solvers that an interrupt prevented from running
    measures: tuple[Measure, ...]  # the numbers of the summary
    overlays: tuple[Overlay, ...]  # the fitted body in each view
    surface: Array | None  # (N, 3) m, the posed body, if there is one
    source: str = ""  # the user's file that the run is about
    doubts: tuple[str, ...] = ()  # what speaks against the fit, in sentences
    measurements: tuple[Measurement, ...] = ()  # those of the person, if one is fitted

    @property
    def best_cost(self) -> float:
        """The lowest cost that any of the compared solvers found."""
        return best_cost(self.compared)

    def excess(self, name: str) -> float:
        """How far a solver's cost is above the best one, as a share of the best one."""
        return excess(self.compared[name], self.compared)

    @property
    def better(self) -> str | None:
        """The first solver whose cost is lower by more than a millionth, or None."""
        good = as_good(self.compared)
        return good[0] if good and self.solver not in good else None

    @property
    def interrupted(self) -> bool:
        """Whether an interrupt from the keyboard stopped a solver."""
        stopped = any(s.status is Status.STOPPED for s in self.compared.values())
        return stopped or bool(self.skipped)

    @property
    def prior_share(self) -> float:
        """The priors' share of the cost, from 0 to 1; NaN if the cost is zero."""
        whole = sum(self.costs.values())
        return sum(self.costs[name] for name in self.setup.priors) / whole if whole else np.nan


Progress = Callable[[str], object]  # called with a line when a step begins


def run(
    experiment: Experiment,
    solver: Solver | None = None,
    *,
    compare: bool = True,
    callback: Callback = None,
    progress: Progress = lambda text: None,
) -> Outcome:
    """Solve an experiment, diagnose its Jacobian, and solve it with the solvers that it compares.

    An interrupt from the keyboard ends the current solve and skips all that would follow; what
    was found until then is kept. Raises WorkbenchError if the start has no finite cost.
    """
    progress(f"building {experiment.name}")
    setup = experiment.setup()
    _measured(experiment, setup, setup.start)  # so that a mistake in it is found before the solve
    strategy = setup.strategy or (lambda solver: solver or SOLVERS[DEFAULT])
    chosen, solver = solver, strategy(solver)
    names = setup.compared if compare else ()
    progress("differentiating")
    warm_up(setup, [solver])
    progress("solving")
    solution = solver.solve(setup.problem, setup.start, callback=callback)
    if not np.isfinite(solution.cost):
        raise WorkbenchError(
            f"{experiment.name} has no finite cost, or no derivatives, where it starts: "
            f"{solution.message}"
        )
    name = _solver_name(chosen, solver, solution)
    values = dict(setup.start) | solution.values
    progress("looking at the Jacobian")
    diagnosis = diagnose_whole(setup.problem, values, priors=setup.priors, gauges=setup.gauges)
    data_alone = (
        diagnose_whole(setup.problem.without(*setup.priors), values, gauges=setup.gauges)
        if 0 < len(setup.priors) < len(setup.problem.residuals)
        else None
    )
    compared, skipped = _compare(setup, name, solution, names, progress)
    body = setup.body
    arguments = arguments_from_values(body, setup.problem.points, values) if body else None
    return Outcome(
        name=experiment.name,
        setup=setup,
        solver=name,
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
        measurements=measurements(setup.body, setup.problem, values, setup.priors),
        overlays=tuple(overlay(body, view, values, arguments) for view in setup.views)
        if body and arguments
        else (),
        surface=body.vertices(*arguments) if body and arguments else None,
        source=experiment.source,
        doubts=doubts(setup, values, solution),
    )


def _solver_name(chosen: Solver | None, solver: Solver, solution: Solution) -> str:
    """The name of a solver in `SOLVERS`, or what it calls itself."""
    if chosen is not None and solver is not chosen:
        return solution.solver  # with the stages and starts of a setup
    ours = type(solver).__module__.partition(".")[0] == "workbench"
    options = " (with other options)" if chosen is not None and ours else ""
    return catalogue_name(solver) or f"{solution.solver}{options}"


def _measured(experiment: Experiment, setup: Setup, values: Values) -> tuple[Measure, ...]:
    with user_errors(experiment.source):
        measures = setup.measures(values)
        return checks.several("what `measures` returns", measures, Measure, BadSetup)


def warm_up(setup: Setup, solvers: Iterable[Solver]) -> None:
    """Begin to solve with each solver, so that no clock counts what is made only once.

    That is what is derived for a problem, also what a solver asks for only at its end, and what a
    solver loads and builds at its first call: IPOPT's library, exact Hessians.
    """
    warm(setup.problem, setup.start)
    for solver in solvers:
        with suppress(WorkbenchError):
            solver.solve(setup.problem, setup.start, callback=lambda iterate: True)


def warm(problem: Problem, start: Values) -> None:
    """Build and call what solves of a problem build only once, so that no clock counts it."""
    problem.prepare()
    x, fixed = problem.split(start)
    with limited_threads():
        problem.residual(x, fixed)
        problem.cost_and_gradient(x, fixed)
        problem.linearize_at(x, fixed)


def overlay(
    body: Body, view: View, values: Values, arguments: tuple[Array, Array, Array]
) -> Overlay:
    """Project the landmarks and the surface of a body, at pose, betas and trans, into a view."""
    surface = body.vertices(*arguments)
    landmarks = body.landmark(view.landmarks, *arguments)
    return Overlay(
        view=view,
        landmarks=body.landmark_names(view.landmarks),
        projected=view.camera.pixels(landmarks, values),
        surface=view.camera.pixels(surface, values),
        depth=view.camera.depths(surface, values),
        vertices=surface,
    )


def catalogue_name(solver: Solver) -> str | None:
    """The name in `SOLVERS` of the solver with the same options, or None."""
    return next((name for name, known in SOLVERS.items() if known == solver), None)


def _compare(
    setup: Setup, name: str, solution: Solution, others: Sequence[str], progress: Progress
) -> tuple[dict[str, Solution], tuple[str, ...]]:
    """The solutions of the named solver and of the others, and the solvers that did not run.

    An interrupt from the keyboard skips all solvers that would follow. A solver that cannot solve
    the problem is left out, and `progress` is called with the reason.
    """
    solutions = {name: solution}
    remaining = [other for other in dict.fromkeys(others) if other != name]
    while remaining and solutions.get(name, solution).status is not Status.STOPPED:
        name = remaining[0]
        progress(f"comparing: {name}")
        try:
            solver = SOLVERS[name] if setup.strategy is None else setup.strategy(SOLVERS[name])
            warm_up(setup, [solver])
            solutions[name] = solver.solve(setup.problem, setup.start)
        except (KeyboardInterrupt, SystemError) as error:
            if not caused_by(error, KeyboardInterrupt):
                raise
            break
        except WorkbenchError as error:
            progress(f"{name} cannot solve this: {error}")
        remaining = remaining[1:]
    order = dict.fromkeys((*(n for n in solutions if n not in others), *others))
    return {n: solutions[n] for n in order if n in solutions}, tuple(remaining)
