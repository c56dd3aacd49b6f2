"""A property computed at most once an object, which no other object waits for.

`functools.cached_property` holds one lock for all objects of a class until Python 3.12, so that
two threads, each with objects of its own, would take turns.
"""

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

Owner = TypeVar("Owner")
Value = TypeVar("Value")


class once(Generic[Owner, Value]):  # noqa: N801 (read as a decorator)
    """Of an object with a `__dict__`; two threads that ask at once may both compute it."""

    def __init__(self, compute: Callable[[Owner], Value]) -> None:
        self.func, self.__doc__ = compute, compute.__doc__  # named as cached_property's
        self._name = compute.__name__

    @overload
    def __get__(self, owner: None, kind: type) -> "once[Owner, Value]": ...
    @overload
    def __get__(self, owner: Owner, kind: type) -> Value: ...
    def __get__(self, owner: Any, kind: type) -> Any:
        """The value, computed if it is not there yet; later reads find it in the object."""
        if owner is None:
            return self
        found = owner.__dict__[self._name] = self.func(owner)
        return found
