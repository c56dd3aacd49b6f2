"""Arguments of an experiment, from Python or typed, converted to the types its builder names."""

import json
import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import Parameter, signature
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

import numpy as np

from workbench.errors import BadArgument, shown
from workbench.fitting.setup import names


def parameters(build: Callable[..., object]) -> Mapping[str, Parameter]:
    """The parameters of a builder, with annotations as texts if they cannot be evaluated."""
    try:
        return signature(build, eval_str=True).parameters
    except (NameError, SyntaxError, AttributeError):
        return signature(build).parameters


def converted(what: str, annotation: object, given: object) -> Any:
    """A value, or the text that was typed for one, converted to an annotation.

    int, float, bool, str, sequences of str, and unions of these with each other and None are
    converted. For any other annotation a value stays as it is, and a text is read as JSON if it
    is JSON. `what` names the argument in the error. Raises BadArgument.
    """
    union = get_origin(annotation) in (Union, UnionType)
    kinds = [_kind(one) for one in (get_args(annotation) if union else (annotation,))]
    for _, convert in kinds:
        try:
            return convert(given)
        except (ValueError, TypeError, OverflowError, RecursionError):
            continue
    raise BadArgument(
        f"{what} must be {' or '.join(wanted for wanted, _ in kinds)}, not {shown(given)}"
    )


def _kind(annotation: object) -> tuple[str, Callable[[Any], Any]]:
    several = get_origin(annotation) in (tuple, list, Sequence, Iterable)
    if several and get_args(annotation)[0] is str:
        return 'a name, or names such as ["a", "b"]', _names
    return _KINDS.get(annotation, ("anything", _anything))


def _whole(given: Any) -> int:
    _refuse(isinstance(given, (bool, np.bool_)))
    return int(given) if isinstance(given, str) else operator.index(given)


def _real(given: Any) -> float:
    _refuse(isinstance(given, (bool, np.bool_)))
    number = float(given)
    _refuse(not math.isfinite(number))
    return number


def _truth(given: Any) -> bool:
    word = str(given).lower()  # also of True and np.True_
    _refuse(word not in ("true", "false"))
    return word == "true"


def _text(given: Any) -> Any:
    _refuse(not isinstance(given, (str, os.PathLike)))
    return given


def _names(given: Any) -> tuple[str, ...]:
    typed = isinstance(given, str) and given.startswith("[")
    found = names(json.loads(given) if typed else given)
    _refuse(not all(isinstance(name, str) for name in found))
    return () if found == ("",) else found


def _nothing(given: Any) -> None:
    _refuse(str(given).lower() not in ("none", "null"))


def _anything(given: Any) -> Any:
    try:
        return json.loads(given) if isinstance(given, str) else given
    except ValueError:
        return given


def _refuse(wrong: bool) -> None:
    if wrong:
        raise TypeError


_KINDS: dict[object, tuple[str, Callable[[Any], Any]]] = {
    int: ("a whole number", _whole),
    float: ("a finite number", _real),
    bool: ("true or false", _truth),
    str: ("a text", _text),
    NoneType: ("none", _nothing),
}
