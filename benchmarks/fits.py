"""Whole fits: the vertices of somebody are seen without noise, and found from zero to a micron."""

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy.optimize

import workbench as wb
from benchmarks import ours
from benchmarks.bodies_made_up import SIGMA, Case, body_called
from benchmarks.candidates import Disagreement
from benchmarks.timing import side_by_side
from workbench.arrays import Array
from workbench.solvers import Status
from workbench.solvers.limits import Stop

GOAL = 1e-6  # m, the largest distance of a vertex
LM, GN, IPOPT = "Levenberg-Marquardt", "Gauss-Newton", "IPOPT"
TWO_STEPS = "Levenberg-Marquardt, two steps"
TO_THE_END, ALONE = "Levenberg-Marquardt to its own end", "its linearizations and solves alone"
SCIPY_LM, SCIPY_TRF = "scipy lm, our Jacobian", "scipy trf, our Jacobian"


class Reached(Exception):
    """A peer is at the goal, and is told so; its argument is where."""


def measure(name: str, rounds: int, people: int = 3, with_peers: bool = True) -> dict[str, Any]:
    """One body: seconds per fit of all of some people, by way of computing and method.

    Everybody stops as soon as the largest distance is below the goal. Raises Disagreement if one
    does not come there.
    """
    methods: dict[str, Callable[[Any], Any]] = {}
    evaluations: dict[str, list[dict[str, int]]] = {}
    vertices = 0
    for way, case in ours.cases(name, body_called(name)).items():
        seen = [case.seeing(x) for x in case.people(people)]
        vertices = case.body.n_vertices
        for method, by_method in _methods(seen, with_peers):
            fit, label = ours.as_built(way, by_method), f"{way}: {method}"
            evaluations[label] = [_checked(label, one, fit(one)) for one in seen]
            methods[label] = partial(_each, fit, seen)
    timings = side_by_side(methods, [None], rounds)
    seconds = {label: [t / people for t in taken] for label, taken in timings.items()}
    return {"vertices": vertices, "evaluations": evaluations, "seconds": seconds}


def by(case: Case, solver: wb.solvers.Solver, goal: float = GOAL) -> wb.Solution:
    """The workbench's own, through `solve`; like scipy's it ends where the residual says so.

    Half the sum of squares bounds the largest distance from above, at no cost.
    """
    start = case.body.start() | {"observed": case.observed}
    problem, reached = copy.copy(case.problem), [np.zeros(0)]

    def look(x: Array, r: Array) -> None:
        if r @ r <= (goal / SIGMA) ** 2:
            reached.append(x.copy())
            raise Stop(Status.STOPPED, "at the goal")

    def residual(x: Array, fixed: Array) -> Array:
        r = case.problem.residual(x, fixed)
        look(x, r)
        return r

    def linearize_at(x: Array, fixed: Array) -> wb.Linearization:
        here = case.problem.linearize_at(x, fixed)
        look(x, here.residual)
        return here

    vars(problem).update(residual=residual, linearize_at=linearize_at)  # of this copy
    solution = wb.solve(problem, start, solver)
    if reached[-1].size:
        return replace(solution, values=problem.free.unpack(reached[-1]))
    return solution


def by_scipy(case: Case, method: str) -> tuple[Array, dict[str, int]]:
    """scipy.optimize.least_squares with our residual and Jacobian, stopped at the same cost."""
    problem, fixed = case.problem, case.fixed
    counts = {"residual": 0, "jacobian": 0}

    def residual(x: Array) -> Array:
        counts["residual"] += 1
        r = problem.residual(x, fixed)
        if r @ r <= (GOAL / SIGMA) ** 2:
            raise Reached(x.copy())
        return r

    def jacobian(x: Array) -> Array:
        counts["jacobian"] += 1
        return problem.linearize_at(x, fixed).jacobian

    try:
        x = np.zeros(problem.free.size)
        options: dict[str, Any] = {"method": method, "jac": jacobian}
        return scipy.optimize.least_squares(residual, x, **options).x, counts
    except Reached as reached:
        return reached.args[0], counts


def its_linearizations_and_solves(case: Case, solution: wb.Solution) -> None:
    """What a solver cannot do without: the linearizations and steps of its way."""
    for i in solution.trace:
        case.problem.linearize_at(case.problem.free.pack(i.values), case.fixed).step(i.damping)


def _each(fit: Callable[[Case], Any], cases: list[Case], _: object) -> None:
    for case in cases:
        fit(case)


def _methods(cases: list[Case], with_peers: bool) -> Iterator[tuple[str, Callable[[Case], Any]]]:
    yield LM, lambda case: by(case, wb.LevenbergMarquardt())
    ways = {id(case): by(case, wb.LevenbergMarquardt()) for case in cases}
    yield ALONE, lambda case: its_linearizations_and_solves(case, ways[id(case)])
    yield TWO_STEPS, lambda case: by(case, wb.LevenbergMarquardt(steps_per_jacobian=2))
    yield TO_THE_END, lambda case: by(case, wb.LevenbergMarquardt(), goal=0.0)
    yield GN, lambda case: by(case, wb.GaussNewton())
    yield IPOPT, lambda case: by(case, wb.Ipopt())
    if with_peers:
        yield SCIPY_LM, lambda case: by_scipy(case, "lm")
        yield SCIPY_TRF, lambda case: by_scipy(case, "trf")


def _checked(label: str, case: Case, found: Any) -> dict[str, int]:
    """How often what was evaluated; raises Disagreement if the goal was missed."""
    if found is None:
        return {}
    if isinstance(found, wb.Solution):
        x, evaluations = case.problem.free.pack(found.values), vars(found.evaluations)
    else:
        x, evaluations = found
    away = float(np.linalg.norm(case.vertices(x) - case.observed, axis=1).max())
    if not away <= GOAL:
        raise Disagreement(f"{label} on {case.name} ends {away:.1e} m away; {GOAL:.0e} is asked")
    return dict(evaluations)
