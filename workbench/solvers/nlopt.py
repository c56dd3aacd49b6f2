"""The algorithms of NLopt; a run counts, keeps the best point and judges it."""

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from math import isfinite, sqrt

import nlopt
import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.errors import check_known
from workbench.problem import Linearization, Problem
from workbench.problem.constraints import ConstraintSet
from workbench.problem.optimality import all_finite
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.judgement import GAIN_BY_VIOLATION
from workbench.solvers.limits import Limits, Stop
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status

STATUS_OF_RESULT = {  # for the result codes that end a run by themselves
    nlopt.FAILURE: (Status.STALLED, "it gave up; try another algorithm"),
    nlopt.INVALID_ARGS: (Status.STALLED, "it does not take this problem; try another algorithm"),
    nlopt.OUT_OF_MEMORY: (Status.STALLED, "out of memory; try an algorithm without a full matrix"),
    nlopt.ROUNDOFF_LIMITED: (
        Status.STALLED,
        "rounding errors kept it from going on; diagnose the problem",
    ),
    nlopt.MAXEVAL_REACHED: (Status.MAX_EVALUATIONS, Status.MAX_EVALUATIONS.value),
    nlopt.MAXTIME_REACHED: (Status.MAX_SECONDS, Status.MAX_SECONDS.value),
}
GAVE_UP = (nlopt.SUCCESS, nlopt.FTOL_REACHED, nlopt.XTOL_REACHED)  # nothing more to be gained

SMALLEST_STEP = 1e-14  # of a trust region: COBYLA halves one for ever, asking for nothing
NOT_A_POINT = (
    "the algorithm broke down, for it asks for the cost at a point that is not a number; the best "
    "point before that was kept; try another algorithm"
)
NEARLY_STATIONARY = 3.0  # times the tolerance: an estimate below is worth a Jacobian

_DIRECT, _DIRECT_L = "Jones, Perttunen and Stuckman 1993", "Gablonsky and Kelley 2001"
_STOGO, _TNEWTON = "Madsen and Zertchaninov 1998", "Dembo and Steihaug 1982; Luksan"
_LOCAL = "its local searches are made by the algorithm of the option `local`"
_TWO = "two unknowns at least"
_BOTH, _RANDOM = ("equations", "inequalities"), ("stochastic",)
_TABLE: Mapping[str, tuple[str, str, tuple[str, ...]]] = {  # the source, a note, other abilities
    "LD_LBFGS": ("Nocedal 1980; Luksan", "", ()),
    "LD_VAR1": ("Vlcek and Luksan 2006", "rank 1", ()),
    "LD_VAR2": ("Vlcek and Luksan 2006", "rank 2", ()),
    "LD_TNEWTON": (_TNEWTON, "", ()),
    "LD_TNEWTON_RESTART": (_TNEWTON, "", ()),
    "LD_TNEWTON_PRECOND": (_TNEWTON, "", ()),
    "LD_TNEWTON_PRECOND_RESTART": (_TNEWTON, "", ()),
    "LD_SLSQP": ("Kraft 1994", "O(n^3) per iteration, which no limit of time interrupts", _BOTH),
    "LD_MMA": ("Svanberg 2002", "", ("inequalities",)),
    "LD_CCSAQ": ("Svanberg 2002", "", ("inequalities",)),
    "LN_BOBYQA": ("Powell 2009", "to about 30 unknowns", ()),
    "LN_NEWUOA": ("Powell 2004", _TWO, ()),
    "LN_NEWUOA_BOUND": ("Powell 2004", _TWO, ()),
    "LN_COBYLA": (
        "Powell 1994",
        "NaN would make it run for ever; it is never shown one",
        _BOTH,
    ),
    "LN_PRAXIS": ("Brent 1972", "", _RANDOM),
    "LN_NELDERMEAD": ("Nelder and Mead 1965", "", ()),
    "LN_SBPLX": ("Rowan 1990", "", ()),
    "G_MLSL": ("Rinnooy Kan and Timmer 1987", _LOCAL, _RANDOM),
    "G_MLSL_LDS": ("Rinnooy Kan and Timmer 1987; Kucherenko and Sytsko 2005", _LOCAL, ()),
    "GD_STOGO": (_STOGO, "", ()),
    "GD_STOGO_RAND": (_STOGO, "", _RANDOM),
    "GN_DIRECT": (_DIRECT, "", ()),
    "GN_DIRECT_NOSCAL": (_DIRECT, "", ()),
    "GN_DIRECT_L": (_DIRECT_L, "", ()),
    "GN_DIRECT_L_NOSCAL": (_DIRECT_L, "", ()),
    "GN_DIRECT_L_RAND": (_DIRECT_L, "", _RANDOM),
    "GN_DIRECT_L_RAND_NOSCAL": (_DIRECT_L, "", _RANDOM),
    "GN_ORIG_DIRECT": (_DIRECT, "", ()),
    "GN_ORIG_DIRECT_L": (_DIRECT_L, "", ()),
    "GN_CRS2_LM": ("Kaelo and Ali 2006", "", _RANDOM),
    "GN_ISRES": ("Runarsson and Yao 2005", "", (*_BOTH, *_RANDOM)),
    "GN_ESCH": ("da Silva Santos 2010", "", _RANDOM),
    "GN_AGS": ("Sergeyev and Markin 1995", "to about 10 unknowns", ()),
}


def _abilities(name: str, source: str, note: str, others: tuple[str, ...]) -> Abilities:
    """The abilities of an algorithm: its name says whether it is global and takes gradients."""
    is_global, derivative = name.startswith("G"), Derivative.GRADIENT
    if name.startswith(("LN", "GN")):
        derivative = Derivative.COST
    bounds = Boxes.REFUSED if name == "LN_NEWUOA" else Boxes.TAKEN
    return Abilities(
        derivative,
        Boxes.NEEDED if is_global else bounds,
        equations="equations" in others,
        inequalities="inequalities" in others,
        is_global=is_global,
        stochastic="stochastic" in others,
        source=source,
        note=note,
    )


# What each algorithm of NLopt 2.10 needs and supports, by its manual or by measurement. A global
# one searches the box between the bounds until its evaluations are used up. LD_LBFGS_NOCEDAL is
# left out, because it is a name without an implementation.
ALGORITHMS: Mapping[str, Abilities] = {name: _abilities(name, *row) for name, row in _TABLE.items()}


@dataclass(frozen=True)
class Nlopt(Limits):
    """An algorithm of NLopt (Johnson, The NLopt nonlinear-optimization package).

    NLopt sees the unknowns y_i = |J_i| x_i, with the Jacobian at the start: quasi-Newton methods
    begin with the identity as their Hessian, and after this scaling its diagonal is right. Raises
    UnknownName for an algorithm that is not in `ALGORITHMS`, which names the source of each.

    Attributes:
        algorithm: NLopt's name of the algorithm, such as `LD_LBFGS`.
        local: the algorithm of the descents of MLSL; others do not read it.
        seed: of the stochastic algorithms.
        cost_tolerance: the relative decrease of the cost in one step below which NLopt gives up. A
            larger one ends earlier; whether the point has converged is judged by
            `gradient_tolerance` all the same.
    """

    algorithm: str = "LD_LBFGS"
    local: str = "LD_LBFGS"
    seed: int = 0
    cost_tolerance: float = 1e-16  # less than a single bit; at 1e-15 BOBYQA stops short
    _: KW_ONLY
    max_iterations: int = 100_000
    max_evaluations: int = 20_000

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in (self.algorithm, self.local):
            check_known("NLopt algorithm here", name, ALGORITHMS)

    @property
    def abilities(self) -> Abilities:
        """The entry of `ALGORITHMS`."""
        return ALGORITHMS[self.algorithm]

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`.

        Raises NotSupported for bounds or constraints that the algorithm does not take, and for
        missing bounds that it needs.
        """
        name = f"nlopt {self.algorithm}"
        with Run(name, self, problem, start, callback) as run:
            x0, here = run.x, run.begin()
            scale = np.where(here.column_norms > 0, here.column_norms, 1.0)
            optimizer = self._optimizer(self.algorithm, x0.size)
            objective = NloptObjective(run, here, scale, optimizer, self.abilities)
            optimizer.set_min_objective(objective.cost)
            optimizer.set_lower_bounds(problem.lower * scale)
            optimizer.set_upper_bounds(problem.upper * scale)
            if problem.stacked_constraints is not None:
                objective.constrain(problem.stacked_constraints)
            if self.algorithm.startswith("G_MLSL"):
                optimizer.set_local_optimizer(self._optimizer(self.local, x0.size))
            if self.algorithm.startswith("LN_"):
                first = np.minimum(0.1, (problem.upper - problem.lower) / 4) * scale
                optimizer.set_initial_step(np.maximum(first, np.finfo(float).tiny))
                optimizer.set_xtol_rel(SMALLEST_STEP)
            nlopt.srand(self.seed)
            try:
                self._optimize(run, optimizer, x0, scale)
            except (SystemError, ValueError, RuntimeError, MemoryError) as error:
                # an interrupt while NLopt was at its own work, or what it says of its arguments
                if objective.error is None and isinstance(error, SystemError):
                    raise error.__cause__ or error from None
                objective.error = objective.error or Stop(
                    Status.STALLED, f"nlopt {self.algorithm} refused: {error or type(error)}"
                )
            if objective.error is not None:
                raise objective.error
            run.check()  # some leave at a limit without saying so
            code = optimizer.last_optimize_result()
            status, advice = STATUS_OF_RESULT.get(code, (Status.STALLED, Status.STALLED.value))
            message = f"{advice} (nlopt: result {code})"
            if status is Status.STALLED:
                run.stall(message)
            raise Stop(status, message)
        return run.solution()

    def _optimize(self, run: Run, optimizer: nlopt.opt, x0: Array, scale: Array) -> None:
        """Run the optimizer; a local one that uses gradients again, as long as the cost falls.

        MMA and CCSA end as soon as one step happens to gain nothing, even far from a minimum.
        """
        problem, x, cost = run.problem, x0, run.best.cost
        descends = self.abilities.derivative is Derivative.GRADIENT and not self.abilities.is_global
        while True:
            y = np.clip(x * scale, problem.lower * scale, problem.upper * scale)
            _optimize_quietly(optimizer, y)
            gave_up = optimizer.last_optimize_result() in GAVE_UP
            if not (descends and gave_up and run.best.violation <= 1 and run.best.cost < cost):
                return
            noise = run.rounding_noise.of_cost(run.best.x, run.linearize(run.best.x))
            if run.best.cost >= cost - noise:
                return
            x, cost = run.best.x, run.best.cost

    def _optimizer(self, algorithm: str, n: int) -> nlopt.opt:
        optimizer = nlopt.opt(getattr(nlopt, algorithm), n)
        if hasattr(optimizer, "set_exceptions_enabled"):  # from NLopt 2.10 on; Pyodide has 2.9.1
            optimizer.set_exceptions_enabled(False)
        optimizer.set_ftol_rel(self.cost_tolerance)
        optimizer.set_maxeval(self.max_evaluations + 1)
        optimizer.set_maxtime(max(self.max_seconds, 1e-3))
        return optimizer


def _optimize_quietly(optimizer: nlopt.opt, y: Array) -> None:
    """Optimize from y (n,). What NLopt before 2.10 raises is what its last result says too."""
    try:
        optimizer.optimize(y)
    except (nlopt.ForcedStop, nlopt.RoundoffLimited, nlopt.exception):
        if optimizer.last_optimize_result() > 0:
            raise


class NloptObjective:
    """The cost and the constraints in NLopt's variables y = scale x.

    An exception stops NLopt and is kept as `error`. Where the residual is not finite, NLopt gets
    the values of a cone that rises from the last good point, because with a NaN COBYLA never
    returns and the other algorithms do not get far.
    """

    def __init__(
        self,
        run: Run,
        here: Linearization,
        scale: Array,
        optimizer: nlopt.opt,
        abilities: Abilities,
    ) -> None:
        self.run, self.scale, self.optimizer = run, scale, optimizer
        self.error: BaseException | None = None
        self._descends = abilities.derivative is Derivative.GRADIENT and not abilities.is_global
        self._lowest = run.best.cost
        self._bounded = run.problem.bounded
        self._last = run.x * scale, run.best.cost  # the last good point
        self._worst = run.best.cost
        self._norms = np.where(scale > 0, scale, np.inf)

    def cost(self, y: Array, gradient: Array) -> float:
        """The cost at y, its gradient written into `gradient`, if that has a length."""
        if self.error is None:
            try:
                return self._evaluate(y, gradient)
            except BaseException as error:
                self._give_up(error)
        gradient[:] = 0.0
        return float(self._last[1])

    def constrain(self, constraints: ConstraintSet) -> None:
        """Give the constraints to NLopt in its form: h(x) = 0 and g(x) <= 0."""
        equal = constraints.equal
        above, below = np.isfinite(constraints.upper), np.isfinite(constraints.lower)
        if equal.any():
            function = self._function_of(constraints, equal, 1.0, constraints.lower)
            self.optimizer.add_equality_mconstraint(function, constraints.tolerance[equal])
        for rows, sign, limit in (
            (above & ~equal, 1.0, constraints.upper),
            (below & ~equal, -1.0, constraints.lower),
        ):
            if rows.any():
                function = self._function_of(constraints, rows, sign, limit)
                self.optimizer.add_inequality_mconstraint(function, constraints.tolerance[rows])

    def _function_of(
        self, constraints: ConstraintSet, rows: Mask, sign: float, limit: Array
    ) -> Callable[[Array, Array, Array], None]:
        """A function of NLopt's form for sign (c - limit) of some `rows` (k,)."""

        def evaluate(result: Array, y: Array, gradient: Array) -> None:
            result[:] = 0.0
            if gradient.size:
                gradient[:] = 0.0
            if self.error is not None:
                return
            try:
                run, x = self.run, self._x(y)
                if gradient.size:
                    here = run.evaluate("constraint", lambda: constraints.linearize(x, run.fixed))
                    values = here.values
                    J = sign * here.rows(rows) / self.scale
                    gradient[:] = np.where(np.isfinite(J), J, 0.0)
                else:
                    values = run.constraints(x)
                excess = sign * (values - limit)[rows]
                result[:] = np.where(np.isfinite(excess), excess, 1e10)
            except BaseException as error:
                self._give_up(error)

        return evaluate

    def _give_up(self, error: BaseException) -> None:
        self.error = error
        self.optimizer.force_stop()

    def _x(self, y: Array) -> Array:
        x, problem = y / self.scale, self.run.problem
        if not self._bounded:
            return x
        return np.clip(x, problem.lower, problem.upper)  # which rounding may have left

    def _evaluate(self, y: Array, gradient: Array) -> float:
        run, x = self.run, self._x(y)
        if not all_finite(y):
            run.stall(NOT_A_POINT)
        if gradient.size:
            cost, g = run.cost_and_gradient(x)
            if isfinite(cost):
                gradient[:] = g / self.scale
        else:
            cost, g = run.cost(x), np.zeros(0)
        if not isfinite(cost):
            return self._cone(y, gradient)
        self._last, self._worst = (y.copy(), cost), max(self._worst, cost)
        if self._is_worth_recording(cost):
            self._lowest = cost
            run.record(x, cost, self._linearization(x, g))
        return cost

    def _is_worth_recording(self, cost: float) -> bool:
        """Whether the cost is the lowest, or may be that of a more stationary feasible point."""
        best = self.run.best
        if self.run.problem.stacked_constraints is None:
            return cost < self._lowest
        hardly_higher = cost <= (1 + GAIN_BY_VIOLATION) * best.cost
        return best.cost == cost or (best.violation <= 1 and hardly_higher)

    def _cone(self, y: Array, gradient: Array) -> float:
        """A cost higher than all before, whose gradient leads back to the last good point."""
        good, cost = self._last
        away, high = y - good, 10 * abs(self._worst) + 1
        distance = float(np.linalg.norm(away))
        if gradient.size:
            gradient[:] = (high - cost) * away / distance**2 if distance > 0 else 0.0
        return float(high)

    def _linearization(self, x: Array, g: Array) -> Linearization | None:
        """The linearization at x (n,) if the point may be nearly stationary, else None."""
        run, problem = self.run, self.run.problem
        if not (self._descends and g.size):
            return None
        if problem.stacked_constraints is None and self._is_steep(x, g):
            return None
        here = run.linearize(x)
        self._norms = np.where(here.column_norms > 0, here.column_norms, np.inf)
        return here

    def _is_steep(self, x: Array, g: Array) -> bool:
        """Whether the gradient g (n,) at x (n,) is clearly too long for a stationary point."""
        run, problem = self.run, self.run.problem
        descent = -g / self._norms
        if self._bounded:
            low, high = (problem.lower - x) * self._norms, (problem.upper - x) * self._norms
            descent = np.clip(descent, low, high)
        steep = NEARLY_STATIONARY * run.limits.gradient_tolerance * sqrt(2 * run.best.cost)
        return bool((np.abs(descent) > steep).any())
