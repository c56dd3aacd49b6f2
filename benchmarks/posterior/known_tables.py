"""The section of POSTERIOR.md on posteriors whose marginals are known."""

from collections.abc import Mapping
from typing import Any

from scipy.stats import beta

from benchmarks.posterior.known import DENSITIES, OFF, counted

Found = dict[str, Any]
SEEDS = 20  # of each density, where a benchmark is whole
LARGE = ("2 of 50 named", "bent rest", "Student, 2 of 40 named")


def known(found: Found, _: Mapping[str, Found]) -> str:
    """How often a verdict is right."""
    lines = [
        "## Verdicts on posteriors whose marginals are known\n",
        f"An interval of 90% is wrong if its width is off by more than {OFF:.0%}, or one of its "
        "ends by more than that share of the width. A run is right if no interval is wrong. "
        "Thresholds of mixing are those that the workbench had before these densities were made "
        "up. Above "
        f"21 unknowns, what is not named is drawn by Hamiltonian Monte Carlo: {', '.join(LARGE)}, "
        "and `funnel, width named`. It was developed on single runs of these four, and its steps "
        "were shortened for `bent rest` on seeds 1000 to 1004; none of these seeds is reported.\n",
        "| density | runs | right | called usable | usable, but wrong | refused, but right |",
        "| --- |" + " --: |" * 5,
    ]
    counts = {name: counted(runs) for name, runs in found["densities"].items() if runs}
    for name, one in counts.items():
        cells = " | ".join(str(one[key]) for key in ("runs", "right", "usable", "wrong", "refused"))
        lines.append(f"| {name} | {cells} |")
    total = {key: sum(one[key] for one in counts.values()) for key in next(iter(counts.values()))}
    lines.append(
        f"\nOf {total['usable']} runs called usable, {total['wrong']} are wrong "
        f"({interval(total['wrong'], total['usable'])}); of {total['right']} runs that are right, "
        f"{total['refused']} are refused ({interval(total['refused'], total['right'])}).\n"
    )
    if total["runs"] < SEEDS * len(counts):
        lines.append(
            f"Every density was to be run with {SEEDS} seeds; {total['runs']} of "
            f"{SEEDS * len(counts)} runs were reached on a busy machine.\n"
        )
    refused = [name for name, one in counts.items() if one["refused"]]
    if refused:
        said = ", ".join(refused)
        lines.append(
            f"The runs that are refused although they are right are of: {said}. Their chains stay "
            "for long where the density is narrow, so that their autocorrelation time has not "
            f"settled within the {_steps(refused)} steps that they have here (the default is "
            "20,000).\n"
        )
    return "\n".join(lines)


def coverage(found: Found, _: Mapping[str, Found]) -> str:
    """How often intervals hold a truth that was drawn from the prior."""
    lines = [
        "## Coverage of truths that are drawn from priors\n",
        "All data are synthetic: a truth is drawn from the prior, data are made of it, the problem "
        "is solved from the middle of the prior, and Laplace's intervals of 90% are counted if "
        "they are called usable. Right intervals cover all entries of a problem in so many cases "
        "as the band says, but for a chance of one in a thousand. `failed` are fits that ended "
        "with an error.\n",
        "| problem | entries | fits | usable | failed | covered, least | covered, most | band | "
        "of all entries |",
        "| --- |" + " --: |" * 8,
    ]
    for name, one in found.items():
        hits, (low, high) = one["covered"], one["band"]
        all_of = sum(hits) / max(1, one["usable"] * len(hits))
        lines.append(
            f"| {name} | {len(hits)} | {one['fits']} | {one['usable']} | {one['failed']} | "
            f"{min(hits)} | {max(hits)} | {low} to {high} | {all_of:.1%} |"
        )
    outside = [
        f"{label} ({name})"
        for name, one in found.items()
        for label, hit in zip(one["labels"], one["covered"], strict=True)
        if not one["band"][0] <= hit <= one["band"][1]
    ]
    lines.append(
        f"\nOutside of their bands are: {', '.join(outside)}.\n"
        if outside
        else "\nEvery entry is within its band.\n"
    )
    return "\n".join(lines)


def _steps(names: list[str]) -> str:
    return " or ".join(f"{steps:,}" for steps in sorted({DENSITIES[n]().steps for n in names}))


def interval(count: int, of: int) -> str:
    """A share with its 95 % interval (Clopper and Pearson)."""
    if not of:
        return "none"
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count / of:.1%}, 95% interval {low:.1%} to {high:.1%}"
