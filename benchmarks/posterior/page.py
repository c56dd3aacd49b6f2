"""POSTERIOR.md: the tables, and what they say, written from the numbers that there are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from benchmarks.page import machine
from benchmarks.posterior.held_out import LEVEL, NUTS, WALKERS
from benchmarks.posterior.nuts import ALLOWED_MEAN, ALLOWED_SD, TIMES

Array = NDArray[np.float64]
Found = Mapping[str, Any]
UNLIKELY = 1e-3  # over all entries together
HEAD = """# Posteriors, measured

Written by `python -m benchmarks.posterior PART` from the numbers in `results/`; `--help` names the
parts. All of it is about one person on a beam (`workbench run balance-monocular`): 85 unknowns, 23
keypoints in one camera, sigma 4 px, a Gaussian prior on pose and on shape.
"""


def text(results: Mapping[str, Found]) -> str:
    """The whole page."""
    writers = {
        "nuts": _nuts, "recorded": _recorded, "widened": _widened, "simulated": _simulated,
        "one-person": _one_person, "throughput": _throughput,
    }  # fmt: skip
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
        "## Beside NUTS\n",
        "| block | entries | emcee: steps / autocorrelation time | emcee, s | NUTS: R-hat | "
        "divergences | effective draws | NUTS, s | emcee's sd over NUTS' | means apart, sd | "
        "sd over Laplace's | narrower than at the mode | |",
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
            f"{max(one['mean apart']):.3f} | {_span(one[OVER])} | {one['bent']:.1f} × | {said} |"
        )
    arms = [one for name, one in found["blocks"].items() if "arm" in name]
    lines.append(
        f"\nAsked: standard deviations within {ALLOWED_SD:.0%}, means within {ALLOWED_MEAN} of "
        f"one, {TIMES:.0f} autocorrelation times. All other entries stay at the answer of the fit."
    )
    if arms:
        most = max(one["bent"] for one in arms)
        lines.append(
            "The arms are the hard ones. Least squares finds one mode with all of the mass; but "
            f"the ridge is bent, and in its narrowest hundredth {most:.0f} times narrower than at "
            f"the mode, which wants small steps of NUTS. {_usual(found['usual steps'])}Laplace's "
            "approximation of the arms is off by up to "
            f"{max(abs(np.array(one[OVER]) - 1).max() for one in arms):.0%}.\n"
        )
    return "\n".join(lines)


def _usual(found: Found) -> str:
    return "".join(
        f"With nutpie's usual ones (an acceptance of 0.8) the {name} has R-hat "
        f"{one['nuts']['R-hat']:.2f}, {one['nuts']['divergences']} divergences in "
        f"{one['nuts']['draws']:,} draws, {one['nuts']['effective']:.0f} effective ones, and its "
        f"standard deviations are {abs(1 / np.array(one['sd ratio']) - 1).max():.0%} off. "
        for name, one in found.items()
    )


OVER = "sd over Laplace's"


def _recorded(found: Found, results: Mapping[str, Found]) -> str:
    ways = {"emcee": "emcee, rest at the truth", "Laplace": "Laplace, all free"}
    stays = ", ".join(f"{s:.0%}" for s in found["share of each camera's residuals that stays"])
    rms = ", ".join(f"{s:.1f}" for s in found["rms of each camera"])
    lines = [
        "## A truth that was held out\n",
        f"{len(found['cases'])} frames; the {LEVEL:.0%} interval from one camera, and whether it "
        "holds what four cameras estimate. `emcee`: orientation, betas and place (16 entries, "
        f"{WALKERS} walkers), the other 69 at the four cameras' estimate, so that the interval is "
        "exact if the model is. `Laplace`: the approximation to all 85. The mean and the standard "
        "deviation over frames of (truth - mean) / sd are those of Laplace's intervals: 0 and 1 "
        "for independent frames of a right model.\n",
        _coverage(found, ways, beside=True),
        _also_nuts(found),
        _unusable(found),
        f"\nWhat four cameras leave of their keypoints has {rms} px (camera by camera, root mean "
        f"square), which is ordinary at a sigma of {found['sigma of the residuals']:.1f} px rather "
        f"than {found['sigma']:g}; {stays} of its square stays the same from frame to frame in "
        "each keypoint: the detector's and the body's keypoints are not the same places, which no "
        "independent noise describes.\n",
    ]
    return "\n".join(lines)


def _widened(found: Found, _: Mapping[str, Found]) -> str:
    ways = {"emcee": "emcee, rest at the truth", "Laplace": "Laplace, all free"}
    return "\n".join(
        [
            f"### The same with sigma as the residuals have it ({found['sigma']:.1f} px)\n",
            f"{len(found['cases'])} frames.\n",
            _coverage(found, ways, beside=True),
            _unusable(found),
            "",
        ]
    )


def _simulated(found: Found, _: Mapping[str, Found]) -> str:
    ways = {"emcee": "emcee, rest at the truth", "Laplace": "Laplace, all free"}
    count = len(found["cases"])
    low, high = band(count, len(found["labels"]))
    inside = all(low <= n <= high for n in held(found, "emcee"))
    return "\n".join(
        [
            "### Simulated\n",
            f"{count} made-up truths: shape and pose from their priors, orientation and place from "
            "Gaussians of 0.3 rad and 0.3 m that the posterior is given as well, keypoints with "
            "noise of the very sigma and the recording's confidences.\n",
            _coverage(found, ways, beside=True),
            _also_nuts(found),
            _unusable(found),
            f"\nAll 16 entries together lie with a chance of {1 - UNLIKELY:.1%} between {low} and "
            f"{high} of {count}. emcee's " + ("do." if inside else "DO NOT."),
            "",
        ]
    )


def _one_person(found: Found, results: Mapping[str, Found]) -> str:
    rates, spread = np.array(found["rates"]), np.array(found["sd"])
    shape = [i for i, label in enumerate(found["labels"]) if label.startswith("betas")]
    least = rates[:, shape].min(axis=1)
    lines = [
        "### One person in all frames\n",
        f"{len(rates)} made-up people, each in {found['frames']} frames of the recording's poses, "
        "with betas of its own and noise of the very sigma. The model is right; Laplace's "
        f"intervals cover {rates.mean():.1%} of all 16 entries. But of one person's ten betas the "
        "worst is covered in "
        + ", ".join(f"{r:.0%}" for r in np.sort(least))
        + f" of the frames, for the error is nearly the same in all of them: it varies by "
        f"{np.median(spread[:, shape]):.2f} of a standard deviation within a person, where "
        "independent frames would vary by 1.",
    ]
    if "recorded" in results:
        lines.append(_explained(results["recorded"]["found"], found, shape))
    return "\n".join([*lines, ""])


def _explained(recorded: Found, people: Found, shape: Sequence[int]) -> str:
    z = scores(recorded, "Laplace")
    within = np.median(z[:, shape].std(axis=0))
    covered = held(recorded, "Laplace") / len(z)
    worst = min(shape, key=lambda i: covered[i])
    every = np.array(people["rates"])[:, shape].min(axis=1)
    as_bad = np.mean(every <= covered[worst])
    return (
        f"\nThe recorded person does the same: its betas' errors vary by {within:.2f}. Its worst, "
        f"{recorded['labels'][worst]}, is covered in {covered[worst]:.0%} of the frames, and "
        f"{as_bad:.0%} of the made-up people have one that is covered as rarely. Forty frames of "
        "one person are about one test of each beta, not forty."
    )


def _throughput(found: Found, _: Mapping[str, Found]) -> str:
    lines = [
        "## Posteriors a second\n",
        f"One core, {found['walkers']} walkers, all 85 entries free, inside of emcee with its own "
        "moves and loops; the share is of emcee alone with nothing to compute.\n",
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
    alone = found["not batched"]
    said = ", ".join(f"{rate:,.0f} on {use}" for use, rate in alone["costs a second"].items())
    lines += [
        "\nMeshes come from matrix products either way; their residual is too long to compile.",
        f"\nA cost that cannot be batched (a made-up pendulum, integrated by CVODES): {said} a "
        "second; the numbers are "
        + ("the same to the last bit." if alone["same bits"] else "NOT THE SAME.")
        + " Threads share the rows, not processes: CasADi lets others run while it works, and a "
        "problem's symbols would have to be built anew in each process. They are used only where "
        "the clock finds them faster.\n",
    ]
    return "\n".join(lines)


def _coverage(found: Found, ways: Mapping[str, str], beside: bool) -> str:
    count = len(found["cases"])
    heads = [f"{said}, covered" for said in ways.values()]
    z = scores(found, "Laplace")
    lines = [
        f"| entry | {' | '.join(heads)} | mean | sd |",
        "| --- |" + " --: |" * (len(ways) + 2),
    ]
    rates = {way: held(found, way) / number(found, way) for way in ways}
    for i, label in enumerate(found["labels"]):
        cells = [f"{rates[way][i]:.0%}" for way in ways]
        lines.append(
            f"| {label} | {' | '.join(cells)} | {z[:, i].mean():+.2f} | {z[:, i].std():.2f} |"
        )
    cells = [f"**{rates[way].mean():.1%}**" for way in ways]
    lines.append(f"| all, of {count} x {len(found['labels'])} | {' | '.join(cells)} | | |")
    return "\n".join(lines)


def _also_nuts(found: Found) -> str:
    some = [case for case in found["cases"] if "NUTS" in case]
    if not some:
        return ""
    good = [case for case in some if case["NUTS"]["usable"]]
    part = dict(found) | {"cases": some}
    rates = {way: held(part, way, all_of=True).sum() / (16 * len(some))
             for way in ("NUTS", "Laplace")}  # fmt: skip
    return (
        f"\nDraws of all 85 by NUTS ({NUTS.draws} of each of four chains) in {len(some)} of these: "
        f"{rates['NUTS']:.1%} covered, Laplace in the same {rates['Laplace']:.1%}. Only "
        f"{len(good)} of the {len(some)} runs have R-hat at most 1.05: 85 entries with priors "
        "alone on most are hard for NUTS as well."
    )


def _unusable(found: Found) -> str:
    bad = [case["case"] for case in found["cases"] if not case["emcee"]["usable"]]
    if not bad:
        return "\nEvery run of emcee's is usable."
    return f"\nNot usable by emcee, and not counted: {', '.join(bad)}."


def held(found: Found, way: str, all_of: bool = False) -> Array:
    """In how many cases each entry is covered (16,), of those that are usable."""
    rows = [
        (np.array(case[way]["ends"][0]) < case["truth"])
        & (case["truth"] < np.array(case[way]["ends"][1]))
        for case in found["cases"]
        if all_of or case[way]["usable"]
    ]
    return np.sum(rows, axis=0)


def number(found: Found, way: str) -> int:
    """Of cases that are usable."""
    return sum(case[way]["usable"] for case in found["cases"])


def scores(found: Found, way: str) -> Array:
    """(truth - mean) / sd, (cases, 16)."""
    return np.array(
        [
            (np.array(case["truth"]) - case[way]["mean"]) / np.array(case[way]["sd"])
            for case in found["cases"]
        ]
    )


def band(count: int, entries: int) -> tuple[int, int]:
    """Between which counts all entries lie together, but for a chance of one in a thousand."""
    tail = UNLIKELY / entries / 2
    low, high = scipy.stats.binom(count, LEVEL).ppf([tail, 1 - tail])
    return int(low), int(high)


def _span(numbers: Sequence[float]) -> str:
    return f"{min(numbers):.2f} to {max(numbers):.2f}"
