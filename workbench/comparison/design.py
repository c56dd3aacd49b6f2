"""What is to be run: every experiment, from every start, by every solver."""

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from inspect import Parameter
from typing import Any

from workbench.comparison.budget import Budget
from workbench.comparison.identity import code_version, digest, file_digest, identity
from workbench.comparison.named_solvers import NamedSolver, pickled
from workbench.errors import BadArgument, UnknownName
from workbench.experiments import SUITES, Experiment, find
from workbench.experiments.arguments import converted, parameters

Opening = Callable[[], Experiment]  # gives an experiment in the process that received it
NUMBERING = ("start", "seed")  # arguments that number starts or data, the first that there is


@dataclass(frozen=True)
class Instance:
    """An experiment with all its arguments: one problem and one start, the same for all solvers.

    Attributes:
        problem: the name of the problem on the page.
        experiment: the experiment with its arguments.
        argument: the argument that numbers the repetitions; empty if none does.
        number: the value of that argument; 0 without one.
        repetition: which repetition it is: 0, 1, ...
    """

    problem: str
    experiment: Experiment
    argument: str
    number: int
    repetition: int

    @property
    def name(self) -> str:
        """`nist-misra1a, start 2`."""
        return f"{self.problem}, {self.argument} {self.number}" if self.argument else self.problem

    def identity(self) -> Any:
        """Everything that the instance depends on."""
        e = self.experiment
        return [e.name, identity(e.build), identity(e.arguments), file_digest(e.source)]

    def sent(self) -> Opening:
        """The experiment as it is sent to another process: by its file if it has one, or pickled.

        Raises BadArgument if it cannot be sent.
        """
        e = self.experiment
        if e.source.endswith(".py"):
            return partial(find, e.source, dict(e.arguments))
        return partial(pickle.loads, pickled(e, f"experiment {e.name}"))


@dataclass(frozen=True)
class Design:
    """What a comparison carries out: every solver solves every instance, within one budget.

    Attributes:
        instances: the instances.
        named_solvers: the solvers.
        budget: the limits of each run.
        seeds: how many starts each problem has.
    """

    instances: tuple[Instance, ...]
    named_solvers: tuple[NamedSolver, ...]
    budget: Budget
    seeds: int

    def key(self, kind: str, *parts: Any) -> str:
        """The key of a stored result; it changes with everything that the result depends on."""
        return f"{kind}-{digest([kind, code_version(), identity(self.budget), *parts])}"

    def run_key(self, instance: Instance, named: NamedSolver) -> str:
        """The key under which the result of one run is stored."""
        return self.key("run", instance.identity(), named.identity(), instance.repetition)


Experiments = str | Experiment | Iterable[str | Experiment]


def chosen(names: Iterable[str], arguments: Mapping[str, Any]) -> tuple[Experiment, ...]:
    """Experiments, problems of suites, whole suites and FILE.py by name, each with those of the
    arguments that it has. Raises UnknownName for a name or an argument that nobody has.
    """
    found = []
    left = dict(arguments)
    for name in names:
        for experiment in _named(name):
            has = parameters(experiment.build)
            own = {k: v for k, v in arguments.items() if k in has}
            left = {k: v for k, v in left.items() if k not in has}
            if own:
                changed = {
                    k: converted(f"{k} of {experiment.name}", has[k].annotation, v)
                    for k, v in own.items()
                }
                experiment = replace(experiment, arguments={**experiment.arguments, **changed})
            found.append(experiment)
    for name in left:
        known = {k for e in found for k in parameters(e.build)}
        raise UnknownName("argument of any of these experiments", name, known)
    return tuple(found)


def _named(name: str) -> tuple[Experiment, ...]:
    return SUITES[name] if name in SUITES else (find(name),)


def design(
    experiments: Experiments, named_solvers: tuple[NamedSolver, ...], seeds: int, budget: Budget
) -> Design:
    """The design of a comparison. Raises UnknownName, BadFile or BadArgument."""
    if seeds < 1:
        raise BadArgument(f"seeds is how many starts there are, 1 or more; not {seeds}")
    single = isinstance(experiments, (str, Experiment))
    several: Any = (experiments,) if single else experiments
    found = [
        experiment
        for one in several
        for experiment in ((one,) if isinstance(one, Experiment) else _named(one))
    ]
    if not found:
        raise BadArgument("no experiment to compare solvers on; give one or more")
    names = [e.name for e in found]
    instances: list[Instance] = []
    for experiment in found:
        label = experiment.name
        if names.count(label) > 1 and experiment.arguments:
            label += " (" + ", ".join(f"{k}={v}" for k, v in experiment.arguments.items()) + ")"
        instances += _repeated(label, experiment, seeds)
    labels = [i.name for i in instances]
    twice = [label for label in labels if labels.count(label) > 1]
    if twice:
        raise BadArgument(f"{twice[0]} is there twice; give each experiment once")
    return Design(tuple(instances), named_solvers, budget, seeds)


def _repeated(label: str, experiment: Experiment, seeds: int) -> list[Instance]:
    """One for each seed, if one of its arguments numbers them and is not given already."""
    name = numbering(experiment)
    if not name:
        return [Instance(label, experiment, "", 0, 0)]
    default = parameters(experiment.build)[name].default
    first = default if isinstance(default, int) else 0
    return [
        Instance(
            label,
            replace(experiment, arguments={**experiment.arguments, name: first + k}),
            name,
            first + k,
            k,
        )
        for k in range(seeds)
    ]


def numbering(experiment: Experiment) -> str:
    """The argument that numbers an experiment's starts; "" if none does, or it is given already."""
    known = parameters(experiment.build)
    free = (n for n in NUMBERING if n in known and n not in experiment.arguments)
    return next((name for name in free if _counts(known[name])), "")


def _counts(parameter: Parameter) -> bool:
    """Whether an argument is a whole number: `start="procrustes"` is another thing."""
    return isinstance(parameter.default, int) or parameter.annotation is int
