"""Facts in JSON and TOML; each is read as the kind of value that it must be.

Functions here raise BadFile with the reason alone, as those of `workbench.reading.arrays` do.
"""

import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from numpy.typing import NDArray

from workbench.errors import BadFile, cut, listed, shown
from workbench.reading.arrays import refuse_what_is_no_file

MOST_TOML_BYTES = 2**20  # a hundred calibrated cameras take a twentieth of that
MOST_PARTS = 20  # of a dotted key: Python's parser looks at each part once for every part after it
DOTTED = re.compile(  # so many parts in one key, bare or quoted; numbers have one dot
    rf"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
    rf"""(?:[ \t]*+\.[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')){{{MOST_PARTS}}}"""
)


T = TypeVar("T")
MOST_BYTES = 2**30  # of a JSON file; the keypoints of COCO take a quarter of that
# An empty list takes 3 bytes of JSON and 64 bytes of memory. Any JSON may hold a million lists and
# objects, and one more for every 8 of its bytes, which real ones never reach.
FREE_LISTS, BYTES_OF_LIST = 10**6, 8
MISSING = object()


def json_in(path: str | Path) -> Any:
    """The contents of a JSON file. Raises BadFile with a sentence that names the file."""
    try:
        return parsed(bounded(path))
    except (OSError, BadFile) as error:
        raise BadFile(f"{path} cannot be read as JSON: {cut(error)}") from error


def toml_in(path: Path) -> dict[str, Any]:
    """The contents of a TOML file. Raises BadFile with a sentence that names the file."""
    try:
        text = bounded(path, MOST_TOML_BYTES).decode(
            "utf-8-sig"
        )  # editors on Windows begin with a mark
        if too_long := DOTTED.search(text):
            line = text.count("\n", 0, too_long.start()) + 1
            raise BadFile(f"a key in line {line} has more than {MOST_PARTS} parts")
        return tomllib.loads(text)
    except (OSError, ValueError, RecursionError, BadFile) as error:  # too deep, or no UTF-8
        raise BadFile(f"{path} cannot be read as TOML: {cut(error)}") from error


def bounded(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """All bytes of a file, if they are not more than `most`. Raises BadFile, OSError.

    Pipes and devices are refused: a pipe may never send anything, and /dev/zero has no end.
    """
    path = Path(path)
    refuse_what_is_no_file(path)
    if path.stat().st_size > most:
        raise BadFile(f"it has more than {most:,} bytes")
    return path.read_bytes()


def parsed(text: str | bytes | bytearray) -> Any:
    """The value of a JSON text. Raises BadFile, also if an object has two entries of one name."""
    raw = text.encode(errors="replace") if isinstance(text, str) else text
    lists, most = raw.count(b"[") + raw.count(b"{"), FREE_LISTS + len(text) // BYTES_OF_LIST
    if lists > most:
        raise BadFile(f"it holds {lists:,} lists and objects, too many for its {len(text):,} bytes")
    try:
        return json.loads(text, object_pairs_hook=_object)
    except (ValueError, RecursionError, MemoryError) as error:  # also text that is not UTF-8
        raise BadFile(f"{type(error).__name__}: {cut(error)}") from error


def _object(entries: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of JSON. Raises BadFile if two of its entries have one name."""
    by_name = dict(entries)
    if len(by_name) < len(entries):
        twice, _ = Counter(name for name, _ in entries).most_common(1)[0]
        raise BadFile(f"an object in it has two entries called {shown(twice)}")
    return by_name


def facts_in(array: NDArray[Any]) -> "Facts":
    """The object that an array of one text holds."""
    value = parsed(str(array))
    if not isinstance(value, dict):
        raise BadFile(f"its facts are {shown(value)}, not an object with names")
    return Facts(value)


@dataclass(frozen=True)
class Facts:
    """A JSON object. Every method raises BadFile if the entry is missing or of another kind.

    Attributes:
        entries: what the object holds, by name.
        where: where the object stands in its file, with which error messages begin.
    """

    entries: Mapping[str, Any]
    where: str = ""

    def text(self, key: str) -> str:
        """An entry that is a text."""
        return self._read(key, text)

    def number(self, key: str) -> float:
        """An entry that is a number, which may be NaN or infinite."""
        return self._read(key, number)

    def amount(self, key: str) -> float:
        """A number that is not below zero, which may be NaN or infinite."""
        return self._read(key, amount)

    def duration(self, key: str) -> float:
        """An entry that is a time in seconds, a finite number from 0."""
        return self._read(key, duration)

    def whole(self, key: str) -> int:
        """An entry that is a whole number from 0."""
        return self._read(key, whole)

    def truth(self, key: str) -> bool:
        """An entry that is true or false."""
        return self._read(key, truth)

    def among(self, key: str, known: Iterable[str]) -> str:
        """One of the names that are known."""
        name, names = self.text(key), tuple(known)
        if name not in names:
            raise BadFile(f"{self.where}{key} is {shown(name)}; there are {listed(names)}")
        return name

    def several(self, key: str, of: Callable[[object, str], T]) -> tuple[T, ...]:
        """A list whose entries are all of the kind `of`: text, number, whole, ..."""
        return self._read(key, lambda value, name: several(value, name, of))

    def named(self, key: str, of: Callable[[object, str], T]) -> dict[str, T]:
        """An object whose entries are all of the kind `of`."""
        inner = self._read(key, facts)
        return {name: of(value, f"{inner.where}{name}") for name, value in inner.entries.items()}

    def facts(self, key: str) -> "Facts":
        """An entry that is an object itself."""
        return self._read(key, facts)

    def nothing_else(self, *keys: str) -> None:
        """Raise BadFile if there are entries with other names."""
        if others := self.entries.keys() - set(keys):
            raise BadFile(f"{self.where}{listed(map(str, others))} is not known")

    def _read(self, key: str, of: Callable[[object, str], T]) -> T:
        value = self.entries.get(key, MISSING)
        if value is MISSING:
            raise BadFile(
                f"{self.where}{key} is missing; there are {listed(map(str, self.entries))}"
            )
        return of(value, f"{self.where}{key}")


def text(value: object, name: str) -> str:
    """The given value if it is a text; raises BadFile otherwise, as the functions below do."""
    return value if isinstance(value, str) else _refuse(value, name, "a text")


def number(value: object, name: str) -> float:
    """A number, which may be NaN or infinite; true and false are no numbers."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        _refuse(value, name, "a number")
    try:
        return float(value)
    except OverflowError:  # of a whole number with over 308 digits
        _refuse(value, name, "a number of float64")


def amount(value: object, name: str) -> float:
    """A number that is not below zero, which may be NaN or infinite."""
    size = number(value, name)
    return _refuse(value, name, "a number from 0") if size < 0 else size


def duration(value: object, name: str) -> float:
    """The given value if it is a time in seconds, a finite number from 0."""
    seconds = amount(value, name)
    return seconds if isfinite(seconds) else _refuse(value, name, "a time in seconds")


def whole(value: object, name: str) -> int:
    """The given value if it is a whole number from 0."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        _refuse(value, name, "a whole number from 0")
    return value


def truth(value: object, name: str) -> bool:
    """The given value if it is true or false."""
    return value if isinstance(value, bool) else _refuse(value, name, "true or false")


def facts(value: object, name: str) -> Facts:
    """The given value if it is an object."""
    if not isinstance(value, dict):
        _refuse(value, name, "an object with names")
    return Facts(value, f"{name}: ")


def several(value: object, name: str, of: Callable[[object, str], T]) -> tuple[T, ...]:
    """The given value if it is a list whose entries are all of one kind."""
    if not isinstance(value, (list, tuple)):
        _refuse(value, name, "a list")
    return tuple(of(entry, f"{name}[{k}]") for k, entry in enumerate(value))


def _refuse(value: object, name: str, expected: str) -> NoReturn:
    raise BadFile(f"{name} is {shown(value)}, not {expected}")
