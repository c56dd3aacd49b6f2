"""What is to be run: every experiment, from every start, by every solver, within one budget."""

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.experiments import SUITES, Experiment, find
from workbench.experiments.experiment import converted, parameters, run_file
from workbench.experiments.running import catalogue_name
from workbench.identity import code_version, digest, file_digest, identity, is_own_code
from workbench.solvers import SOLVERS, Solver

Experiments = str | Experiment | Iterable[str | Experiment]
Solvers = str | Solver | Iterable[str | Solver] | Mapping[str, Solver]
NUMBERING = ("start", "seed")  # arguments that number starts or data, the first that there is


@dataclass(frozen=True)
class Budget:
    """Limits of one run. `applied_to` gives them to a solver; the metered problem enforces them.

    `gradient_tolerance` is far below what the judgement asks for, so that nobody's stopping rule
    decides; whether a point is stationary is judged at `stationary` (both are values of
    `Problem.optimality`). Raises BadArgument for a limit that is not above zero.

    Attributes:
        max_evaluations: evaluations of residual, gradient, Jacobian and Hessian together.
        max_seconds: the time of a run.
        gradient_tolerance: the tolerance that is given to solvers.
        stationary: the largest `Problem.optimality` of a stationary point.
        grace: seconds after `max_seconds` until the process is killed; at least three Jacobians.
        build_seconds: the time for building a problem, which is not counted as the run's.
        judge_seconds: the time for analysing all ends of one problem.
    """

    max_evaluations: int = 5_000
    max_seconds: float = 60.0
    gradient_tolerance: float = 1e-12
    stationary: float = 1e-6
    grace: float = 2.0
    build_seconds: float = 300.0
    judge_seconds: float = 900.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise BadArgument(f"{field.name} of a budget must be above 0, not {value!r}")

    def applied_to(self, solver: Solver, repetition: int = 0) -> Solver:
        """The solver with these limits, as far as it has options of the workbench's names for them.

        If it has a seed, this is the number of the repetition.
        """
        all_limits = {
            "max_evaluations": self.max_evaluations,
            "max_iterations": self.max_evaluations,  # a step takes an evaluation at least
            "max_seconds": self.max_seconds,
            "gradient_tolerance": self.gradient_tolerance,
            "seed": repetition,
        }
        options: Any = solver
        known = {f.name for f in fields(options) if f.init} if is_dataclass(options) else set()
        limits = {name: limit for name, limit in all_limits.items() if name in known}
        return replace(options, **limits) if limits else solver


@dataclass(frozen=True)
class NamedSolver:
    """A solver and its name; it is defined in the file `source`, under the name `called`."""

    name: str
    solver: Solver
    source: str = ""
    called: str = ""

    @property
    def is_own_code(self) -> bool:
        """Whether it is one of the catalogue, or one of those with other options."""
        return not self.source and is_own_code(type(self.solver).__module__)

    def identity(self) -> Any:
        """All that its results depend on."""
        return {"solver": identity(self.solver), "file": file_digest(self.source)}

    def sent(self) -> Callable[[], Solver]:
        """The solver as it is sent to another process, where a call opens it.

        It goes by its file and name, or pickled; raises BadArgument if it cannot be pickled.
        """
        if self.source:
            return partial(_solver_of_file, self.source, self.called)
        return partial(pickle.loads, _pickled(self.solver, f"solver {self.name}"))


@dataclass(frozen=True)
class Instance:
    """An experiment with all its arguments: one problem and one start, the same for all solvers."""

    problem: str  # the name of the problem on the page
    experiment: Experiment  # the experiment with its arguments
    argument: str  # the argument that numbers the repetitions; empty if none does
    number: int  # the value of that argument; 0 without one
    repetition: int  # which repetition it is: 0, 1,

    @property
    def name(self) -> str:
        """`nist-misra1a, start 2`."""
        return f"{self.problem}, {self.argument} {self.number}" if self.argument else self.problem

    def identity(self) -> Any:
        """Everything that the instance depends on."""
        e = self.experiment
        return [e.name, identity(e.build), identity(e.arguments), file_digest(e.source)]

    def sent(self) -> Callable[[], Experiment]:
        """The experiment as it is sent to another process, by its file if it has one, or pickled.

        Raises BadArgument if it cannot be sent.
        """
        e = self.experiment
        if e.source.endswith(".py"):
            return partial(find, e.source, dict(e.arguments))
        return partial(pickle.loads, _pickled(e, f"experiment {e.name}"))


def _pickled(thing: Any, what: str) -> bytes:
    """Also of functions of a notebook."""
    try:
        return bytes(cloudpickle.dumps(thing))
    except Exception as error:
        raise BadArgument(
            f"{what} cannot go to another process ({error}); let it hold plain values, and build "
            "symbols and problems inside of a function"
        ) from error


@dataclass(frozen=True)
class Design:
    """What a comparison carries out: every solver solves every instance, within one budget."""

    instances: tuple[Instance, ...]  # the instances
    named_solvers: tuple[NamedSolver, ...]  # the solvers
    budget: Budget  # the limits of each run
    seeds: int  # how many starts each problem has

    def key(self, kind: str, *parts: Any) -> str:
        """The key of a stored result; it changes with everything that the result depends on."""
        return f"{kind}-{digest([kind, code_version(), identity(self.budget), *parts])}"

    def run_key(self, instance: Instance, named: NamedSolver) -> str:
        """The key under which the result of one run is stored."""
        return self.key("run", instance.identity(), named.identity(), instance.repetition)


def design(experiments: Experiments, solvers: Solvers, seeds: int, budget: Budget) -> Design:
    """The design of a comparison. Raises UnknownName, BadFile or BadArgument."""
    chosen_solvers = named_solvers(solvers)
    if seeds < 1:
        raise BadArgument(f"seeds is how many starts there are, 1 or more; not {seeds}")
    items = [experiments] if isinstance(experiments, (str, Experiment)) else experiments
    members = [
        experiment
        for item in items
        for experiment in ((item,) if isinstance(item, Experiment) else _experiments_of(item))
    ]
    if not members:
        raise BadArgument("no experiment to compare solvers on; give one or more")
    names = [e.name for e in members]
    instances: list[Instance] = []
    for experiment in members:
        label = experiment.name
        if names.count(label) > 1 and experiment.arguments:
            label += " (" + ", ".join(f"{k}={v}" for k, v in experiment.arguments.items()) + ")"
        instances += _repeated(label, experiment, seeds)
    labels = [i.name for i in instances]
    repeated = [label for label in labels if labels.count(label) > 1]
    if repeated:
        raise BadArgument(f"{repeated[0]} is there twice; give each experiment once")
    return Design(tuple(instances), chosen_solvers, budget, seeds)


def chosen(names: Iterable[str], arguments: Mapping[str, Any]) -> tuple[Experiment, ...]:
    """Experiments, problems of suites, whole suites and FILE.py by name, each with those of the
    arguments that it has. Raises UnknownName for a name or an argument that nobody has.
    """
    members, known = [], set[str]()
    for experiment in (e for name in names for e in _experiments_of(name)):
        has = parameters(experiment.build)
        known |= has.keys()
        changed = {
            k: converted(f"{k} of {experiment.name}", has[k].annotation, value)
            for k, value in arguments.items()
            if k in has
        }
        members.append(replace(experiment, arguments={**experiment.arguments, **changed}))
    for name in arguments:
        if name not in known:
            raise UnknownName("argument of any of these experiments", name, known)
    return tuple(members)


def _experiments_of(name: str) -> tuple[Experiment, ...]:
    return SUITES[name] if name in SUITES else (find(name),)


def _repeated(label: str, experiment: Experiment, seeds: int) -> list[Instance]:
    """One for each seed, if one of its arguments numbers them and is not given already."""
    name = numbering(experiment)
    if not name:
        return [Instance(label, experiment, "", 0, 0)]
    default = parameters(experiment.build)[name].default
    first = default if isinstance(default, int) else 0
    each = [
        replace(experiment, arguments={**experiment.arguments, name: first + k})
        for k in range(seeds)
    ]
    return [Instance(label, member, name, first + k, k) for k, member in enumerate(each)]


def numbering(experiment: Experiment) -> str:
    """The argument that numbers an experiment's starts; "" if none does, or it has a value.

    It is a whole number: `start="procrustes"` is another thing.
    """
    for name in NUMBERING:
        parameter = parameters(experiment.build).get(name)
        if parameter is None or name in experiment.arguments:
            continue
        if isinstance(parameter.default, int) or parameter.annotation is int:
            return name
    return ""


def named_solvers(solvers: Solvers) -> tuple[NamedSolver, ...]:
    """From names of SOLVERS, paths of FILE.py, solvers, or solvers by names of one's own.

    A file defines `solver`, or several solvers by whatever names. Raises UnknownName, BadFile
    with the line that is to blame, or BadArgument.
    """
    if isinstance(solvers, Mapping):
        named = [NamedSolver(name, _checked(name, solver)) for name, solver in solvers.items()]
    else:
        single = isinstance(solvers, str) or hasattr(solvers, "solve")
        several: Iterable[Any] = (solvers,) if single else solvers  # type: ignore[assignment]
        named = [entrant for item in several for entrant in _entrants(item)]
    if not named:
        raise BadArgument(f"no solver to compare; there are {', '.join(SOLVERS)}, or a FILE.py")
    names = [entrant.name for entrant in named]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadArgument(
            f"two solvers are called {twice[0]!r}; give them as a dict, by names of your own"
        )
    return tuple(named)


def _entrants(solver: str | Solver) -> tuple[NamedSolver, ...]:
    if not isinstance(solver, str):
        name = catalogue_name(solver) if hasattr(solver, "solve") else None
        return (NamedSolver(name or type(solver).__name__, _checked(repr(solver), solver)),)
    if solver in SOLVERS:
        return (NamedSolver(solver, SOLVERS[solver]),)
    if solver.endswith(".py"):
        return _from_file(Path(solver))
    raise UnknownName("solver", solver, SOLVERS, hint="or give a FILE.py")


def _is_solver(value: Any) -> bool:
    is_value = not isinstance(value, (type, ModuleType))
    return is_value and callable(getattr(value, "solve", None))


def _checked(name: str, thing: Any) -> Solver:
    if not _is_solver(thing):
        raise BadArgument(
            f"{name} is no solver: it needs solve(problem, start, *, callback=None) and must be a "
            "value, not a class"
        )
    solver: Solver = thing
    return solver


def _from_file(path: Path) -> tuple[NamedSolver, ...]:
    module, source = run_file(path, f"one of {', '.join(SOLVERS)}")
    if hasattr(module, "solver"):
        try:
            return (NamedSolver(path.stem, _checked("`solver`", module.solver), source, "solver"),)
        except BadArgument as error:
            raise BadFile(f"{path.name}: {error}") from error
    named = [
        NamedSolver(f"{path.stem}:{name}", value, source, name)
        for name, value in vars(module).items()
        if _is_solver(value) and not name.startswith("_")
    ]
    if not named:
        raise BadFile(
            f"{path.name} defines no solver; it needs `solver = ...`, or several values with "
            "solve(problem, start, *, callback=None)"
        )
    return tuple(named)


def _solver_of_file(source: str, called: str) -> Solver:
    return {entrant.called: entrant.solver for entrant in _from_file(Path(source))}[called]
