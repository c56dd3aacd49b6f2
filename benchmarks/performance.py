"""How fast derivatives, steps and whole fits are, beside peers and what the hardware allows."""

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.optimize

import workbench as wb
from benchmarks import candidates, measuring, performance_large
from benchmarks.candidates import COMPILED, FLOOR, NUMPY, Candidate, Disagreement
from benchmarks.measuring import digits, milliseconds, peak, ratio, side_by_side, table
from benchmarks.problems import BODIES, SIGMA, Case, body_called, case_of, random_body
from workbench.arrays import Array
from workbench.solvers import Status
from workbench.solvers.limits import Stop

PACKAGES = ("jax", "jaxlib", "torch", "smplx", "libigl", "smplfitter")  # peers
KINDS = {"forward": "forward", "jacobian": "Jacobian", "step": "Gauss-Newton step"}
HANDS = "full-hands"  # 52 joints, where the others have 24
SIZES = (700, 1700, 6890, 20_000, 100_000)  # vertices, of scaling
TINY = 40  # vertices of a quick run
GOAL = 1e-6  # m, the largest distance of a vertex
LM, GN, IPOPT = "Levenberg-Marquardt", "Gauss-Newton", "IPOPT"
TO_THE_END, ALONE = "Levenberg-Marquardt to its own end", "its linearizations and solves alone"
SCIPY_LM, SCIPY_TRF = "scipy lm, our Jacobian", "scipy trf, our Jacobian"
MEMORY = {
    "before": "imports alone",
    "arrays": "the arrays of the body",
    "body": "peak with the body",
    "forward": "peak with a forward",
    "peak": "peak with a step",
}


@dataclass(frozen=True)
class Part:
    """What is measured in one go: how, and how it is written."""

    heading: str
    measure: Callable[[bool], dict[str, Any]]  # quick -> numbers
    table: Callable[[Mapping[str, Any]], str]


def measured(quick: bool, parts: Sequence[str] = ()) -> dict[str, Any]:
    """The parts that are asked for, or all."""
    found: dict[str, Any] = {}
    for name in parts or PARTS:
        print(f"performance: {name}", flush=True)
        found[name] = PARTS[name].measure(quick)
    return found


def tables(found: Mapping[str, Any]) -> str:
    """Every part that was measured, under its heading; milliseconds are least / median."""
    text = []
    for name, part in PARTS.items():
        if name in found:
            numbers = dict(found[name])
            where = numbers.pop("machine", None)
            text += [f"## {part.heading}\n", part.table(numbers)]
            text += [measuring.measured_on(where) + "\n"] if where else []
    return "\n".join(text)


# Derivatives


def derivatives(quick: bool, bodies: Iterable[str] = (*BODIES, HANDS)) -> dict[str, Any]:
    """By body: seconds by kind and candidate, and how far each candidate is from the workbench."""
    rounds, bodies = (1, (str(TINY),)) if quick else (12, bodies)
    return {name: _derivatives(body_called(name), name, rounds) for name in bodies}


def _derivatives(body: wb.SkinnedBody, name: str, rounds: int) -> dict[str, Any]:
    """Raises Disagreement if a candidate computes something else."""
    made = candidates.cases(name, body)
    case = made[NUMPY]
    x, *people = case.people(4)
    case = case.seeing(x)
    all_of_them = [candidates.ours(way, one.seeing(x)) for way, one in made.items()]
    all_of_them += candidates.installed(case)
    apart = {one.name: candidates.check(one, case, people[0]) for one in all_of_them}
    all_of_them.append(candidates.floor(case))
    return {
        "vertices": case.body.n_vertices,
        "unknowns": case.problem.free.size,
        "apart": apart,
        "remarks": {one.name: one.remark for one in all_of_them if one.remark},
        "seconds": {kind: side_by_side(_by(all_of_them, kind), people, rounds) for kind in KINDS},
    }


def _by(several: list[Candidate], kind: str) -> dict[str, Any]:
    return {one.name: getattr(one, kind) for one in several}


def _table_of_derivatives(bodies: Mapping[str, Any]) -> str:
    text = []
    for name, body in bodies.items():
        heads = [head for kind in KINDS.values() for head in (f"{kind}, ms", "× ours")]
        rows = []
        for one in body["seconds"]["jacobian"]:
            cells: list[str] = []
            for seconds in body["seconds"].values():
                cells += [milliseconds(seconds[one]), digits(ratio(seconds, one, NUMPY))]
            rows.append((one, *cells))
        text.append(table((_called(name, body), *heads), rows))
    return "\n".join(text)


def _called(name: str, body: Mapping[str, Any]) -> str:
    N = f"N = {body['vertices']:,}"
    return N if name.isdigit() else f"{name}, {N}"


# Whole fits: the vertices of somebody are seen without noise, and found from zero to a micron


class Reached(Exception):
    """A peer is at the goal, and is told so; its argument is where."""


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

    def jacobian(x: Array) -> Any:
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


def fits(quick: bool, bodies: Iterable[str] = BODIES) -> dict[str, Any]:
    """By body: seconds per fit, by way of computing and method, and how often what was evaluated.

    Everybody stops as soon as the largest distance is below the goal.
    """
    rounds, bodies = (1, (str(TINY),)) if quick else (6, bodies)
    return {name: _fits(name, rounds) for name in bodies}


def _fits(name: str, rounds: int, people: int = 3) -> dict[str, Any]:
    """Of some people. Raises Disagreement if a method does not come to the goal."""
    methods: dict[str, Callable[[Any], Any]] = {}
    evaluations: dict[str, list[dict[str, int]]] = {}
    vertices = 0
    for way, case in candidates.cases(name, body_called(name)).items():
        seen = [case.seeing(x) for x in case.people(people)]
        vertices = case.body.n_vertices
        for method, by_method in _methods(seen):
            fit, label = candidates.as_built(way, by_method), f"{way}: {method}"
            evaluations[label] = [_checked(label, one, fit(one)) for one in seen]
            methods[label] = partial(_each, fit, seen)
    seconds = side_by_side(methods, [None], rounds, parts=people)
    return {"vertices": vertices, "evaluations": evaluations, "seconds": seconds}


def _each(fit: Callable[[Case], Any], cases: list[Case], _: object) -> None:
    for case in cases:
        fit(case)


def _methods(cases: list[Case]) -> Iterator[tuple[str, Callable[[Case], Any]]]:
    yield LM, lambda case: by(case, wb.LevenbergMarquardt())
    ways = {id(case): by(case, wb.LevenbergMarquardt()) for case in cases}
    yield ALONE, lambda case: its_linearizations_and_solves(case, ways[id(case)])
    yield TO_THE_END, lambda case: by(case, wb.LevenbergMarquardt(), goal=0.0)
    yield GN, lambda case: by(case, wb.GaussNewton())
    yield IPOPT, lambda case: by(case, wb.Ipopt())
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


def _table_of_fits(bodies: Mapping[str, Any]) -> str:
    text = []
    for name, body in bodies.items():
        rows = []
        for label, one in body["seconds"].items():
            mine = f"{label.partition(':')[0]}: {LM}"
            counts = sorted({n["jacobian"] for n in body["evaluations"][label] if n})
            between = "–".join(str(n) for n in dict.fromkeys((*counts[:1], *counts[-1:])))
            rows.append(
                (label, milliseconds(one), digits(ratio(body["seconds"], label, mine)), between)
            )
        text.append(table((_called(name, body), "fit, ms", "× LM", "linearizations"), rows))
    return "\n".join(text)


# Cost and memory against the number of vertices


def scaling(quick: bool) -> dict[str, Any]:
    """Seconds by kind, candidate and size, all taking turns; bytes by candidate and size."""
    sizes, rounds = ((TINY, 2 * TINY), 1) if quick else (SIZES, 6)
    memory: dict[str, Any] = {}
    several: dict[str, Candidate] = {}
    people: list[Array] = []
    for N in sizes:
        made = candidates.cases(str(N), random_body(N))
        for way, case in made.items():
            asked = measuring.in_a_process_of_its_own(memory_of, N, way)
            memory.setdefault(way, {})[str(N)] = asked
            several[f"{way}/{N}"] = candidates.ours(way, case)
        several[f"{FLOOR}/{N}"] = candidates.floor(made[NUMPY])
        people = people or made[NUMPY].people(4)
    seconds: dict[str, Any] = {}
    for kind in KINDS:
        calls = {key: getattr(one, kind) for key, one in several.items()}
        for key, taken in side_by_side(calls, people, rounds).items():
            name, _, size = key.rpartition("/")
            seconds.setdefault(kind, {}).setdefault(name, {})[size] = taken
    return {"sizes": list(sizes), "seconds": seconds, "bytes": memory}


def memory_of(n_vertices: int, way: str) -> dict[str, int]:
    """Bytes of this process, which should have done nothing else: before, and at the worst.

    `arrays` are those that the body is given in, without which there is no body.
    """
    before = peak()
    body = random_body(n_vertices)
    arrays = [body.template, body.shapedirs, body.posedirs, body.weights]
    with candidates.compiling(way == COMPILED):
        case = case_of(str(n_vertices), body)
        with_body = peak()
        (x,) = case.people(1)
        case.problem.residual(x, case.fixed)
        forward = peak()
        case.problem.linearize_at(x, case.fixed).step()
    return {
        "before": before,
        "arrays": sum(array.nbytes for array in arrays),
        "body": with_body,
        "forward": forward,
        "peak": peak(),
    }


def _table_of_scaling(found: Mapping[str, Any]) -> str:
    sizes = [str(N) for N in found["sizes"]]
    heads = [f"N = {int(N):,}" for N in sizes]
    times = [
        (
            f"{name}: {KINDS[kind]}",
            *(digits(1e6 * of[N]["least"] / int(N)) if N in of else "" for N in sizes),
        )
        for kind, by_candidate in found["seconds"].items()
        for name, of in by_candidate.items()
    ]
    memory = [
        (f"{way}: {title}", *(digits(of[N][what] / 1e6) if N in of else "" for N in sizes))
        for way, of in found["bytes"].items()
        for what, title in MEMORY.items()
    ]
    per_vertex = table(("µs per vertex", *heads), times)
    return f"{per_vertex}\n{table(('memory, MB', *heads), memory)}"


large = performance_large
PARTS = {
    "derivatives": Part("Derivatives", derivatives, _table_of_derivatives),
    "fits": Part("Fits", fits, _table_of_fits),
    "meshes": Part("Meshes to parameters", large.meshes, large.table_of_meshes),
    "scaling": Part("Cost and memory by the number of vertices", scaling, _table_of_scaling),
    "lbfgs": Part("What `solve` adds to NLopt's L-BFGS", large.lbfgs, large.table_of_lbfgs),
    "vertices": Part("A step with free vertices", large.vertices, large.table_of_vertices),
    "videos": Part("A video as one problem", large.videos, large.table_of_videos),
    "closest": Part("Closest places on a surface", large.closest, large.table_of_closest),
}
