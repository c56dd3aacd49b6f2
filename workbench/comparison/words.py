"""What a comparison says, in sentences; each of them is a statement about its numbers."""

import math

from workbench.comparison.comparison import MAIN, Comparison
from workbench.comparison.statistics import Interval
from workbench.comparison.targets import Verdict, named


def percent(interval: Interval) -> str:
    """`90% (60–98)`."""
    return f"{interval.value:.0%} ({100 * interval.low:.0f}–{100 * interval.high:.0f})"


def surest(comparison: Comparison, tau: float = MAIN) -> tuple[str, ...]:
    """The solvers that met the target most often; several if they did so equally often."""
    share = {s: comparison.success(s, tau).value for s in comparison.solvers}
    most = max(share.values(), default=0.0)
    return tuple(s for s in share if share[s] == most) if most > 0 else ()


def as_sure(comparison: Comparison, tau: float = MAIN) -> tuple[str, ...]:
    """Those that cannot be told from the surest: of the starts from which only one of the two met
    the target, its share may be one half by chance. Whoever never met it is not among them.
    """
    first = surest(comparison, tau)
    return tuple(
        s
        for s in comparison.solvers
        if first and comparison.success(s, tau).value > 0
        if s in first or not comparison.surer(first[0], s, tau).decided
    )


def advice(comparison: Comparison, tau: float = MAIN) -> tuple[str, ...]:
    """Which solver to take when, and why; nothing where the runs do not tell."""
    starts, solvers = len(comparison.instances), comparison.solvers
    said = []
    first = surest(comparison, tau)
    if not first:
        return (f"No solver met the target τ = {named(tau)} from any of the {starts} starts.",)
    rate = comparison.success(first[0], tau)
    who, alone = _and(first), len(solvers) == 1
    said.append(
        f"{who} met the target τ = {named(tau)} from {rate.value * starts:.0f} of {starts} starts"
        + (" each." if len(first) > 1 else "." if alone else ", more often than any other.")
    )
    alike = as_sure(comparison, tau)
    if len(alike) > len(first):
        others = _and(tuple(s for s in alike if s not in first))
        said.append(
            f"From so few starts {others} cannot be told from that: too few were met by only one "
            "of a pair."
        )
    said += _quickest(comparison, alike, tau)
    said += _lost(comparison)
    return tuple(said)


def _quickest(comparison: Comparison, among: tuple[str, ...], tau: float) -> list[str]:
    """Among those who are as sure: who beats every other one in pairs."""
    if len(among) < 2:
        return []
    for one in among:
        others = [s for s in among if s != one]
        duels = {s: comparison.duel(one, s, tau) for s in others}
        if all(d.share.low > 0.5 for d in duels.values()):
            return [
                f"Among these take {one} when effort counts: in pairs from the same starts it "
                f"was ahead of each of {_and(tuple(others))} beyond chance (it needed less, or met "
                "the target alone)."
            ]
    median = {s: comparison.effort(s, tau).value for s in among}
    least = min(median, key=lambda s: median[s])
    if median[least] == math.inf:
        return ["None of these met it from more than half of the starts, so none is the quickest."]
    unbeaten = [s for s in among if s != least and not comparison.duel(least, s, tau).decided]
    if not unbeaten:
        return []
    return [
        f"Among these {least} has the least median effort ({median[least]:.3g} residuals' worth), "
        f"but in pairs from the same starts it is not ahead of {_and(tuple(unbeaten))} beyond "
        "chance: more starts would be needed to tell."
    ]


def _lost(comparison: Comparison) -> list[str]:
    """Who is lured into other basins, who is wrong about itself, and who fails."""
    said = []
    for solver in comparison.solvers:
        counts = comparison.counted(solver)
        runs = counts.total()
        wrong = counts[Verdict.FALSE_CLAIM]
        if wrong:
            said.append(
                f"{solver} claims convergence where the cost still slopes, in {wrong} of {runs} "
                "runs: do not believe its status."
            )
        elsewhere = counts[Verdict.OTHER_BASIN]
        if elsewhere and elsewhere >= runs / 2:
            said.append(
                f"{solver} ends in a basin that costs more in {elsewhere} of {runs} runs: start it "
                "from several points."
            )
    return said


def _and(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def basin_sentence(comparison: Comparison, problem: str) -> str:
    """How many basins the ends of a problem fall into, and how many runs ended in the lowest."""
    chosen = [i.name for i in comparison.of(problem)]
    found = {n: comparison.judgement(n) for n in chosen}
    several = max((len(j.costs) for j in found.values()), default=0)
    counted = [b for (i, _), b in comparison.basins.items() if i in found]
    lowest = sum(1 for b in counted if b == 0)
    if not counted:
        return f"{problem}: no run ended at a point of finite cost."
    if several == 1:
        return f"{problem}: all {len(counted)} ends lead to one basin."
    per = "" if len({id(j) for j in found.values()}) == 1 else "up to "
    return (
        f"{problem}: the ends lead to {per}{several} basins; {lowest} of {len(counted)} ends lead "
        "to the lowest."
    )
