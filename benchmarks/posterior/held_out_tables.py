"""Tables of intervals beside truths, and what they say."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.posterior.counted import UNLIKELY, Found, band, held, number, scores
from benchmarks.posterior.held_out import LEVEL, NUTS, WALKERS

Results = Mapping[str, Found]
COVERED = {"emcee": "emcee, rest at the truth", "Laplace": "Laplace, all free"}


def recorded(found: Found, _: Results) -> str:
    """Frames of the recording, and how the table is to be read."""
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
        _coverage(found),
        _also_nuts(found),
        _unusable(found),
        f"\nWhat four cameras leave of their keypoints has {rms} px (camera by camera, root mean "
        f"square), which is ordinary at a sigma of {found['sigma of the residuals']:.1f} px rather "
        f"than {found['sigma']:g}; {stays} of its square stays the same from frame to frame in "
        "each keypoint: the detector's and the body's keypoints are not the same places, which no "
        "independent noise describes.\n",
        _reading(found),
    ]
    return "\n".join(lines)


def _reading(found: Found) -> str:
    """What is too low and too high in the table, and why."""
    z, count = scores(found, "Laplace"), len(found["cases"])
    rate, four = held(found, "Laplace") / count, np.array(found["sd of four cameras"])
    sd = np.mean([case["Laplace"]["sd"] for case in found["cases"]], axis=0)
    names = found["labels"]
    open_still = [names[i] for i in range(len(names)) if four[i] > OPEN * sd[i]]
    low = ", ".join(f"{names[i]} {rate[i]:.0%}" for i in np.argsort(rate) if rate[i] < FEW)
    return (
        f"All entries together are covered as often as they should be, single ones are not: {low} "
        "by Laplace, most others 100 %. Forty frames are not forty tests: over them (truth - mean) "
        f"/ sd varies by {np.median(z.std(axis=0)):.2f} (median of the entries) where independent "
        "frames vary by 1, so that an entry is covered nearly always or hardly ever; see `One "
        "person in all frames` below. And the truth is an estimate: four cameras know "
        f"{', '.join(open_still)} hardly better than one (sd above {OPEN} of it), where both are "
        "near the prior's mean and 100 % says little.\n"
    )


OPEN, FEW = 0.75, 0.75  # of one camera's sd; of the frames


def widened(found: Found, _: Results) -> str:
    """The same with another sigma."""
    return "\n".join(
        [
            f"### The same with sigma as the residuals have it ({found['sigma']:.1f} px)\n",
            f"{len(found['cases'])} frames.\n",
            _coverage(found),
            _unusable(found),
            "",
        ]
    )


def simulated(found: Found, _: Results) -> str:
    """Made-up truths, and whether they are covered as they must be."""
    count = len(found["cases"])
    low, high = band(count, len(found["labels"]))
    inside = all(low <= n <= high for n in held(found, "emcee"))
    return "\n".join(
        [
            "### Simulated\n",
            f"{count} made-up truths: shape and pose from their priors, orientation and place from "
            "Gaussians of 0.3 rad and 0.3 m that the posterior is given as well, keypoints with "
            "noise of the very sigma and the recording's confidences.\n",
            _coverage(found),
            _also_nuts(found),
            _unusable(found),
            f"\nAll 16 entries together lie with a chance of {1 - UNLIKELY:.1%} between {low} and "
            f"{high} of {count}. emcee's " + ("do." if inside else "DO NOT."),
            "",
        ]
    )


def one_person(found: Found, results: Results) -> str:
    """One made-up person in all frames, and what that says of the recorded one."""
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
        lines.append(_left_over(results, found, shape))
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


def _left_over(results: Results, people: Found, shape: Sequence[int]) -> str:
    """The worst entry that is no shape, in all tables: what of it is whose."""
    recorded = results["recorded"]["found"]
    covered = held(recorded, "Laplace")
    i = min((i for i in range(len(covered)) if i not in shape), key=lambda i: covered[i])

    def rate(part: str, way: str) -> str:
        found = results[part]["found"]
        return f"{held(found, way)[i] / number(found, way):.0%}"

    said = [
        f"recorded: {rate('recorded', 'Laplace')} by Laplace, {rate('recorded', 'emcee')} by emcee "
        "with the rest at the truth",
        f"made-up people in the recorded poses: {np.mean(people['rates'], axis=0)[i]:.0%} by "
        "Laplace",
    ]
    if "simulated" in results:
        said.append(
            f"made-up people and poses: {rate('simulated', 'Laplace')} by Laplace, "
            f"{rate('simulated', 'emcee')} by emcee"
        )
    if "widened" in results:
        said.append(
            f"recorded, with sigma as the residuals have it: {rate('widened', 'Laplace')} by "
            f"Laplace, {rate('widened', 'emcee')} by emcee"
        )
    return (
        f"\n{people['labels'][i]} is the lowest of the others. {'; '.join(said)}. With the rest at "
        "the truth it is the sigma that makes the difference. With all free it is not: some is "
        "missing where everything is made up (Laplace's doing), more where the poses are the "
        "recorded ones, all alike and none of the prior's, and the rest is what made-up keypoints "
        "do not have: being off in the same direction in all frames, which no sigma describes."
    )


def _coverage(found: Found) -> str:
    count = len(found["cases"])
    heads = [f"{said}, covered" for said in COVERED.values()]
    z = scores(found, "Laplace")
    four = found.get("sd of four cameras")
    sd = np.mean([case["Laplace"]["sd"] for case in found["cases"]], axis=0)
    lines = [
        f"| entry | {' | '.join(heads)} | mean | sd |" + (" sd of four over one |" if four else ""),
        "| --- |" + " --: |" * (len(COVERED) + 2 + bool(four)),
    ]
    rates = {way: held(found, way) / number(found, way) for way in COVERED}
    for i, label in enumerate(found["labels"]):
        cells = [f"{rates[way][i]:.0%}" for way in COVERED]
        lines.append(
            f"| {label} | {' | '.join(cells)} | {z[:, i].mean():+.2f} | {z[:, i].std():.2f} |"
            + (f" {four[i] / sd[i]:.2f} |" if four else "")
        )
    cells = [f"**{rates[way].mean():.1%}**" for way in COVERED]
    lines.append(
        f"| all, of {count} x {len(found['labels'])} | {' | '.join(cells)} | | |"
        + " |" * bool(four)
    )
    return "\n".join(lines)


def _also_nuts(found: Found) -> str:
    some = [case for case in found["cases"] if "NUTS" in case]
    if not some:
        return ""
    good = [case for case in some if case["NUTS"]["usable"]]
    part = dict(found) | {"cases": some}
    rates = {
        way: held(part, way, all_of=True).sum() / (16 * len(some)) for way in ("NUTS", "Laplace")
    }
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
