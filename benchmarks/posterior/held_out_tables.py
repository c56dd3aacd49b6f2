"""Tables of intervals beside truths, and what they say."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.posterior.counted import UNLIKELY, Found, band, held, number, scores
from benchmarks.posterior.held_out import LEVEL, NUTS, WALKERS

Results = Mapping[str, Found]
COVERED = {
    "emcee": "covered by emcee, others fixed at the truth",
    "Laplace": "covered by Laplace, all free",
}


def recorded(found: Found, _: Results) -> str:
    """Frames of the recording, and how the table is to be read."""
    stays = ", ".join(f"{s:.0%}" for s in found["share of each camera's residuals that stays"])
    rms = ", ".join(f"{s:.1f}" for s in found["rms of each camera"])
    lines = [
        "## Coverage of held-out truths\n",
        f"{len(found['cases'])} frames. The table says how often the {LEVEL:.0%} interval from "
        "one camera contains the estimate from four cameras, which is taken as the truth. "
        f"`emcee`: orientation, betas and trans (16 entries, {WALKERS} walkers) are sampled, and "
        "the other 69 are fixed at the four cameras' estimate. If the model is correct, these "
        f"intervals contain the truth in {LEVEL:.0%} of the cases. `Laplace`: Laplace's "
        "approximation with all 85 unknowns free. The columns `mean` and `sd` are the mean and the "
        "standard deviation, over the frames, of (truth - Laplace's mean) / Laplace's sd; they are "
        "0 and 1 for independent frames of a correct model. The last column divides the standard "
        "deviation from four cameras by that from one.\n",
        _coverage(found),
        _also_nuts(found),
        _unusable(found),
        f"\nThe residuals of the fit to four cameras are {rms} px (root mean square of each "
        f"camera), which suits a sigma of {found['sigma of the residuals']:.1f} px rather than "
        f"{found['sigma']:g}. Of their sum of squares, {stays} (camera by camera) come from a "
        "displacement of each keypoint that is the same in all frames: the "
        "detector's and the body's keypoints are not at the same places, and "
        "independent noise does not describe that.\n",
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
    low = ", ".join(f"{names[i]} in {rate[i]:.0%}" for i in np.argsort(rate) if rate[i] < FEW)
    return (
        "All entries together are covered as often as they should be, but single ones are not: "
        f"Laplace's intervals cover {low}, and most others in 100 % of the frames. Forty frames "
        "are not forty independent tests: over the frames, (truth - mean) / sd has a standard "
        "deviation of "
        f"{np.median(z.std(axis=0)):.2f} (median of the entries), and would have 1 if they were "
        "independent, so that an entry is covered nearly always or hardly ever; see `One person "
        "in all frames` below. The truth is itself an estimate: four cameras determine "
        f"{', '.join(open_still)} hardly better than one camera does (sd above "
        f"{OPEN} of one camera's). For "
        "these, both estimates are near the prior's mean, and 100 % says little.\n"
    )


OPEN, FEW = 0.75, 0.75  # of one camera's sd; of the frames


def widened(found: Found, _: Results) -> str:
    """The same with another sigma."""
    return "\n".join(
        [
            f"### Coverage with the sigma that suits the residuals ({found['sigma']:.1f} px)\n",
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
            "### Coverage of synthetic truths\n",
            f"{count} synthetic truths. Shape and pose are drawn from their priors, and "
            "orientation and place from Gaussians of 0.3 rad and 0.3 m, which are priors of the "
            "posterior too. "
            "Keypoints have noise of the model's sigma and the recording's confidences.\n",
            _coverage(found),
            _also_nuts(found),
            _unusable(found),
            f"\nCorrect intervals cover each of the 16 entries in {low} to {high} of the {count} "
            f"cases, with a probability of {1 - UNLIKELY:.1%} for all entries together. "
            + ("emcee's intervals do." if inside else "emcee's intervals DO NOT."),
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
        f"{len(rates)} synthetic people, each in {found['frames']} frames of "
        "the recording's poses, "
        "each with their own betas and with noise of the model's sigma. The model is correct, and "
        f"Laplace's intervals cover {rates.mean():.1%} of all 16 entries. But among a person's ten "
        "betas, the lowest coverage is "
        + ", ".join(f"{r:.0%}" for r in np.sort(least))
        + " of the frames (one number for each person). The reason is that a person's error is "
        "nearly the same in all frames: "
        f"it has a standard deviation of {np.median(spread[:, shape]):.2f} over the frames, in "
        "units of Laplace's, and would have one of 1 if frames were independent.",
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
        f"\nThe recorded person is no different: the same standard deviation is {within:.2f}. The "
        f"beta with the lowest coverage, {recorded['labels'][worst]}, is covered in "
        f"{covered[worst]:.0%} of the frames, and {as_bad:.0%} of the synthetic people have a beta "
        "that is covered no more often. Forty frames of one person test each beta about once, not "
        "forty times."
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
        f"| recorded | {rate('recorded', 'Laplace')} | {rate('recorded', 'emcee')} |",
        f"| synthetic people in the recorded poses | {np.mean(people['rates'], axis=0)[i]:.0%} | |",
    ]
    if "simulated" in results:
        said.append(
            f"| synthetic people and poses | {rate('simulated', 'Laplace')} | "
            f"{rate('simulated', 'emcee')} |"
        )
    if "widened" in results:
        said.append(
            f"| recorded, with the sigma of the residuals | {rate('widened', 'Laplace')} | "
            f"{rate('widened', 'emcee')} |"
        )
    return (
        f"\nOf the entries that are not betas, {people['labels'][i]} is covered least often:\n\n"
        "| data | by Laplace, all free | by emcee, others fixed at the truth |\n"
        "| --- | --: | --: |\n" + "\n".join(said) + "\n\n"
        "The larger sigma restores the coverage where the others are fixed at the truth. Where all "
        "are free it does not. Three things contribute: Laplace's approximation covers too little "
        "even where all data are synthetic; the recorded poses are all alike, and are not draws "
        "from the prior; and real keypoints, unlike synthetic ones, are displaced in the same "
        "direction in all frames, which no sigma describes."
    )


def _coverage(found: Found) -> str:
    count = len(found["cases"])
    heads = list(COVERED.values())
    z = scores(found, "Laplace")
    four = found.get("sd of four cameras")
    sd = np.mean([case["Laplace"]["sd"] for case in found["cases"]], axis=0)
    lines = [
        f"| entry | {' | '.join(heads)} | mean | sd |"
        + (" sd from four / sd from one |" if four else ""),
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
        f"\nIn {len(some)} of these cases NUTS sampled all 85 unknowns, with four chains of "
        f"{NUTS.draws} draws. Its intervals cover {rates['NUTS']:.1%} of the 16 entries, and "
        f"Laplace's cover {rates['Laplace']:.1%} in the same cases. Only {len(good)} of the "
        f"{len(some)} runs have an R-hat of at most 1.05: 85 entries, most of them determined by "
        "the priors alone, are hard for NUTS as well."
    )


def _unusable(found: Found) -> str:
    bad = [case["case"] for case in found["cases"] if not case["emcee"]["usable"]]
    if not bad:
        return "\nThe draws of every run of emcee are usable, by the workbench's own criteria."
    return f"\nNot usable by emcee, and not counted: {', '.join(bad)}."
