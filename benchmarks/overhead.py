"""What counting, keeping the best and deciding about convergence cost: NLopt and IPOPT by hand.

The same noisy vertices, the same derivatives, the same variables, and by hand as many evaluations
as our own run took: what differs is what stands around them. By hand they are told when to stop,
which nobody knows beforehand; IPOPT by hand is timed once more deciding for itself, by our rule.
By hand nothing of our solvers runs, so the rule is written out here; that the counts of evaluations
agree says that it is the same.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as cs
import nlopt
import numpy as np

import workbench as wb
from benchmarks import ours
from benchmarks.bodies_made_up import SIGMA, Case, body_called
from benchmarks.candidates import Disagreement
from benchmarks.timing import side_by_side
from workbench.arrays import Array

BODY = "default"
IPOPT = wb.Ipopt(hessian=wb.solvers.gauss_newton_hessian)  # undamped, as the one by hand
SOLVERS: dict[str, wb.solvers.Solver] = {"NLopt's L-BFGS": wb.Nlopt("LD_LBFGS"), "IPOPT": IPOPT}
SAME = 1e-6  # of the cost
SLACK = 1  # evaluations: NLopt's L-BFGS does not look at its limit after every one
HAND, DECIDING = " by hand", " by hand, deciding"
OFTEN = {"NLopt's L-BFGS": 3, "IPOPT": 20}  # times as many rounds: short fits scatter most


class ByHand:
    """A count and the best point, and nothing else."""

    def __init__(self, case: Case) -> None:
        self.case, self.evaluations = case, 0
        self.x, self.cost = np.zeros(case.problem.free.size), np.inf

    def seen(self, x: Array, cost: float) -> float:
        """Count an evaluation, and keep its point if it is the best."""
        self.evaluations += 1
        if cost < self.cost:
            self.x, self.cost = x.copy(), cost
        return cost


def measure(rounds: int, people: int = 3, body: str = BODY) -> dict[str, Any]:
    """Seconds per fit of some people, ours and by hand; raises Disagreement if they end apart."""
    fits: dict[str, dict[str, Callable[[Any], Any]]] = {name: {} for name in SOLVERS}
    vertices = 0
    for way, case in ours.cases(body, body_called(body)).items():
        rng = np.random.default_rng(0)
        seen = [case.seeing(x) for x in case.people(people)]
        seen = [
            replace(one, observed=one.observed + rng.normal(0, SIGMA, one.observed.shape))
            for one in seen
        ]
        vertices = case.body.n_vertices
        for name, solver in SOLVERS.items():
            found = [_solved(one, solver) for one in seen]
            each = [
                (one, _steps(name, solution)) for one, solution in zip(seen, found, strict=True)
            ]
            fits[name][f"{way}: {name}"] = partial(_ours, solver, seen)
            for how, by_hand in BY_HAND[name].items():
                for (one, limit), solution in zip(each, found, strict=True):
                    _same(f"{name}{how}", by_hand(one, limit), solution)
                fits[name][f"{way}: {name}{how}"] = partial(_by_hand, by_hand, each)
    timings: dict[str, list[float]] = {}
    for name, methods in fits.items():
        timings |= side_by_side(methods, [None], rounds * OFTEN.get(name, 1))
    seconds = {label: [t / people for t in taken] for label, taken in timings.items()}
    return {"body": body, "vertices": vertices, "seconds": seconds}


def pairs(seconds: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The labels of ours, each with how its companions by hand go about it."""
    return [(label, how) for label in seconds for how in (HAND, DECIDING) if label + how in seconds]


def by_nlopt(case: Case, evaluations: int) -> ByHand:
    """L-BFGS in variables scaled by the columns of the Jacobian at the start, like ours."""
    problem, fixed, kept = case.problem, case.fixed, ByHand(case)
    scale = problem.linearize_at(kept.x, fixed).column_norms

    def cost(y: Array, gradient: Array) -> float:
        x = y / scale
        found, slope = problem.cost_and_gradient(x, fixed)
        gradient[:] = slope / scale
        return kept.seen(x, found)

    optimizer = nlopt.opt(nlopt.LD_LBFGS, scale.size)
    optimizer.set_min_objective(cost)
    optimizer.set_maxeval(evaluations)
    optimizer.optimize(kept.x * scale)
    return kept


def by_ipopt(case: Case, iterations: int | None) -> ByHand:
    """Cost, gradient and J'J as three callbacks with one linearization for each point.

    The cost of the start is that of its linearization, and no gradient asks for a cost. It ends
    after so many iterations; without a number, where it finds that nothing pulls any more.
    """
    problem, fixed, kept = case.problem, case.fixed, ByHand(case)
    n = problem.free.size
    last: dict[bytes, wb.Linearization] = {}
    costs: dict[bytes, float] = {}

    def at(x: Array) -> wb.Linearization:
        key = x.tobytes()
        if key not in last:
            last.clear()
            last[key] = problem.linearize_at(x, fixed)
        return last[key]

    def cost(x: Array) -> float:
        key = x.tobytes()
        if key in last:
            return last[key].cost
        if key not in costs:
            costs.clear()
            r = problem.residual(x, fixed)
            costs[key] = kept.seen(x, 0.5 * float(r @ r))
        return costs[key]

    at(kept.x)
    x, none, weight = cs.MX.sym("x", n), cs.MX(0, 1), cs.MX.sym("f")
    f = Callback("cost", n, (1, 1), cost)
    g = Callback("gradient", n, (n, 1), lambda x: at(x).gradient)
    h = Callback("hessian", n, (n, n), lambda x: at(x).normal)
    derivatives = {
        "grad_f": cs.Function("g", [x, none], [cs.MX.nan(), g(x)], ["x", "p"], ["f", "grad_f_x"]),
        "hess_lag": cs.Function(
            "h",
            [x, none, weight, none],
            [cs.triu(weight * h(x))],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    }
    quiet = {"print_level": 0, "sb": "yes", "tol": 1e-12}
    quiet |= {"nlp_scaling_method": "none", "acceptable_iter": 0}
    options = {"print_time": False, "no_nlp_grad": True, "error_on_fail": False, "ipopt": quiet}
    if iterations is None:
        options["iteration_callback"] = Rule(n, at)
    else:
        quiet["max_iter"] = iterations
    cs.nlpsol("s", "ipopt", {"x": x, "f": f(x)}, derivatives | options)(x0=kept.x)
    return kept


class Callback(cs.Callback):  # type: ignore[misc]
    """A function of x in Python, its numbers handed over by memory."""

    def __init__(
        self, name: str, n: int, shape: tuple[int, int], compute: Callable[[Array], float | Array]
    ) -> None:
        super().__init__()
        self._n, self._shape, self._compute = n, shape, compute
        self.construct(name, {})

    def get_n_in(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(self._n, 1)

    def get_sparsity_out(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(*self._shape)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        x = np.array(np.frombuffer(arguments[0]))
        np.frombuffer(results[0])[:] = np.ravel(self._compute(x))
        return 0


class Rule(cs.Callback):  # type: ignore[misc]
    """Stops IPOPT where the gradient, in units of the residual, is as small as ours has to be."""

    def __init__(self, n: int, at: Callable[[Array], wb.Linearization]) -> None:
        super().__init__()
        self._sizes, self._at = {"x": n, "lam_x": n, "f": 1}, at
        self.construct("rule", {})

    def get_n_in(self) -> int:
        return int(cs.nlpsol_n_out())

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(self._sizes.get(cs.nlpsol_out(i), 0), 1)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        here = self._at(np.array(np.frombuffer(arguments[0])))
        pull = np.abs(here.gradient / here.column_norms).max()
        enough = IPOPT.gradient_tolerance * np.sqrt(2 * here.cost)
        np.frombuffer(results[0])[:] = float(pull <= enough)
        return 0


BY_HAND: dict[str, dict[str, Callable[[Case, int], ByHand]]] = {
    "NLopt's L-BFGS": {HAND: by_nlopt},
    "IPOPT": {HAND: by_ipopt, DECIDING: lambda case, _: by_ipopt(case, None)},
}


def _solved(case: Case, solver: wb.solvers.Solver) -> wb.Solution:
    solution = wb.solve(case.problem, case.body.start() | {"observed": case.observed}, solver)
    if not solution.converged:
        raise Disagreement(f"{solution.solver} did not converge: {solution.message}")
    return solution


def _same(name: str, by_hand: ByHand, ours: wb.Solution) -> None:
    """Raises Disagreement if they end apart, or with another number of evaluations."""
    apart = by_hand.cost / ours.cost - 1
    if not abs(apart) <= SAME:
        raise Disagreement(f"{name} ends with a cost {apart:.1e} higher")
    made = ours.evaluations
    counts = made.gradient or max(made.residual, made.jacobian - 1)  # NLopt's or IPOPT's trials
    if abs(by_hand.evaluations - counts) > SLACK:
        raise Disagreement(f"{name} makes {by_hand.evaluations} evaluations, ours {counts}")


def _steps(name: str, solution: wb.Solution) -> int:
    """Evaluations for NLopt, iterations for IPOPT."""
    return len(solution.trace) - 1 if name == "IPOPT" else solution.evaluations.gradient


def _ours(solver: wb.solvers.Solver, seen: list[Case], _: object) -> None:
    for case in seen:
        _solved(case, solver)


def _by_hand(fit: Callable[[Case, int], ByHand], each: list[tuple[Case, int]], _: object) -> None:
    for case, limit in each:
        fit(case, limit)
