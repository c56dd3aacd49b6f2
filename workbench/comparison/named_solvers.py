"""The solvers that take part, by the names that they go by."""

import pickle
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from workbench.comparison.identity import file_digest, identity, of_the_house
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.experiments.own_file import run_file
from workbench.experiments.running import catalogue_name
from workbench.solvers import SOLVERS, Solver

Given = str | Solver | Iterable[str | Solver] | Mapping[str, Solver]


@dataclass(frozen=True)
class NamedSolver:
    """A solver and its name; it is defined in the file `source`, under the name `called`."""

    name: str
    solver: Solver
    source: str = ""
    called: str = ""

    @property
    def of_the_house(self) -> bool:
        """Whether it is one of the catalogue, or one of those with other options."""
        return not self.source and of_the_house(type(self.solver).__module__)

    def identity(self) -> Any:
        """All that its results depend on."""
        return {"solver": identity(self.solver), "file": file_digest(self.source)}

    def sent(self) -> "SentSolver":
        """What is sent to another process: its file and name, or the pickled solver.

        Raises BadArgument if it cannot be pickled.
        """
        if self.source:
            return SentSolver(self.name, self.source, self.called)
        return SentSolver(self.name, blob=pickled(self.solver, f"solver {self.name}"))


@dataclass(frozen=True)
class SentSolver:
    """A solver in the form in which it is sent to another process: its file, or its pickle.

    Attributes:
        name: its name in the comparison.
        source: the file that defines it; empty if it is pickled.
        called: its name in that file.
        blob: the pickled solver; empty if there is a file.
    """

    name: str
    source: str = ""
    called: str = ""
    blob: bytes = b""

    def opened(self) -> Solver:
        """The solver, made again in the process that received it."""
        if not self.source:
            solver: Solver = pickle.loads(self.blob)
            return solver
        found = {e.called: e.solver for e in _from_file(Path(self.source))}
        return found[self.called]


def pickled(thing: Any, what: str) -> bytes:
    """Also of functions of a notebook. Raises BadArgument."""
    try:
        return bytes(cloudpickle.dumps(thing))
    except Exception as error:
        raise BadArgument(
            f"{what} cannot go to another process ({error}); let it hold plain values, and build "
            "symbols and problems inside of a function"
        ) from error


def named_solvers(given: Given) -> tuple[NamedSolver, ...]:
    """From names of SOLVERS, paths of FILE.py, solvers, or solvers by names of one's own.

    A file defines `solver`, or several solvers by whatever names. Raises UnknownName, BadFile
    with the line that is to blame, or BadArgument.
    """
    if isinstance(given, Mapping):
        found = [NamedSolver(name, _solver(name, solver)) for name, solver in given.items()]
    else:
        single = isinstance(given, str) or hasattr(given, "solve")
        several: Iterable[Any] = (given,) if single else given  # type: ignore[assignment]
        found = [named for one in several for named in _entrants(one)]
    if not found:
        raise BadArgument(f"no solver to compare; there are {', '.join(SOLVERS)}, or a FILE.py")
    names = [named.name for named in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadArgument(
            f"two solvers are called {twice[0]!r}; give them as a dict, by names of your own"
        )
    return tuple(found)


def _entrants(one: str | Solver) -> tuple[NamedSolver, ...]:
    if not isinstance(one, str):
        known = catalogue_name(one) if hasattr(one, "solve") else None
        return (NamedSolver(known or type(one).__name__, _solver(repr(one), one)),)
    if one in SOLVERS:
        return (NamedSolver(one, SOLVERS[one]),)
    if one.endswith(".py"):
        return _from_file(Path(one))
    raise UnknownName("solver", one, SOLVERS, hint="or give a FILE.py")


def _solver(name: str, thing: Any) -> Solver:
    if isinstance(thing, type) or not callable(getattr(thing, "solve", None)):
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
            return (NamedSolver(path.stem, _solver("`solver`", module.solver), source, "solver"),)
        except BadArgument as error:
            raise BadFile(f"{path.name}: {error}") from error
    found = [
        NamedSolver(f"{path.stem}:{name}", value, source, name)
        for name, value in vars(module).items()
        if _is_a_solver(value) and not name.startswith("_")
    ]
    if not found:
        raise BadFile(
            f"{path.name} defines no solver; it needs `solver = ...`, or several values with "
            "solve(problem, start, *, callback=None)"
        )
    return tuple(found)


def _is_a_solver(value: Any) -> bool:
    if isinstance(value, (type, ModuleType)):
        return False
    return callable(getattr(value, "solve", None))
