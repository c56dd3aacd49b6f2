"""The tables of draws in IMAGES.md, from `results/draws.json`."""

from collections.abc import Iterator
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from benchmarks.images.intervals import LEVEL, WHAT, line, parts, share
from workbench.arrays import Array
from workbench.fitting.images import OFFSET, Z90

RESULTS = Path(__file__).parent.parent / "results" / "draws.json"
BEGIN = "<!-- draws: written by `python -m benchmarks.images.draws` -->"
END = "<!-- draws: end -->"
KINDS = {
    "unknown": "`balance`, stature unknown",
    "known": "`balance`, stature known",
    "people": "synthetic people",
}
RESAMPLED = 1000
Runs = dict[str, dict[str, Any]]  # posteriors by name


def of_kind(found: dict[str, Any], kind: str, method: str = "hamiltonian") -> Runs:
    """The posteriors of one kind that were drawn by one method."""
    return {
        name: run
        for name, run in found["posteriors"].items()
        if name.startswith(kind + ",") and name.endswith(method)
    }


def column(runs: Runs, part: str, name: str) -> Array:
    """One number of all posteriors, (R, 38), or (R, 3, 38) for ends."""
    return np.array([run[part][name] for run in runs.values()])


def outside(runs: Runs, way: str) -> Array:
    """How far truths (R, 38) are from the middle of their 90 % intervals, 1 at an end.

    `way` is `Laplace` or `draws`, which may be followed by ` with offsets`. Each side of an
    interval of draws is measured from the median by itself.
    """
    true = column(runs, "laplace", "true")
    if way.startswith("Laplace"):
        lever = OFFSET * column(runs, "laplace", "lever") if "offsets" in way else 0.0
        sd = np.hypot(column(runs, "laplace", "sd"), lever)
        return np.asarray(np.abs(true - column(runs, "laplace", "fit")) / (Z90 * sd))
    ends = column(runs, "draws", "ends with offsets" if "offsets" in way else "ends")
    low, middle, high = np.moveaxis(ends, 1, 0)
    off = true - middle
    return np.asarray(np.where(off > 0, off / (high - middle), off / (low - middle)))


def judged(runs: Runs, way: str) -> dict[str, Any]:
    """How many 90 % intervals hold the truth, and how much wider they should be for that."""
    return {
        name: {
            "within": int(np.sum(off <= 1)),
            "of": off.size,
            "factor": float(np.quantile(off, LEVEL)),
        }
        for name, off in parts(outside(runs, way)).items()
    }


def shapes(runs: Runs) -> dict[str, dict[str, float]]:
    """How draws differ from Laplace's Gaussian, by what the numbers are.

    `sd` and `widest` are the median and the 95 % quantile of their standard deviations over
    Laplace's; `skewness` is the median of its absolute value; `moved` and `farthest` are the median
    and the 95 % quantile of the distance of their mean from the fit, in Laplace's standard
    deviations.
    """
    sd, fit = column(runs, "laplace", "sd"), column(runs, "laplace", "fit")
    ratio = parts(column(runs, "draws", "sd") / sd)
    moved = parts(np.abs(column(runs, "draws", "mean") - fit) / sd)
    skewness = parts(column(runs, "draws", "skewness"))
    return {
        name: {
            "sd": float(np.median(ratio[name])),
            "widest": float(np.quantile(ratio[name], 0.95)),
            "skewness": float(np.median(np.abs(skewness[name]))),
            "moved": float(np.median(moved[name])),
            "farthest": float(np.quantile(moved[name], 0.95)),
        }
        for name in WHAT
    }


def bias(runs: Runs) -> dict[str, float]:
    """By how much depth is too large in the mean, in mm: that of the likeliest body, and the mean
    of draws.
    """
    true = column(runs, "laplace", "true")[:, 0]
    fit, mean = column(runs, "laplace", "fit")[:, 0], column(runs, "draws", "mean")[:, 0]
    return {"fit": float(1e3 * (fit - true).mean()), "draws": float(1e3 * (mean - true).mean())}


def compared(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Posteriors that were drawn by both methods, with how far these are apart."""
    runs = found["posteriors"]
    for name, one in runs.items():
        other = runs.get(name.replace("emcee", "hamiltonian"))
        if not name.endswith("emcee") or other is None:
            continue
        a, b = ({key: np.array(x) for key, x in run["draws"].items()} for run in (one, other))
        means = (a["mean"] - b["mean"]) / np.hypot(a["error of mean"], b["error of mean"])
        sds = (a["sd"] - b["sd"]) / np.hypot(a["error of sd"], b["error of sd"])
        ratio = a["sd"] / b["sd"]
        yield (
            name.removesuffix(", emcee"),
            {
                "emcee": one | one["entries"],
                "hamiltonian": other,
                "apart": float(np.max(np.abs(a["mean"] - b["mean"]) / b["sd"])),
                "within 2": int(np.sum(np.abs(means) < 2) + np.sum(np.abs(sds) < 2)),
                "of": means.size + sds.size,
                "most": float(max(np.abs(means).max(), np.abs(sds).max())),
                "ratio": (float(ratio.min()), float(ratio.max())),
            },
        )


def factors(runs: Runs, way: str, name: str = "along") -> tuple[float, float]:
    """The 95 % interval of `judged`'s factor, if other images were as alike as these (bootstrap of
    posteriors).
    """
    off = parts(outside(runs, way))[name]
    rng = np.random.default_rng(0)
    some = rng.integers(len(off), size=(RESAMPLED, len(off)))
    found = np.quantile(off[some].reshape(RESAMPLED, -1), LEVEL, axis=1)
    low, high = np.quantile(found, [0.025, 0.975])
    return float(low), float(high)


def findings(found: dict[str, Any]) -> Iterator[str]:
    """Sentences about the numbers, one an item."""
    kinds = {kind: runs for kind in KINDS if (runs := of_kind(found, kind))}
    for kind, runs in kinds.items():
        told = []
        for way in ("Laplace", "draws"):
            one, (low, high) = judged(runs, way)["along"], factors(runs, way)
            told.append(
                f"by {way} {share(one)} hold the truth, and they should be {one['factor']:.2f} "
                f"times as wide (95 %: {low:.2f} to {high:.2f})"
            )
        first, second = (judged(runs, way)["along"]["factor"] for way in ("Laplace", "draws"))
        yield (
            f"Limbs along the axis, {KINDS[kind]} ({len(runs)} posteriors): {'; '.join(told)}. A "
            f"factor of {first / second:.2f} is the approximation's, and {second:.2f} the model's."
        )
    for kind in ("unknown", "known"):
        if kind in kinds:
            off = bias(kinds[kind])
            yield (
                f"Depth of {KINDS[kind]}: in the mean of {len(kinds[kind])} posteriors the "
                f"likeliest body is {-off['fit']:.0f} mm too near, and the mean of the draws "
                f"{-off['draws']:.0f} mm."
            )
    everywhere = [run for runs in kinds.values() for run in runs.values()]
    behind = [run["behind"] for run in everywhere if run["behind"] > 0]
    most = 100 * max(behind, default=0.0)
    yield (
        f"Searches for modes find bodies behind the camera in {len(behind)} of "
        f"{len(everywhere)} posteriors, with up to {most:.0f} % of the mass."
    )
    for name, pair in compared(found):
        low, high = pair["ratio"]
        yield (
            f"emcee and Hamiltonian Monte Carlo ({name}): {pair['within 2']} of the {pair['of']} "
            "means and standard deviations differ by less than two standard errors, means by at "
            f"most {pair['apart']:.2f} standard deviations, and standard deviations by factors of "
            f"{low:.2f} to {high:.2f}."
        )


def tables(found: dict[str, Any]) -> str:
    """The tables of the page."""
    head = "depth | stature | limbs across | limbs along"
    rule = " --: | --: | --: | --: |"
    items = (fill(f"- {one}", 120, subsequent_indent="  ") for one in findings(found))
    drawn = [(kind, title, of_kind(found, kind)) for kind, title in KINDS.items()]
    kinds = [(kind, title, runs) for kind, title, runs in drawn if runs]
    lines = [
        "",
        *items,
        "",
        "90 % intervals that hold the truth (factor by which they should be wider):",
        "",
    ]
    lines += [f"| posteriors | intervals | {head} |", f"| --- | --- |{rule}"]
    for kind, title, runs in kinds:
        ways = ["Laplace", "draws"]
        if kind != "people":
            ways += [f"{way} with offsets" for way in ways]
        lines += [f"| {len(runs)}, {title} | {way} | {line(judged(runs, way))} |" for way in ways]
    lines += ["", "The draws, compared with Laplace's Gaussian:", ""]
    lines += ["| posteriors | numbers | sd / Laplace's: median, 95 % quantile | skewness, median |"]
    lines[-1] += " mean off the fit, sd: median, 95 % quantile |"
    lines += ["| --- | --- | --: | --: | --: |"]
    for _, title, runs in kinds:
        for name, one in shapes(runs).items():
            cells = f"{one['sd']:.2f}, {one['widest']:.2f} | {one['skewness']:.2f}"
            lines.append(
                f"| {title} | {name} | {cells} | {one['moved']:.2f}, {one['farthest']:.2f} |"
            )
    lines += ["", "How well Hamiltonian Monte Carlo mixes in the 38 numbers:", ""]
    lines += ["| posteriors | usable | of one mode, usable | of several modes, usable |"]
    lines[-1] += " evaluations, median | CPU s, median |"
    lines += ["| --- | --: | --: | --: | --: | --: |"]
    for _, title, runs in kinds:
        counts = [usable(list(runs.values()))]
        for several in (False, True):
            counts.append(usable([r for r in runs.values() if (len(r["modes"]) > 1) is several]))
        for key in ("evaluations", "seconds"):
            counts.append(f"{np.median([run[key] for run in runs.values()]):,.0f}")
        lines.append(f"| {title} | {' | '.join(counts)} |")
    both = list(compared(found))
    if both:
        lines += ["", "The same posteriors by emcee and by Hamiltonian Monte Carlo:", ""]
        lines += ["| stature, frame, camera | method | evaluations | steps / longest time |"]
        lines[-1] += " R-hat | least effective draws | usable |"
        lines += ["| --- | --- | --: | --: | --: | --: | --- |"]
    for name, pair in both:
        for method in ("emcee", "hamiltonian"):
            run = pair[method]
            cells = f"{run['evaluations']:,.0f} | {run['times']:.0f}"
            cells += f" | {run['R-hat']:.3f} | {run['effective']:,.0f}"
            lines.append(f"| {name} | {method} | {cells} | {'yes' if run['usable'] else 'no'} |")
    return "\n".join(lines[1:]) + "\n"


def usable(runs: list[dict[str, Any]]) -> str:
    """How many of some posteriors have usable draws."""
    return f"{sum(run['usable'] for run in runs)} of {len(runs)}"
