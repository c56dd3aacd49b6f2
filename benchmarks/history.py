"""How the promised ratios have changed, so that a version that became slower shows.

Every measurement of a part adds one to `results/history.json`. Only ratios of times of one run are
kept and compared, each with others from the same processor: times themselves change with the
machine, its load and its age. (Tools such as asv keep the times of each version, and so need a
machine of their own that does nothing else.)
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import targets
from benchmarks.keeping import keep
from benchmarks.targets import Target

FILE = "history.json"
DIGITS = 4
WORSE = 1.15  # times the median of those before; runs of one version differed by up to 1.1


@dataclass(frozen=True)
class Measured:
    """One promised ratio, in one measurement.

    Attributes:
        part: the part of the benchmarks.
        date: when it was measured, ISO 8601.
        processor: on what.
        target: the ratio and its limit.
    """

    part: str
    date: str
    processor: str
    target: Target

    @property
    def used(self) -> float:
        """The share of its limit: 1 just holds, more is missed."""
        ratio = self.target.measured / self.target.limit
        return ratio if self.target.at_most else 1 / ratio


@dataclass(frozen=True)
class Course:
    """One ratio through time on one processor, oldest first."""

    measured: tuple[Measured, ...]

    @property
    def name(self) -> str:
        """The ratio's name."""
        return self.measured[-1].target.name

    @property
    def change(self) -> float:
        """The newest against the median of those before, as a factor; above 1 is slower."""
        *before, newest = [one.used for one in self.measured]
        return newest / median(before) if before else 1.0

    @property
    def slower(self) -> bool:
        """Whether it is slower by more than chance explains."""
        return self.change > WORSE


def remember(results: Path, part: str, data: Mapping[str, Any]) -> None:
    """Add the promised ratios of a part that was just measured; the same date replaces itself."""
    file, machine = results / FILE, data["machine"]
    found = {one.name: one.measured for one in targets.all_of({part: data})}
    if not found:
        return
    entry = {
        "part": part,
        "date": machine["date"],
        "processor": machine["processor"],
        "versions": {name: v for name, v in machine["versions"].items() if v},
        "ratios": found,
    }
    others = [one for one in read(results) if (one["part"], one["date"]) != (part, machine["date"])]
    keep(file, sorted([*others, entry], key=lambda one: str(one["date"])), DIGITS)


def read(results: Path) -> list[dict[str, Any]]:
    """All measurements that are remembered, oldest first."""
    file = results / FILE
    return list(json.loads(file.read_text())) if file.exists() else []


def courses(history: Sequence[Mapping[str, Any]], promised: Sequence[Target]) -> list[Course]:
    """Each promised ratio on the processor where it was measured last, in the order of promises."""
    found = []
    for target in promised:
        told = [*_told(history, target)]
        if told:
            here = told[-1].processor
            found.append(Course(tuple(one for one in told if one.processor == here)))
    return found


def _told(history: Sequence[Mapping[str, Any]], target: Target) -> Iterator[Measured]:
    for entry in history:
        if target.name in entry["ratios"]:
            measured = float(entry["ratios"][target.name])
            yield Measured(
                str(entry["part"]),
                str(entry["date"]),
                str(entry["processor"]),
                Target(target.name, measured, target.limit, target.at_most),
            )
