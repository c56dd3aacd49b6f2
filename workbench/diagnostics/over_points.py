"""A diagnosis at many points: which directions are null everywhere, and which only somewhere.

A knee that is stretched hides what a bent one shows. `diagnose_over` diagnoses a problem at many
points, draws of its priors, of a posterior, or frames of a recording, and counts by name.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.blocks import Layout, Values
from workbench.diagnostics.diagnosis import diagnose_whole
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.words import counted
from workbench.errors import BadArgument, joined
from workbench.problem import Problem

MOST_LISTED = 15  # names in a report
NAMED_PART = 0.1  # of a unit vector: what a block has to hold to be named


@dataclass(frozen=True)
class Recurring:
    """Directions of one name, without the coefficients, which differ from point to point.

    Attributes:
        name: what the directions are called, such as `a turn of pose[left_wrist]`. Those that have
            no name but a combination of entries are `mixed directions of betas and pose`.
        count: at how many points there are some.
        most: the largest number of them at one point.
    """

    name: str
    count: int
    most: int


@dataclass(frozen=True, eq=False)
class PointsDiagnosis:
    """Ranks and directions at M points of a problem in n unknowns.

    Attributes:
        unknowns: n.
        ranks: (M,) the rank at each point.
        null: the null directions, the most frequent first.
        weak: the weak directions likewise.
    """

    unknowns: int
    ranks: Index
    null: tuple[Recurring, ...]
    weak: tuple[Recurring, ...]

    @property
    def count(self) -> int:
        """M, the number of points at which the problem was diagnosed."""
        return len(self.ranks)

    @property
    def everywhere(self) -> tuple[Recurring, ...]:
        """The directions that are null at every point."""
        return tuple(family for family in self.null if family.count == self.count)

    @property
    def somewhere(self) -> tuple[Recurring, ...]:
        """The directions that are null at some points and not at others."""
        return tuple(family for family in self.null if family.count < self.count)

    def report(self) -> str:
        """All of it in sentences."""
        M, n = self.count, self.unknowns
        full = int((self.ranks == n).sum())
        lines = [f"{n} unknowns, diagnosed at {M} points"]
        if full == M:
            lines.append("no direction is null at any point")
        else:
            ranks = ", ".join(
                f"{rank} at {times}" for rank, times in sorted(Counter(self.ranks.tolist()).items())
            )
            lines.append(f"rank {ranks} of them; {n} would be full")
        for title, directions in (
            ("null at every point", self.everywhere),
            ("null at some points", self.somewhere),
            ("weak: a characteristic scale changes the residuals by less than a sigma", self.weak),
        ):
            if directions:
                shown = directions[:MOST_LISTED]
                lines += ["", title, *(f"  {self._in_words(family)}" for family in shown)]
                if len(directions) > MOST_LISTED:
                    lines.append(f"  and {counted(len(directions) - MOST_LISTED, 'further name')}")
        return "\n".join(lines)

    def _in_words(self, family: Recurring) -> str:
        several = f", up to {family.most} at one point" if family.most > 1 else ""
        if family.count == self.count:
            return f"{family.name}{several}"
        return f"{family.name}: at {family.count} of {self.count} points{several}"


def diagnose_over(
    problem: Problem,
    points: Iterable[Mapping[str, ArrayLike]],
    *,
    priors: str | Iterable[str] = (),
    gauges: Iterable[Gauge] = (),
    progress: Callable[[int], object] | None = None,
) -> PointsDiagnosis:
    """Diagnose a problem at many points; `progress` is told how many are done.

    Each point holds the values of every block that the problem reads. `priors` and `gauges` are
    those of `diagnose`. Raises BadArgument if there is no point, and what `diagnose` raises.

    >>> import casadi, workbench as wb
    >>> from workbench.diagnostics import diagnose_over
    >>> from workbench.residuals import Residual
    >>> angle = wb.Block("angle", (1,), "rad")
    >>> height = casadi.cos(angle.symbol)
    >>> problem = wb.Problem([Residual("height", height, 0.01)], ["angle"])
    >>> diagnose_over(problem, [{"angle": [a]} for a in (0.0, 0.5, 1.0)]).ranks.tolist()
    [0, 1, 1]
    """
    ranks: list[int] = []
    null: dict[str, Counter[int]] = {}
    weak: dict[str, Counter[int]] = {}
    names = priors if isinstance(priors, str) else tuple(priors)
    declared = tuple(gauges)
    for number, point in enumerate(points):
        d = diagnose_whole(problem, point, priors=names, gauges=declared)
        ranks.append(d.rank)
        for counts, directions in ((null, d.null_directions), (weak, d.weak_directions)):
            for direction in directions:
                counts.setdefault(_family(direction, problem.free), Counter())[number] += 1
        if progress is not None:
            progress(number + 1)
    if not ranks:
        raise BadArgument("there is no point to diagnose at; give the values of one or more")
    n = problem.free.size
    return PointsDiagnosis(n, np.array(ranks), _by_frequency(null), _by_frequency(weak))


def _family(direction: Direction, free: Layout) -> str:
    """What a direction is called without its terms; by what moves if it has no other name."""
    if title := direction.name.removesuffix(direction.terms).removesuffix(": "):
        return title
    v = abs(direction.vector)
    moved = [name for name, part in free.slices.items() if v[part].max(initial=0) > NAMED_PART]
    return f"mixed directions of {joined(moved)}"


def _by_frequency(families: Mapping[str, Counter[int]]) -> tuple[Recurring, ...]:
    recurring = [
        Recurring(name, len(counts), max(counts.values())) for name, counts in families.items()
    ]
    return tuple(sorted(recurring, key=lambda family: (-family.count, family.name)))


def prior_draws(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    priors: str | Iterable[str],
    count: int,
    seed: int = 0,
) -> list[Values]:
    """Draws of the free blocks from the priors of a problem; other blocks stay as they are.

    With r the priors' whitened residual and J its Jacobian at `values`, a draw solves J x + r = z
    for a change x and a standard normal z, in the least-squares sense (Papandreou and Yuille,
    Gaussian sampling by local perturbations, 2010). This is exact where priors are Gaussian. What
    they do not determine, such as the place of a body, stays where it is in `values`. A prior that
    is no Gaussian is replaced by its Gaussian approximation at `values`. Raises BadArgument for no
    priors and for no draws, and UnknownName for a name that no residual has.
    """
    names = (priors,) if isinstance(priors, str) else tuple(priors)
    if not names or count < 1:
        raise BadArgument(
            "draws of the priors need the name of one or more residuals that are priors, and a "
            f"count from 1 on, not {names} and {count}"
        )
    problem.rows_named(names)
    alone = problem.without(*(name for name in problem.rows if name not in names))
    here = alone.linearize(values)
    z = np.random.default_rng(seed).standard_normal((len(here.residual), count))
    changes = np.linalg.lstsq(here.dense, z - here.residual[:, None], rcond=1e-10)[0]
    x, fixed = alone.split(values)
    return [{**problem.read(values), **alone.values(x + change, fixed)} for change in changes.T]
