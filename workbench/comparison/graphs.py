"""CasADi functions of a metered problem: calls with numbers are counted, other uses are noticed."""

from collections.abc import Callable, Iterable
from typing import Any

import casadi as cs
import numpy as np

from workbench.arrays import Array

Call = Callable[[Callable[[], Any], Array, Array, Callable[[Any], Array]], Any]
# questions about a function that evaluate nothing, as are all about its inputs and outputs
HARMLESS = {"name", "jac_sparsity", "info", "class_name", "type_name", "is_a", "is_null"}
HARMLESS |= {"n_instructions", "n_nodes", "has_free", "get_free"}


class MeteredFunction:
    """A function (x, fixed) -> outputs of a problem, in the place of the function itself.

    Called with numbers, also for several points side by side, and also after `map(count)` or
    `expand()`, every point is counted. In whatever else a CasADi function can be used for (called
    with symbols, given to nlpsol or rootfinder, differentiated, buffered, saved) its evaluations
    cannot be seen: then `taken` is called, and the function itself is handed over. It is built
    when it is needed first.
    """

    def __init__(
        self,
        build: Callable[[], cs.Function],
        sizes: tuple[int, int],
        call: Call,
        costs: Callable[[cs.DM], Array],
        taken: Callable[[], None],
    ) -> None:
        self._build, self._sizes, self._call = build, sizes, call
        self._costs, self._taken = costs, taken
        self._built: cs.Function | None = None

    @property
    def _function(self) -> cs.Function:
        if self._built is None:
            self._built = self._build()
        return self._built

    @property  # type: ignore[misc]  # for solvers that ask what they were given
    def __class__(self) -> Any:
        return cs.Function

    def __repr__(self) -> str:
        return repr(self._function)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """The outputs, as a CasADi function returns them; a call with numbers is counted."""
        function = self._function
        return self._answered(lambda: function(*arguments, **named), arguments, named)

    def call(self, arguments: Any, *inlined: bool) -> Any:
        """Like `call` of a CasADi function: a list or a dict of arguments to one of outputs."""
        function = self._function
        named = arguments if isinstance(arguments, dict) else {}
        ordered = () if isinstance(arguments, dict) else tuple(arguments)
        return self._answered(lambda: function.call(arguments, *inlined), ordered, named)

    def map(self, *arguments: Any) -> Any:
        """Like `map` of a CasADi function; `map(count)` and `map(count, how)` are still counted."""
        mapped = self._function.map(*arguments)
        if isinstance(arguments[0], int):
            return self._of(mapped)
        self._taken()
        return mapped

    def expand(self, *arguments: Any) -> Any:
        """Like `expand` of a CasADi function; calls of what it returns are still counted."""
        return self._of(self._function.expand(*arguments))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in HARMLESS and not name.endswith(("_in", "_out")):
            self._taken()
        return getattr(self._function, name)

    def _of(self, changed: cs.Function) -> "MeteredFunction":
        made = MeteredFunction(lambda: changed, self._sizes, self._call, self._costs, self._taken)
        return made

    def _answered(
        self, compute: Callable[[], Any], ordered: tuple[Any, ...], named: dict[str, Any]
    ) -> Any:
        given = (*ordered, *named.values())
        if any(isinstance(a, (cs.MX, cs.SX)) for a in _flat(given)):
            self._taken()
            return compute()
        x = ordered[0] if ordered else named.get("x", 0.0)
        fixed = ordered[1] if len(ordered) > 1 else named.get("fixed", 0.0)
        try:
            points, given_fixed = _columns(x, self._sizes[0]), _columns(fixed, self._sizes[1])
        except ValueError:
            return compute()  # CasADi says what is wrong with the arguments
        count = max(len(points), len(given_fixed))
        points = np.broadcast_to(points, (count, self._sizes[0]))
        given_fixed = np.broadcast_to(given_fixed, (count, self._sizes[1]))
        return self._call(compute, points, given_fixed, lambda out: self._costs(_first(out)))


def _flat(given: Iterable[Any]) -> Iterable[Any]:
    for one in given:
        if isinstance(one, (list, tuple)):
            yield from _flat(one)
        else:
            yield one


def _columns(value: Any, size: int) -> Array:
    """An argument as CasADi reads it, a row for each point: (points, size)."""
    given = np.asarray(cs.DM(value), dtype=float)
    if given.size in (0, 1):  # nothing is zero, and one number stands for all
        return np.full((1, size), float(given.sum()))
    if size and given.shape[0] == size:
        return np.ascontiguousarray(given.T)
    return given.reshape(-1, size) if size else np.zeros((1, 0))


def _first(outputs: Any) -> cs.DM:
    """The first output: a residual, or a cost."""
    if isinstance(outputs, dict):
        return next(outputs[name] for name in ("r", "cost", "H") if name in outputs)
    return outputs[0] if isinstance(outputs, (list, tuple)) else outputs
