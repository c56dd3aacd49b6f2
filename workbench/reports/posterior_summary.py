"""The summary over all blocks of a posterior, and the table of the entries of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from workbench.arrays import Array
from workbench.fitting.setup import Setup
from workbench.reports.page import Table, number
from workbench.sampling import EntryComparison, Posterior

UNLIKELY = 1e-3  # the chance of a synthetic truth that contradicts a prior


@dataclass(frozen=True, eq=False)
class BlockPosterior:
    """The posterior of one block, by draws and by Laplace's approximation."""

    name: str
    posterior: Posterior
    approximation: Posterior


def truth_of(p: Posterior, setup: Setup) -> Array | None:
    """The true values (k,) of the sampled entries of synthetic data; None for other data."""
    return None if setup.made_of is None else p.coordinates(setup.made_of)


def contradictions(setup: Setup) -> list[str]:
    """Sentences on priors that make the synthetic truth improbable; none for other data.

    Of draws from a prior of m whitened Gaussian rows, the sum of squares is chi-square of m.
    """
    if setup.made_of is None:
        return []
    problem, found = setup.problem, []
    whitened = problem.residual(*problem.split({**setup.start, **setup.made_of}))
    for name in setup.priors:
        rows = whitened[problem.rows[name]]
        m, total = len(rows), float(rows @ rows)
        if scipy.special.chdtrc(m, total) < UNLIKELY:
            found.append(
                f"the synthetic truth contradicts the {name}: the sum of its {m} squares there is "
                f"{total:,.0f}, where draws from that prior have {m} on average, and more than "
                f"{scipy.special.chdtri(m, UNLIKELY):,.0f} once in {1 / UNLIKELY:,.0f} times. The "
                "posterior believes the prior, so its intervals will hold this truth less often "
                "than they say"
            )
    return found


def truths_inside(p: Posterior, setup: Setup) -> int | None:
    """How many truths lie inside of the 90 % intervals; None without a truth or an interval."""
    truth = truth_of(p, setup)
    if truth is None or not p.mixed:
        return None
    low, high = p.conditional_interval(0.9).T
    return int(np.sum((truth >= low) & (truth <= high)))


def blocks_table(parts: Sequence[BlockPosterior], setup: Setup) -> Table:
    """A row for every block: its verdict, what became of the rest, and what its draws are worth.

    `ratio` is how many times wider intervals become if what is held fixed is free too, at most;
    `contraction` is the median of 1 - sd / (sd of the prior) over the entries with a known prior.
    """
    columns: dict[str, list[str]] = {"block": [part.name for part in parts]}
    posteriors = [part.posterior for part in parts]
    columns["entries"] = [str(p.size) for p in posteriors]
    columns["verdict"] = [p.judgement[0].value for p in posteriors]
    columns["all other free numbers"] = [p.rest for p in posteriors]
    if any(p.conditional for p in posteriors):
        columns["ratio"] = [number(float(p.conditioning.ratios.max()), 3) for p in posteriors]
    columns["effective draws"] = [f"{p.mixing.effective.min():,.0f}" for p in posteriors]
    columns["R-hat"] = [f"{p.mixing.scales.max():.3f}" for p in posteriors]
    columns["contraction"] = [_median(p, setup) for p in posteriors]
    if setup.made_of is not None:
        inside = [truths_inside(p, setup) for p in posteriors]
        columns["truths (synthetic) in 90 %"] = [
            "–" if one is None else f"{one} of {p.size}"
            for one, p in zip(inside, posteriors, strict=True)
        ]
    right = [i for i, name in enumerate(columns) if name in ("entries", "effective draws", "R-hat")]
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), tuple(right))


def _median(p: Posterior, setup: Setup) -> str:
    if not p.mixed:
        return "–"
    found = p.contraction(setup.priors)
    known = found[np.isfinite(found)]
    return f"{np.median(known):.2f}" if len(known) else "no prior known"


def entries_table(p: Posterior, rows: tuple[EntryComparison, ...], setup: Setup) -> Table:
    """A row for every entry, with an interval only if the verdict allows it.

    `marginal sd` is the standard deviation, from J'J, if the fixed unknowns are free as well.
    """
    held, truth = p.conditioning, truth_of(p, setup)
    columns: dict[str, list[str]] = {"entry": list(p.labels), "unit": list(p.units)}
    if p.mixed:
        ends = p.conditional_interval(0.9)
        columns["mean"] = [number(row.mean, 3) for row in rows]
        columns["sd"] = [number(row.sd, 2) for row in rows]
        columns["5 %"] = [number(float(low), 3) for low, _ in ends]
        columns["95 %"] = [number(float(high), 3) for _, high in ends]
        if p.conditional:
            columns["marginal sd"] = [number(float(sd), 2) for sd in held.marginal]
            columns["ratio"] = [number(float(ratio), 2) for ratio in held.ratios]
    if truth is not None:
        columns["truth (synthetic)"] = [number(float(one), 3) for one in truth]
    columns["autocorrelation time (steps)"] = [number(float(time), 2) for time in p.mixing.times]
    columns["effective draws"] = [f"{count:,.0f}" for count in p.mixing.effective]
    columns["R-hat"] = [f"{scale:.3f}" for scale in p.mixing.scales]
    numbers = tuple(range(2, len(columns) + p.mixed))
    if p.mixed:
        columns["sd / Laplace's"] = [number(row.ratio, 2) for row in rows]
        columns["beside Laplace"] = [row.remark for row in rows]
        if p.conditional:
            columns["interval"] = ["conditional"] * p.size
        bars = p.contraction(setup.priors)
        if np.isfinite(bars).any():
            columns["contraction"] = [number(float(one), 2) for one in bars]
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), numbers)
