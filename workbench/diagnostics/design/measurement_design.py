"""What a design of measurements found: a ranking, a choice, and standard deviations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.blocks.layout import entries
from workbench.diagnostics.design.criteria import YARDSTICKS
from workbench.diagnostics.design.search import Score, State
from workbench.errors import some_of

SHOWN = 12  # candidates in the text


@dataclass(frozen=True)
class Ranked:
    """One candidate by itself.

    Attributes:
        name: its name.
        score: the criterion after it was measured.
        nats: the information that it adds on what was determined before, a mean over the points.
        sees: how many null directions it closes, summed over the points.
    """

    name: str
    score: Score
    nats: float
    sees: int

    @property
    def sd(self) -> float:
        """The criterion as a standard deviation; infinite if what matters stays undetermined."""
        return self.score.sd


@dataclass(frozen=True, eq=False)
class MeasurementDesign:
    """Which candidates to measure next, and what is known before and after.

    Attributes:
        criterion: the name of the criterion.
        unit: the unit of the criterion.
        yardstick: what a yardstick is at the first point, block by block.
        points: how many points were averaged over.
        before: the criterion before any candidate is measured.
        ranking: every candidate by itself, the best first.
        chosen: the names of the chosen ones, best first.
        steps: the criterion after the first chosen one, the first two, and so on.
        search: what the search did, in a sentence.
        single: by the choices that are best at single points, at how many of them.
        undetermined: the names of the null directions before, at the first point.
        uncounted: the bounds and inequalities that are active at a point, which do not count.
        free: the layout of the unknowns.
        yardsticks: (T, n) of the unknowns at each point.
        known_before: what is known at each point.
        known_after: the same after all chosen ones.
    """

    criterion: str
    unit: str
    yardstick: str
    points: int
    before: Score
    ranking: tuple[Ranked, ...]
    chosen: tuple[str, ...]
    steps: tuple[Score, ...]
    search: str
    single: Mapping[tuple[str, ...], int]
    undetermined: tuple[str, ...]
    uncounted: tuple[str, ...]
    free: Layout = field(repr=False)
    yardsticks: Array = field(repr=False)
    known_before: State = field(repr=False)
    known_after: State = field(repr=False)

    @property
    def best(self) -> str:
        """The name of the best candidate by itself."""
        return self.ranking[0].name

    @property
    def after(self) -> Score:
        """The criterion after all chosen ones."""
        return self.steps[-1]

    @property
    def gain(self) -> float:
        """How many times smaller the standard deviation becomes; infinite where it had no limit."""
        if self.before.open and not self.after.open:
            return float("inf")
        return float(np.exp(self.before.log_sd - self.after.log_sd))

    @property
    def sd_before(self) -> Array:
        """(n,) the standard deviation of each unknown in its unit, rms over the points."""
        return _sds(self.known_before, self.yardsticks)

    @property
    def sd_after(self) -> Array:
        """(n,) the same after all chosen ones were measured."""
        return _sds(self.known_after, self.yardsticks)

    def sds(self, name: str) -> tuple[float, float]:
        """The sd of a block or entry before and after, rms over its entries. Raises UnknownName."""
        at = entries(self.free, name)
        before, after = (np.sqrt(np.mean(s[at] ** 2)) for s in (self.sd_before, self.sd_after))
        return float(before), float(after)

    @property
    def agreement(self) -> float:
        """At which share of the points the choice is the one that is best there."""
        same = (n for some, n in self.single.items() if set(some) == set(self.chosen))
        return sum(same) / self.points

    @property
    def without_bounds(self) -> str:
        """Which active bounds do not count, and what that means; empty where none is active."""
        if not self.uncounted:
            return ""
        are = "is active and does" if len(self.uncounted) == 1 else "are active and do"
        return (
            f"{some_of(self.uncounted)} {are} not count: if the true values lie there, "
            "uncertainties are smaller than these"
        )

    def report(self) -> str:
        """The design as text."""
        averaged = f", averaged over {self.points} points" if self.points > 1 else ""
        lines = [
            f"WHAT TO MEASURE NEXT: {len(self.chosen)} of {len(self.ranking)} candidates",
            f"by {self.criterion}{averaged}",
            f"  before: {self._said(self.before)}",
        ]
        if self.unit == YARDSTICKS:
            lines.append("  a yardstick is")
            lines += [f"    {one}" for one in self.yardstick.split("; ")]
        if self.undetermined:
            lines.append(f"  nothing determines {some_of(self.undetermined)}")
        if self.uncounted:
            lines.append(f"  {self.without_bounds}")
        lines += [f"EACH CANDIDATE BY ITSELF ({self.unit}; gain in nats)"]
        width = max(len(one.name) for one in self.ranking)
        for place, one in enumerate(self.ranking[:SHOWN], 1):
            sees = f", sees {one.sees} undetermined directions" if one.sees else ""
            said = self._said(one.score)
            lines.append(f"  {place:3}. {one.name:{width}}  {said}  ({one.nats:.2f} nats{sees})")
        if len(self.ranking) > SHOWN:
            last = self.ranking[-1]
            lines.append(f"  ... and {len(self.ranking) - SHOWN} more")
            lines.append(f"  {len(self.ranking):3}. {last.name:{width}}  {self._said(last.score)}")
        lines.append(f"THE CHOICE ({self.search})")
        for name, score in zip(self.chosen, self.steps, strict=True):
            lines.append(f"  + {name:{width}}  {self._said(score)}")
        if self.points > 1:
            here = round(self.agreement * self.points)
            lines.append(
                f"  it is the best choice at {here} of {self.points} points; the best choice at a "
                f"single point is one of {len(self.single)}"
            )
        lines.append("STANDARD DEVIATIONS by block, before and after (rms of the entries)")
        for block in self.free.blocks:
            before, after = self.sds(block.name)
            lines.append(f"  {block.name}: {before:.3g} -> {after:.3g} {block.unit}")
        return "\n".join(lines)

    def data(self) -> dict[str, Any]:
        """The design as plain values, for JSON; what is infinite is None."""

        def number(value: float) -> float | None:
            return value if np.isfinite(value) else None

        return {
            "criterion": self.criterion,
            "unit": self.unit,
            "points": self.points,
            "before": number(self.before.sd),
            "after": number(self.after.sd),
            "gain": number(self.gain),
            "search": self.search,
            "chosen": list(self.chosen),
            "steps": [number(score.sd) for score in self.steps],
            "agreement": self.agreement,
            "undetermined": list(self.undetermined),
            "uncounted": list(self.uncounted),
            "ranking": [
                {"name": r.name, "sd": number(r.sd), "nats": r.nats, "sees": r.sees}
                for r in self.ranking
            ],
            "blocks": {
                block.name: [number(sd) for sd in self.sds(block.name)]
                for block in self.free.blocks
            },
        }

    def _said(self, score: Score) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if score.open:
            return f"{score.open} undetermined"
        return f"{score.sd:.4g}{unit}"


def _sds(known: State, yardsticks: Array) -> Array:
    each = np.stack([u.sds for u in known]) * yardsticks
    return np.asarray(np.sqrt(np.mean(each**2, axis=0)))
