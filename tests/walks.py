"""A run of the workbench recorded as a walk through its files.

A reader who follows a call from file to file is served well if the way only leads down. Where it
does not, one of these happens, each counted once per pair of modules:

- a climb: a module calls one on a higher floor (see `FLOORS` in `test_architecture.py`);
- a return: a module of the walked rooms calls one that imports it, directly or indirectly. Who
  reads files in the order of their imports has left that one already;
- an unrelated call: a module of the walked rooms calls another one of them, and neither imports
  the other. The call goes through a protocol, and a reader does not see where to.

The caller is the nearest frame of `workbench` further up, so that callbacks, protocols and
properties count. To walk a run and print what was found:

    from tests.walks import walk
    print(walk(lambda: train(registrations, start)).described("training"))

`returns` and `unrelated` take the names of the rooms that are walked; `climbs` are all of them.
"""

import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from tests.test_architecture import FLOOR, MODULES, ROOT, imports_of


@dataclass(frozen=True)
class Call:
    """A call from one module of the workbench to another.

    Attributes:
        caller: the calling module as its path without suffix, such as `training/blocks`.
        callee: the module of the called function, in the same form.
        function: the qualified name of the function that was called first.
    """

    caller: str
    callee: str
    function: str

    def __str__(self) -> str:
        return f"{self.caller} -> {self.callee} ({self.function})"


@dataclass(frozen=True)
class Walk:
    """The calls between modules during a run, one of each pair of modules."""

    calls: tuple[Call, ...]

    @property
    def climbs(self) -> list[Call]:
        """The calls to a module on a higher floor."""
        return [call for call in self.calls if _floor(call.callee) > _floor(call.caller)]

    def returns(self, *rooms: str) -> list[Call]:
        """The calls inside these rooms to a module that imports the caller."""
        return [call for call in self._inside(rooms) if call.caller in _below(call.callee)]

    def unrelated(self, *rooms: str) -> list[Call]:
        """The calls inside these rooms between modules of which neither imports the other."""
        return [
            call
            for call in self._inside(rooms)
            if call.caller not in _below(call.callee) and call.callee not in _below(call.caller)
        ]

    def described(self, *rooms: str) -> str:
        """What was found, a line for each call that does not lead down."""
        files = {module for call in self._inside(rooms) for module in (call.caller, call.callee)}
        found = {
            "returns": self.returns(*rooms),
            "unrelated calls": self.unrelated(*rooms),
            "climbs": self.climbs,
        }
        lines = [f"{len(files)} files"]
        for kind, calls in found.items():
            lines += [f"{len(calls)} {kind}", *(f"    {call}" for call in calls)]
        return "\n".join(lines)

    def _inside(self, rooms: tuple[str, ...]) -> list[Call]:
        return [
            call
            for call in self.calls
            if call.caller.split("/")[0] in rooms and call.callee.split("/")[0] in rooms
        ]


def walk(run: Callable[[], object]) -> Walk:
    """The calls between modules of `workbench` while `run` runs, in threads that it starts too."""
    calls: dict[tuple[str, str], Call] = {}

    def note(frame: FrameType, event: str, argument: Any) -> None:
        callee = _module(frame.f_code.co_filename)
        if event != "call" or callee is None or frame.f_code.co_name == "<module>":
            return
        above = frame.f_back
        while above is not None and (caller := _module(above.f_code.co_filename)) is None:
            above = above.f_back
        if above is None or above.f_code.co_name == "<module>" or caller in (None, callee):
            return
        assert caller is not None
        calls.setdefault((caller, callee), Call(caller, callee, frame.f_code.co_qualname))

    before = sys.getprofile(), threading.getprofile()
    threading.setprofile(note)  # of threads that are started meanwhile
    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(before[0])
        threading.setprofile(before[1])  # type: ignore[arg-type]  # None is allowed
    return Walk(tuple(calls.values()))


@cache
def _module(file: str) -> str | None:
    path = Path(file)
    return _name(path) if path.is_relative_to(ROOT) else None


def _name(path: Path) -> str:
    return path.relative_to(ROOT).with_suffix("").as_posix()


def _floor(module: str) -> int:
    return FLOOR.get(module.split("/")[0], -1)


@cache
def _imports() -> dict[str, set[str]]:
    names = {
        f"workbench.{_name(path)}".replace("/", ".").removesuffix(".__init__"): _name(path)
        for path in MODULES
    }
    return {
        _name(path): {names[found] for found in imports_of(path) if found in names} - {_name(path)}
        for path in MODULES
    }


@cache
def _below(module: str) -> frozenset[str]:
    """All modules that a module imports, directly or indirectly."""
    found: set[str] = set()
    ahead = [module]
    while ahead:
        for imported in _imports().get(ahead.pop(), set()) - found:
            found.add(imported)
            ahead.append(imported)
    return frozenset(found)
