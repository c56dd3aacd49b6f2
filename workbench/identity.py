"""What a thing is, as plain data: for the keys of stored runs, and to be read."""

import hashlib
import inspect
import json
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import workbench

MOST_LEVELS = 8  # levels that are looked into
NOT_IN_RESULTS = (  # what no stored result depends on: packages, and modules of `comparison`
    *("cli", "course", "lectures", "plots", "reports"),
    *(f"comparison/{name}.py" for name in ("advice", "comparison", "statistics", "store")),
    *("comparison/tables.py", "comparison/targets.py"),
)
COMPUTING_LIBRARIES = ("casadi", "numpy", "scipy", "nlopt")


def identity(thing: Any, depth: int = MOST_LEVELS) -> Any:
    """Plain data that differ when the thing does: functions by their names and their source,
    arrays by a digest, objects by type and contents; never an address in memory.
    """
    if thing is None or isinstance(thing, (bool, int, float, str)):
        return thing
    if isinstance(thing, Enum):
        return thing.name
    if isinstance(thing, np.generic):
        return thing.item()
    if isinstance(thing, np.ndarray):
        contents = hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()[:16]
        return f"array {thing.shape} {thing.dtype} {contents}"
    if isinstance(thing, type) or inspect.isroutine(thing):
        return _name_of(thing)
    if depth == 0:
        return _name_of(type(thing))
    if isinstance(thing, Mapping):
        return {str(k): identity(v, depth - 1) for k, v in thing.items()}
    if isinstance(thing, Set):
        return sorted(str(identity(one, depth - 1)) for one in thing)
    if isinstance(thing, Sequence):
        return [identity(one, depth - 1) for one in thing]
    if isinstance(thing, Path):
        return str(thing)
    if is_dataclass(thing):
        names = [f.name for f in fields(thing) if not f.name.startswith("_")]
        members = {name: getattr(thing, name) for name in names}
    else:
        members = dict(getattr(thing, "__dict__", {}))
    inside = {name: identity(value, depth - 1) for name, value in members.items()}
    return {"type": _name_of(type(thing)), **inside}


def _name_of(thing: Any) -> str:
    """`module.name`, and a digest of the source of what is not the workbench's own."""
    module = str(getattr(thing, "__module__", "") or "")
    name = f"{module}.{getattr(thing, '__qualname__', type(thing).__name__)}"
    if is_own_code(module) or module == "builtins":
        return name
    try:
        return f"{name} {digest(inspect.getsource(thing))}"
    except (OSError, TypeError):
        return name


def is_own_code(module: str) -> bool:
    """Whether `code_version` answers for a module: one of the workbench, and of no lecture."""
    packages = module.split(".")
    return packages[0] == "workbench" and packages[1:2] != ["lectures"]


def digest(thing: Any) -> str:
    """16 letters that differ when the thing does."""
    text = json.dumps(identity(thing), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def file_digest(path: str) -> str:
    """A digest of a file's contents; empty if there is no file."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16] if path else ""
    except OSError:
        return ""


@cache
def code_version() -> str:
    """A digest of the workbench's code, as far as results depend on it, and of the libraries."""
    root = Path(workbench.__file__).parent
    code = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if name not in NOT_IN_RESULTS and name.partition("/")[0] not in NOT_IN_RESULTS:
            code.update(name.encode() + path.read_bytes())
    for package in COMPUTING_LIBRARIES:
        try:
            code.update(f"{package} {version(package)}".encode())
        except PackageNotFoundError:
            continue
    return code.hexdigest()[:16]
