"""POSTERIOR.md: the tables, and what they say, written from the numbers that there are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.page import machine
from benchmarks.posterior import known_tables
from benchmarks.posterior.nuts import ALLOWED_MEAN, ALLOWED_SD, TIMES, USUAL, NutsSettings

Found = dict[str, Any]
BUSY = 2.0  # processes for each core
HEAD = """# Posteriors, measured

Written by `python -m benchmarks.posterior PART` from the numbers in `results/`; `--help` lists the
parts. Unless a section says otherwise, the problem is `workbench run balance-monocular`: one
recorded person who balances on a beam, seen by one camera. It has 85 unknowns, 23 keypoints with a
sigma of 4 px, and Gaussian priors on pose and shape.
"""


def text(results: Mapping[str, Found]) -> str:
    """The whole page."""
    writers = {
        "nuts": _nuts,
        "throughput": _throughput,
        "known": known_tables.known,
        "coverage": known_tables.coverage,
    }
    parts = [HEAD]
    for name, write in writers.items():
        if name in results:
            parts.append(write(results[name]["found"], results))
            parts.append(_where(results[name]["machine"]))
    return "\n".join(parts)


def _where(facts: Found) -> str:
    said = "/".join(f"{one:.1f}" for one in facts["load"][:1] + facts["load after"][:1])
    return f"*Measured on {machine(facts)}; load before/after {said}.*\n"


def _nuts(found: Found, _: Mapping[str, Found]) -> str:
    lines = [
        "## emcee compared with NUTS\n",
        "A block is sampled with all entries outside of it fixed at the solution of the fit. "
        f"NUTS aims at an acceptance rate of {NutsSettings().accepted:.0%}. Successive draws of "
        "NUTS can be negatively correlated; their effective number is then larger than their "
        "number.\n",
        "| block | entries | emcee: steps / autocorrelation time | emcee, s | NUTS: R-hat | "
        "NUTS: divergences | NUTS: effective draws | NUTS, s | emcee's sd / NUTS's sd | "
        "difference of means / sd | sd / Laplace's sd | width at the mode / width at the "
        "narrowest 1% of the draws | |",
        "| --- |" + " --: |" * 11 + " --- |",
    ]
    for name, one in found["blocks"].items():
        ours, theirs = one["emcee"], one["nuts"]
        said = "agree" if one["agree"] else "DIFFER"
        if not one["reference"]:
            said += " (NUTS itself has not converged)"
        lines.append(
            f"| {name} | {len(one['entries'])} | {ours['times']:.0f} | {ours['seconds']:.0f} | "
            f"{theirs['R-hat']:.3f} | {theirs['divergences']} | {theirs['effective']:,.0f} of "
            f"{theirs['draws']:,} | {theirs['seconds']:.0f} | {_span(one['sd ratio'])} | "
            f"{max(one['mean apart']):.3f} | {_span(one[OVER])} | {one['bent']:.1f} | {said} |"
        )
    arms = [one for name, one in found["blocks"].items() if "arm" in name]
    lines.append(
        f"\nThe two samplers agree if standard deviations differ by at most {ALLOWED_SD:.0%} and "
        f"means by at most {ALLOWED_MEAN} standard deviations, after "
        f"{TIMES:.0f} autocorrelation times or more.\n"
    )
    if arms:
        most = max(one["bent"] for one in arms)
        lines.append(
            "The arms are the hardest blocks. They have a single mode, but around it the posterior "
            "is a bent ridge. One draw in a hundred lies where the ridge is at least "
            f"{most:.1f} times narrower than at the mode, so that NUTS needs small steps. "
            f"{_usual(found['usual steps'])}The standard deviations of Laplace's "
            "approximation of the arms are off by up to "
            f"{max(abs(np.array(one[OVER]) - 1).max() for one in arms):.0%}.\n"
        )
    return "\n".join(lines)


def _usual(found: Found) -> str:
    return "".join(
        f"With nutpie's default, an acceptance rate of {USUAL.accepted:.0%}, the {name} has R-hat "
        f"{one['nuts']['R-hat']:.2f}, {one['nuts']['divergences']} divergences and "
        f"{one['nuts']['effective']:.0f} effective draws in {one['nuts']['draws']:,}, and its "
        f"standard deviations are {abs(1 / np.array(one['sd ratio']) - 1).max():.0%} off. "
        for name, one in found.items()
    )


OVER = "sd over Laplace's"


def _throughput(found: Found, results: Mapping[str, Found]) -> str:
    lines = [
        "## Posterior densities per second\n",
        "The table says how many values of the density emcee computes per second of processor time "
        f"on one core, with {found['walkers']} walkers and all 85 entries free. The time "
        "of emcee's own moves and loops is included. Each number is the best of four rounds. "
        "`emcee alone` is "
        "the rate with a density that takes no time, and `share` is a rate divided by that one.\n",
        "| posterior | emcee alone | without a compiler | share | compiled | share |",
        "| --- |" + " --: |" * 5,
    ]
    for name, one in found["posteriors"].items():
        rates = one["a second"]
        ceiling = rates["emcee alone"]
        cells = [
            f"{rates[way]:,.0f} | {rates[way] / ceiling:.1%}" for way in ("interpreted", "compiled")
        ]
        lines.append(f"| {name} | {ceiling:,.0f} | {' | '.join(cells)} |")
    lines.append(
        "\nMeshes are computed by matrix products in both columns, because their residual is too "
        "long to compile.\n"
    )
    facts = results["throughput"]["machine"]
    if max(facts["load"][0], facts["load after"][0]) > BUSY * facts["cores"]:
        lines.append(
            "Other work ran on the machine meanwhile. Shares are of one run and hold; rates of "
            "processor time suffer a little.\n"
        )
    return "\n".join(lines)


def _span(numbers: Sequence[float]) -> str:
    return f"{min(numbers):.2f} to {max(numbers):.2f}"
