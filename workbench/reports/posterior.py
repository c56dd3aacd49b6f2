"""The page of a posterior: a summary of its blocks, then each with its details."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.special

from workbench import plots
from workbench.arrays import Array
from workbench.fitting.setup import Setup
from workbench.plots.posterior import beside_laplace_sheet, corner_sheet, traces_sheet
from workbench.reports.folder import SUMMARY, Content, write_folder
from workbench.reports.page import Table, number, page, shown
from workbench.reports.replay import Recording, recorded_posterior
from workbench.sampling import EntryComparison, Posterior, compared_with_laplace


def write_posterior(
    parts: list[BlockPosterior],
    folder: str | Path,
    *,
    title: str,
    setup: Setup,
    source: str | None = None,
) -> Path:
    """Write the folder, and return its page; it is written whole or not at all. Raises BadFile."""
    by_anchor = dict(zip(anchors([part.name for part in parts]), parts, strict=True))
    files = {"index.html": "this page", "posterior.txt": "the verdicts and numbers as text"}
    for anchor, part in by_anchor.items():
        files[f"{anchor}.npz"] = f"the draws of {part.name}, with their names"
    files |= {SUMMARY: "verdicts and numbers, for programs"}
    doubts = contradictions(setup, [part.posterior for part in parts])
    html = page(
        "posterior.html",
        title=title,
        question=setup.question,
        summary=blocks_table(parts, setup),
        synthetic=setup.made_of is not None,
        contradictions=doubts,
        conditional=any(part.posterior.conditional for part in parts),
        sections={anchor: _section(part, setup) for anchor, part in by_anchor.items()},
        recordings=_recordings(by_anchor, setup),
        files=files,
    )
    sentences = "".join(f"{text[0].upper()}{text[1:]}.\n\n" for text in doubts)
    text = f"{sentences}{posterior_text(parts, setup)}\n"
    contents: dict[str, Content] = {"index.html": html, "posterior.txt": text}
    for anchor, part in by_anchor.items():
        contents[f"{anchor}.npz"] = partial(_save_draws, part.posterior)
    numbers = {part.name: _summary(part.posterior, setup) for part in parts}
    summary = {"kind": "posterior", "title": title, "warnings": doubts, "parts": numbers}
    return write_folder(folder, source, contents, summary)


def posterior_text(parts: Sequence[BlockPosterior], setup: Setup) -> str:
    """A line for every block, and then all that is known of each."""
    text = blocks_table(parts, setup).lines()
    for part in parts:
        p, laplace = part.posterior, part.approximation
        text += ["", part.name, p.summary(truth_of(p, setup), setup.priors)]
        text.append(f"Laplace's approximation: {laplace.verdict}")
        if p.mixed:
            text += _beside_laplace(p, laplace)
    return "\n".join(text)


def _beside_laplace(p: Posterior, laplace: Posterior) -> list[str]:
    """In how many entries Laplace's approximation is good enough, and the other entries."""
    rows = compared_with_laplace(p, laplace)
    unlike = [row for row in rows if row.remark != "agrees"]
    known = f", conditional too ({p.rest})," if p.conditional else ""
    agree = f"{len(rows) - len(unlike)} of {len(rows)} entries"
    return [f"Laplace's approximation{known} agrees in {agree}"] + [
        f"  {row.label}: {row.remark} (sd {row.ratio:.2f} times Laplace's, mean off by "
        f"{row.shift:+.2f} of its sd)"
        for row in unlike
    ]


def _recordings(parts: Mapping[str, BlockPosterior], setup: Setup) -> dict[str, Recording]:
    """Of the posteriors whose chains have mixed, bodies drawn from each."""
    recordings = {}
    for anchor, part in parts.items():
        p, body = part.posterior, setup.body
        if not p.mixed:
            continue
        recording = recorded_posterior(p, part.name, body, setup.views, setup.start)
        if recording is not None:
            recordings[anchor] = recording
    return recordings


def _save_draws(p: Posterior, path: Path) -> None:
    np.savez_compressed(
        path,
        draws=p.draws,
        log_prob=p.log_prob,
        entries=np.array(p.labels),
        units=np.array(p.units),
        verdict=np.array(p.verdict),
        held_fixed=np.array(p.conditioning.names),
        ratio=p.conditioning.ratios,
    )


def _section(part: BlockPosterior, setup: Setup) -> dict[str, Any]:
    """What the page says of one block: its figures of intervals only if these mean something."""
    p, laplace = part.posterior, part.approximation
    rows, truth = compared_with_laplace(p, laplace), truth_of(p, setup)
    entries, known = plots.widest(p), truth is not None
    E, _, W, k = p.draws.shape
    m, chains = p.mixing, f"{E} independent ensembles of {W} walkers"
    if p.method == "hamiltonian":
        chains = f"Hamiltonian Monte Carlo of all unknowns: {E} groups of {W} chains"
    section = {
        "part": part,
        "how": f"{k} entries; {chains}, {m.steps:,} steps after "
        f"{m.discarded:,} that were discarded, {m.acceptance:.0%} of the proposals accepted, "
        f"{p.seconds:.0f} s" + ("; interrupted" if p.interrupted else ""),
        "modes": _modes(p),
        "synthetic": known,
        "table": posterior_entries(p, rows, setup),
        "traces": shown(traces_sheet(p, entries, truth), plots.caption_traces(p, known)),
    }
    if p.mixed:
        remarks = [row.remark for row in rows]
        beside = beside_laplace_sheet(p, laplace, truth)
        corner = corner_sheet(p, entries, truth)
        section |= {
            "beside": shown(beside, plots.caption_beside_laplace(remarks, known)),
            "corner": shown(corner, plots.caption_corner(p, len(entries), known)),
        }
    return section


def _modes(p: Posterior) -> str:
    sentence = f"Modes: {p.mode_search}."
    if len(p.modes) < 2:
        return sentence
    shares = ", ".join(f"{mode.share:.0%}" for mode in p.modes)
    return f"{sentence} They have {shares} of the mass, by Laplace's approximation at each."


def anchors(names: Iterable[str]) -> list[str]:
    """For each name a word of letters and digits, with a number where they would be the same."""
    words: dict[str, str] = {}
    for name in names:
        word = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-") or "block"
        if word.lower() in words:
            word += f"-{len(words) + 1}"
        words[word.lower()] = word
    return list(words.values())


def _summary(p: Posterior, setup: Setup) -> dict[str, Any]:
    return {
        "verdict": p.judgement[0].name,
        "usable": p.usable,
        "why": p.verdict,
        "entries": p.labels,
        "tau": p.mixing.times,
        "r_hat": p.mixing.scales,
        "mean": p.mean if p.usable else None,
        "sd": p.sd if p.usable else None,
        "held_fixed": p.conditioning.names,
        "rest": p.rest,
        "contraction": p.contraction(setup.priors) if p.usable else None,
        "ratio": p.conditioning.ratios,
        "searches": p.mode_search.starts,
        "truth": truth_of(p, setup),
    }


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


def contradictions(setup: Setup, posteriors: Sequence[Posterior] = ()) -> list[str]:
    """Sentences on doubts of the model, and on priors that make a synthetic truth improbable.

    Of draws from a prior of m whitened Gaussian rows, the sum of squares is chi-square of m.
    """
    problem, doubts = setup.problem, list(dict.fromkeys(p.doubt for p in posteriors if p.doubt))
    if setup.made_of is None:
        return doubts
    whitened = problem.residual(*problem.split({**setup.start, **setup.made_of}))
    for name in setup.priors:
        rows = whitened[problem.rows[name]]
        m, total = len(rows), float(rows @ rows)
        if scipy.special.chdtrc(m, total) < UNLIKELY:
            doubts.append(
                f"the synthetic truth contradicts the {name}: the sum of its {m} squares there is "
                f"{total:,.0f}, where draws from that prior have {m} on average, and more than "
                f"{scipy.special.chdtri(m, UNLIKELY):,.0f} once in {1 / UNLIKELY:,.0f} times. The "
                "posterior believes the prior, so its intervals will hold this truth less often "
                "than they say"
            )
    return doubts


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
    `ESS` is the least number of effective draws of an entry, and `R-hat` the largest;
    `contraction` is the median of 1 - sd / (sd of the prior) over the entries with a known prior.
    """
    columns: dict[str, list[str]] = {"block": [part.name for part in parts]}
    posteriors = [part.posterior for part in parts]
    columns["verdict"] = [p.judgement[0].value for p in posteriors]
    columns["entries"] = [str(p.size) for p in posteriors]
    if any(p.conditional for p in posteriors):
        columns["ratio"] = [number(float(p.conditioning.ratios.max()), 3) for p in posteriors]
    columns["ESS"] = [f"{p.mixing.effective.min():,.0f}" for p in posteriors]
    columns["R-hat"] = [f"{p.mixing.scales.max():.3f}" for p in posteriors]
    columns["contraction"] = [_median(p, setup) for p in posteriors]
    if setup.made_of is not None:
        inside = [truths_inside(p, setup) for p in posteriors]
        columns["truths in 90 %"] = [
            "–" if count is None else f"{count} of {p.size}"
            for count, p in zip(inside, posteriors, strict=True)
        ]
    right = [i for i, name in enumerate(columns) if name in ("entries", "ratio", "ESS", "R-hat")]
    columns["other unknowns"] = [p.rest for p in posteriors]
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), tuple(right))


def _median(p: Posterior, setup: Setup) -> str:
    if not p.mixed:
        return "–"
    contraction = p.contraction(setup.priors)
    known = contraction[np.isfinite(contraction)]
    return f"{np.median(known):.2f}" if len(known) else "no prior known"


def posterior_entries(p: Posterior, rows: tuple[EntryComparison, ...], setup: Setup) -> Table:
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
        columns["truth (synthetic)"] = [number(float(value), 3) for value in truth]
    columns["autocorrelation time (steps)"] = [number(float(time), 2) for time in p.mixing.times]
    columns["ESS"] = [f"{count:,.0f}" for count in p.mixing.effective]
    columns["R-hat"] = [f"{scale:.3f}" for scale in p.mixing.scales]
    numbers = tuple(range(2, len(columns) + p.mixed))
    if p.mixed:
        columns["sd / Laplace's"] = [number(row.ratio, 2) for row in rows]
        columns["beside Laplace"] = [row.remark for row in rows]
        contraction = p.contraction(setup.priors)
        if np.isfinite(contraction).any():
            columns["contraction"] = [number(float(value), 2) for value in contraction]
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), numbers)
