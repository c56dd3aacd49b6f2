"""What a comparison says, in sentences; each of them is a statement about its numbers."""

import math
from collections.abc import Iterable

from workbench.comparison.comparison import MAIN_TAU, Comparison, by_effort
from workbench.comparison.record import KINDS, LIMITED_KINDS
from workbench.comparison.statistics import FEWEST, LEVEL, Interval
from workbench.comparison.targets import (
    PRICES,
    PRICES_SOURCE,
    TargetOutcome,
    ended_by_clock,
    tau_text,
)
from workbench.diagnostics.words import counted
from workbench.errors import joined


def percent(interval: Interval) -> str:
    """`90% (60–98)`, and `90%` where there is no interval."""
    if math.isnan(interval.value):
        return "–"
    if not interval.bounded:
        return f"{interval.value:.0%}"
    return f"{interval.value:.0%} ({100 * interval.low:.0f}–{100 * interval.high:.0f})"


def reliable(comparison: Comparison, problems: Iterable[str]) -> tuple[str, ...]:
    """The solvers that returned an answer within the target from every start of these problems."""
    starts = [i.name for p in problems for i in comparison.starts(p)]
    met = comparison.returned_within
    return tuple(s for s in comparison.solvers if all(met(i, s, MAIN_TAU) for i in starts))


def advice(comparison: Comparison) -> tuple[str, ...]:
    """Which solver to take for which problems, and why; nothing if the runs do not show it.

    A solver is advised for problems only if it returned an answer within the target from each of
    their starts, and if none of its runs failed, not even one that is left out of the comparison.
    The advice depends on counts and published prices, and not on any clock.
    """
    sentences = _nothing_to_compare(comparison)
    if comparison.compared:
        everywhere = reliable(comparison, comparison.compared)
        sentences.append(_met(comparison, everywhere))
        failed = {solver: _failures(comparison, solver) for solver in everywhere}
        sentences += [text for text in failed.values() if text]
        sentences += _cheapest(comparison, tuple(s for s in everywhere if not failed[s]))
    return (*sentences, *_uncounted(comparison), *_clock(comparison))


def _failures(comparison: Comparison, solver: str) -> str:
    """Why a solver is not advised: of all of its runs, those not at the lowest cost; or empty."""
    counts = comparison.outcome_counts(solver)
    runs, fine = counts.total(), (TargetOutcome.REACHED, TargetOutcome.ALONE)
    how = [
        f"in {counts[k]} of {runs} runs it {k.value}"
        for k in TargetOutcome
        if counts[k] and k not in fine
    ]
    return f"{solver} is not advised: {'; '.join(how)}." if how else ""


def _nothing_to_compare(comparison: Comparison) -> list[str]:
    left_out = len(comparison.instances) - len(comparison.comparable)
    if not left_out:
        return []
    why = "only one run ended and no known cost shows whether its cost is low"
    if comparison.comparable:
        return [f"{left_out} of {len(comparison.instances)} starts are left out: {why}."]
    return [
        f"There is nothing to compare: of each problem {why}. Compare several solvers or several "
        "starts, or give the experiment its known cost."
    ]


def _met(comparison: Comparison, everywhere: tuple[str, ...]) -> str:
    """Which solvers met the target from every start, and from how many the others did."""
    count, several = len(comparison.comparable), len(comparison.compared) > 1
    starts = f"all {count} starts" if count > 1 else "the one start"
    what = f"returned a point within the target τ = {tau_text(MAIN_TAU)} from {starts}"
    if not everywhere:
        problems = " for all of these problems" if several else ""
        return f"No solver {what}, so none is advised{problems}."
    text = f"{joined(everywhere)}{' each' if len(everywhere) > 1 else ''} {what}."
    others = {
        s: sum(comparison.returned_within(i.name, s, MAIN_TAU) for i in comparison.comparable)
        for s in comparison.solvers
        if s not in everywhere
    }
    if others:
        counts = ", ".join(f"{solver} {met}" for solver, met in others.items())
        text += f" The others did so from fewer of the {count}: {counts}."
    return text


def _cheapest(comparison: Comparison, sound: tuple[str, ...]) -> list[str]:
    """Which solver that always met the target needed the least effort, and how sure that is."""
    known = comparison.all_counted(MAIN_TAU)
    ranked = {s: comparison.effort(s, MAIN_TAU).value for s in sound if s in known}
    if len(ranked) < 2:
        return []
    pairs = by_effort(comparison)
    test = f"sign test over {counted(len(comparison.compared), 'problem')}: p"
    level = f"corrected for all pairs; level {LEVEL:.0%}"
    for solver in ranked:
        others = tuple(s for s in ranked if s != solver)
        if all(pairs[solver, s].won for s in others):
            worst = max(pairs[solver, s].corrected for s in others)
            return [
                f"Of these, take {solver}: it needed less effort than {joined(others)} on more "
                f"problems than chance would explain ({test} = {worst:.2g}"
                f"{' or less' if len(others) > 1 else ''}, {level}). "
                f"Its median effort is {_worth(ranked[solver])}."
            ]
    least = min(ranked.values())
    first = tuple(s for s, effort in ranked.items() if effort == least)
    if len(first) > 1:
        return [f"Of these, {joined(first)} have the least median effort, {_worth(least)}."]
    unbeaten = tuple(s for s in ranked if s != first[0] and not pairs[first[0], s].decided)
    text = f"Of these, {first[0]} has the least median effort, {_worth(least)}"
    if unbeaten:
        smallest = min(pairs[first[0], s].corrected for s in unbeaten)
        p = "= 1" if smallest >= 1 else f"= {smallest:.2g} or more"
        text += f", but its lead over {joined(unbeaten)} may be chance ({test} {p}, {level})"
    if len(comparison.compared) < FEWEST:
        text += f". With fewer than {FEWEST} problems no pair can pass this test"
    return [f"{text}."]


def _worth(effort: float) -> str:
    return f"{effort:.4g} evaluations of the residual at the published prices"


def _uncounted(comparison: Comparison) -> list[str]:
    """The solvers of which not all evaluations were counted."""
    sentences = []
    for solver in comparison.solvers:
        runs = [i.name for i in comparison.instances if comparison.uncounted(i.name, solver)]
        if runs:
            sentences.append(
                f"{solver}: not everything was counted in {len(runs)} of "
                f"{len(comparison.instances)} runs, so its effort is unknown, and it is left out "
                "of all statements on effort. It evaluated a graph or the residuals in its own "
                "code (as nlpsol does), or returned a point that it never evaluated."
            )
    return sentences


def _clock(comparison: Comparison) -> list[str]:
    """A sentence if the clock ended any run."""
    late = sum(ended_by_clock(r) for r in comparison.records.values())
    if not late:
        return []
    return [
        f"{late} of {len(comparison.records)} runs were ended by the clock: on a faster or less "
        "busy machine they may get further, and all of these results may change."
    ]


def prices_sentence() -> str:
    """At which prices effort is counted."""
    priced = ", ".join(f"{PRICES[k].name} {PRICES[k].formula}" for k in KINDS[: LIMITED_KINDS + 1])
    return (
        "Effort is the number of evaluations until the target is met, each kind times a fixed "
        f"price in units of one evaluation of the residual: {priced}, for n free numbers "
        f"(a gradient as {PRICES_SOURCE}, bound it, a Jacobian as differences would give it, "
        "constraints by convention). It does not depend on any clock."
    )


def basin_sentence(comparison: Comparison, problem: str) -> str:
    """How many basins the ends of a problem fall into, and how many runs ended in the lowest."""
    analyses = {i.name: comparison.end_analysis(i.name) for i in comparison.instances_of(problem)}
    basins = [b for (i, _), b in comparison.basins.items() if i in analyses]
    several = max((len(analysis.costs) for analysis in analyses.values()), default=0)
    if not basins:
        return f"{problem}: no run ended at a point of finite cost."
    if len(basins) == 1:
        return f"{problem}: only one run ended, so that no other basin is known."
    per_start = len({id(analysis) for analysis in analyses.values()}) > 1  # data for each start
    if several == 1:
        each = "on each data set " if per_start else ""
        return f"{problem}: {each}all {len(basins)} ends lead to one basin."
    return (
        f"{problem}: the ends lead to {'up to ' if per_start else ''}{several} basins; "
        f"{basins.count(0)} of {len(basins)} ends lead to the lowest."
    )
