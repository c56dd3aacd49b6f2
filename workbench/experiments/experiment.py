"""A named problem: a function that builds its setup, its arguments, and a user's own file."""

import importlib.util
import json
import math
import operator
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin

import numpy as np

from workbench.errors import (
    BadArgument,
    BadFile,
    BadSetup,
    WorkbenchError,
    line_of,
    message_of,
    shown,
)
from workbench.fitting.setup import Setup, names
from workbench.identity import file_digest

IN_CASADI = re.compile(r"^\S*casadi\S*:\d+: (Assertion .* failed:\s*)?")  # where in its source
POINTS_ARE_COLUMNS = (
    "in expressions points are columns, so that the symbol of a block of shape (N, 3) is 3 x N, as "
    "that of joints or vertices is"
)
NO_NUMBERS = {
    "Points": "Points are no numbers: take their .symbol",
    "Block": "a Block is no number: take its .symbol",
}


@contextmanager
def user_errors(
    source: str, what: str = "", arguments: Mapping[str, Any] | None = None
) -> Iterator[None]:
    """Turn exceptions raised in this context into errors that say what the user can correct.

    If `source` is a user's Python file, any exception becomes a BadFile that names the line.
    Otherwise an exception of `what`, which was given the user's `arguments`, becomes a
    BadArgument. A WorkbenchError, and any exception where there are no arguments, is raised as
    it is.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        if source.endswith(".py"):
            line = line_of(error, source)
            place = f"{Path(source).name} line {line}" if line else Path(source).name
            raise BadFile(f"{place}: {_reason(error)}") from error
        if isinstance(error, WorkbenchError) or not arguments:
            raise
        listed = ", ".join(f"{name}={value!r}" for name, value in arguments.items())
        raise BadArgument(f"{what} cannot be built with {listed}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    if isinstance(error, SystemExit):
        return f"it ends the program (sys.exit({error.code})) where it is read; take that out"
    message = error.msg if isinstance(error, SyntaxError) else message_of(error)
    for kind, instead in NO_NUMBERS.items():
        if isinstance(error, TypeError) and f"'{kind}'" in message:
            return f"{message}; {instead}"
    if place := IN_CASADI.match(message):
        message = message[place.end() :]
        about_shapes = "imension" in message or "shape" in message
        return f"{message.rstrip('.')}; {POINTS_ARE_COLUMNS}" if about_shapes else message
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def parameters(build: Callable[..., object]) -> Mapping[str, Parameter]:
    """The parameters of a builder, with annotations as texts if they cannot be evaluated."""
    try:
        return signature(build, eval_str=True).parameters
    except (NameError, SyntaxError, AttributeError):
        return signature(build).parameters


def converted(what: str, annotation: object, value: object) -> Any:
    """A value, or the text that was typed for one, converted to an annotation.

    int, float, bool, str, sequences of str, and unions of these with each other and None are
    converted. For any other annotation a value stays as it is, and a text is read as JSON if it
    is JSON. `what` names the argument in the error. Raises BadArgument.
    """
    union = get_origin(annotation) in (Union, UnionType)
    kinds = [_kind(kind) for kind in (get_args(annotation) if union else (annotation,))]
    for _, convert in kinds:
        try:
            return convert(value)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            continue
    raise BadArgument(
        f"{what} must be {' or '.join(words for words, _ in kinds)}, not {shown(value)}"
    )


def _kind(annotation: object) -> tuple[str, Callable[[Any], Any]]:
    """What an annotation asks for, in words, and the function that makes it or raises."""
    several = get_origin(annotation) in (tuple, list, Sequence, Iterable)
    if several and get_args(annotation)[0] is str:
        return 'a name, or names such as ["a", "b"]', _names
    return _KINDS.get(annotation, ("anything", _anything))


def _whole(value: Any) -> int:
    if isinstance(value, (bool, np.bool_)):
        raise TypeError
    return int(value) if isinstance(value, str) else operator.index(value)


def _real(value: Any) -> float:
    if isinstance(value, (bool, np.bool_)) or not math.isfinite(float(value)):
        raise TypeError
    return float(value)


def _text(value: Any) -> Any:
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError
    return value


def _names(value: Any) -> tuple[str, ...]:
    is_json = isinstance(value, str) and value.startswith("[")
    strings = names(json.loads(value) if is_json else value)
    if not all(isinstance(name, str) for name in strings):
        raise TypeError
    return () if strings == ("",) else strings


def _anything(value: Any) -> Any:
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return value


_KINDS: dict[object, tuple[str, Callable[[Any], Any]]] = {
    int: ("a whole number", _whole),
    float: ("a finite number", _real),
    bool: ("true or false", lambda value: {"true": True, "false": False}[str(value).lower()]),
    str: ("a text", _text),
    NoneType: ("none", lambda value: {"none": None, "null": None}[str(value).lower()]),
}


# What such a file may define, for --help and for the error of one that defines nothing.
REQUIRED_NAMES = (
    "`problem` and `start`, or `setup` (a Setup, or a function that returns one), or `experiment`"
)
OPTIONAL_NAMES = (
    "beside `problem` and `start`, `priors` names the residuals that are not data, `body` is the "
    "body to draw, `compared` names solvers to run as well, `candidates` are residuals by name "
    "that could be measured next, and `gauges` are motions (Gauge) that change no residual"
)


def run_file(path: Path, instead: str) -> tuple[ModuleType, str]:
    """Run a file. Returns its module and its full path; raises BadFile with the line that failed.

    `instead` says what else could have been given, for the error about a missing file.
    """
    if not path.is_file():
        raise BadFile(f"there is no file {path}; give the path of a Python file, or {instead}")
    source = str(path.resolve())
    name = path.stem  # under which dataclasses and pickle find its classes
    if name in sys.modules and getattr(sys.modules[name], "__file__", None) != source:
        name += f"_{file_digest(source)}"  # another module has its name: that of a library, say
    spec = importlib.util.spec_from_file_location(name, source)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    folder = str(path.resolve().parent)  # where its own imports are, as under `python FILE.py`
    if folder not in sys.path:
        sys.path.insert(0, folder)
    with user_errors(source):
        # not by the bytecode that Python keeps: a file changed within a second has the old one
        exec(compile(path.read_bytes(), source, "exec"), vars(module))
    return module, source


@dataclass(frozen=True)
class Experiment:
    """A function that builds a setup, and its arguments.

    A setup holds symbols, which cannot be pickled; an experiment can be, if its function can.

    Attributes:
        name: by which the command line knows it.
        build: the function that returns a Setup.
        summary: one line for lists.
        arguments: those of `build` that differ from its defaults.
        source: the user's file that it is from or about; empty if it comes with the workbench.
    """

    name: str
    build: Callable[..., Setup]
    summary: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    def setup(self) -> Setup:
        """Build the setup.

        Raises BadFile with the line if the user's file is wrong, and BadArgument if an argument
        is.
        """
        with user_errors(self.source, self.name, self.arguments):
            setup = self.build(**self.arguments)
            if not isinstance(setup, Setup):
                raise BadSetup(
                    f"the function that builds it must return a Setup, not {setup!r:.80}"
                )
            return setup
