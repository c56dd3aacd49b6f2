"""A posterior as a folder: one page with a section for each block, and the same in words."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.experiments.experiment import Setup
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots import (
    caption_beside_laplace,
    caption_corner,
    caption_spray,
    caption_traces,
    sheets,
    widest,
)
from workbench.reports.figures import Shown, shown
from workbench.reports.folder import MAKER, SUMMARY, replacing_folder
from workbench.reports.page import page
from workbench.reports.summary import as_json, versions
from workbench.reports.tables import Table, number
from workbench.sampling import Compared, Posterior, beside_laplace

DRAWN = 24  # bodies in a spray


@dataclass(frozen=True, eq=False)
class Part:
    """One block's posterior, and Laplace's approximation to it."""

    name: str
    posterior: Posterior
    approximation: Posterior


@dataclass(frozen=True, eq=False)
class Section:
    """What the page says of a part."""

    name: str
    anchor: str
    good: bool
    verdict: str
    how: str
    modes: str
    table: Table
    spray: Shown | None
    views: list[Shown]
    beside: Shown
    corner: Shown
    traces: Shown


def write_posterior(
    parts: list[Part], folder: str | Path, *, title: str, setup: Setup, source: str | None = None
) -> Path:
    """Write the folder, whole or not at all, and return its page. Raises BadFile."""
    target = Path(folder)
    sections = [_section(part, setup) for part in parts]
    files = {"index.html": "this page", "posterior.txt": "the same in words"}
    files |= {f"{s.anchor}.npz": f"the draws of {s.name}, with their names" for s in sections}
    files |= {SUMMARY: "verdicts and numbers, in a file that programs read"}
    with replacing_folder(target, source) as fresh:
        words = [f"{part.name}\n\n{part.posterior}\n" for part in parts]
        (fresh / "posterior.txt").write_text("\n".join(words), encoding="utf-8")
        for part, section in zip(parts, sections, strict=True):
            p = part.posterior
            np.savez_compressed(
                fresh / f"{section.anchor}.npz", draws=p.draws, log_prob=p.log_prob,
                entries=np.array(p.labels), units=np.array(p.units), verdict=np.array(p.verdict),
            )  # fmt: skip
        html = page(
            "posterior.html", title=title, question=setup.question, sections=sections, files=files,
            versions=versions(),
        )  # fmt: skip
        (fresh / "index.html").write_text(html, encoding="utf-8")
        (fresh / SUMMARY).write_text(as_json(_summary(parts, files, title, source)), "utf-8")
    return target / "index.html"


def _section(part: Part, setup: Setup) -> Section:
    p, laplace = part.posterior, part.approximation
    rows = beside_laplace(p, laplace)
    entries = widest(p, laplace)
    E, _, W, k = p.draws.shape
    m = p.mixing
    return Section(
        name=part.name, anchor=_anchor(part.name), good=p.usable, verdict=p.verdict,
        how=f"{k} entries; {E} independent ensembles of {W} walkers, {m.steps:,} steps after "
        f"{m.discarded:,} that were discarded, {m.acceptance:.0%} of the proposals accepted, "
        f"{p.seconds:.0f} s" + ("; interrupted" if p.interrupted else ""),
        modes=_modes(p),
        table=entries_table(p, rows),
        spray=_spray(p, setup.body),
        views=_views(p, setup),
        beside=shown(sheets.beside_laplace_sheet(p, laplace),
                     caption_beside_laplace([row.said for row in rows])),
        corner=shown(sheets.corner_sheet(p, entries), caption_corner(p, len(entries))),
        traces=shown(sheets.traces_sheet(p, entries), caption_traces(p)),
    )  # fmt: skip


def entries_table(p: Posterior, rows: tuple[Compared, ...]) -> Table:
    """Every entry; intervals only where the verdict carries them."""
    ends = p.interval(0.9) if p.usable else None
    body = tuple(
        (
            row.label, row.unit,
            *((number(row.mean, 3), number(row.sd, 2), *(number(float(e), 3) for e in ends[i]))
              if ends is not None else ()),
            number(float(p.mixing.times[i]), 2), f"{p.mixing.effective[i]:,.0f}",
            f"{p.mixing.scales[i]:.3f}", number(row.ratio, 2), row.said,
        )
        for i, row in enumerate(rows)
    )  # fmt: skip
    known = ("mean", "sd", "5 %", "95 %") if ends is not None else ()
    head = ("entry", "unit", *known, "tau (steps)", "effective draws", "R-hat",
            "sd / Laplace's", "beside Laplace")  # fmt: skip
    return Table(head, body, tuple(range(2, len(head) - 1)))


def _modes(p: Posterior) -> str:
    if len(p.modes) < 2:
        return ""
    shares = ", ".join(f"{mode.share:.0%}" for mode in p.modes)
    return (
        f"Least squares from places around found {len(p.modes)} modes, with {shares} of the mass "
        "by Laplace's approximation at each."
    )


def _spray(p: Posterior, body: SkinnedBody | None) -> Shown | None:
    """Bodies upright, as the mean pose of the root is."""
    if body is None or not _of_body(p, body):
        return None
    pose = body.blocks()[0].name
    upright = matrix_from_vector(np.reshape(p.at[pose], (-1, 3))[0])
    bodies = np.stack([_surface(body, values) for values in p.values(DRAWN)]) @ upright
    bodies -= bodies.mean(axis=(0, 1))
    bodies[..., 1] -= bodies[..., 1].min()
    figure = sheets.spray_sheet(bodies, body.faces)
    return shown(figure, caption_spray(DRAWN, "turned upright, from the front and from the side"))


def _views(p: Posterior, setup: Setup) -> list[Shown]:
    body, found = setup.body, []
    if body is None or not _of_body(p, body):
        return []
    several = p.values(DRAWN)
    surfaces = [_surface(body, values) for values in several]
    for view in sorted(setup.views, key=lambda view: view.held_out)[:2]:
        pixels = np.stack(
            [view.camera.pixels(s, setup.start | v) for s, v in zip(surfaces, several, strict=True)]
        )
        told = " (held out)" if view.held_out else ""
        figure = sheets.spray_in_view_sheet(
            pixels, body.faces, view.observed, view.confidence, view.name + told
        )
        found.append(shown(figure, caption_spray(DRAWN, f"as {view.name}{told} sees them")))
    return found


def _of_body(p: Posterior, body: SkinnedBody) -> bool:
    return {block.name for block in body.blocks()} <= set(p.at)


def _surface(body: SkinnedBody, values: Mapping[str, Any]) -> Any:
    return body.vertices(*(values[block.name] for block in body.blocks()))


def _anchor(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "block"


def _summary(
    parts: list[Part], files: Mapping[str, str], title: str, source: str | None
) -> dict[str, Any]:
    return {
        "made_by": MAKER, "kind": "posterior", "source": source or "", "files": list(files),
        "title": title, "versions": versions(),
        "parts": {
            part.name: {
                "verdict": part.posterior.mixing.verdict.name,
                "usable": part.posterior.usable,
                "why": part.posterior.verdict,
                "entries": list(part.posterior.labels),
                "tau": part.posterior.mixing.times.tolist(),
                "r_hat": part.posterior.mixing.scales.tolist(),
                "mean": part.posterior.mean.tolist() if part.posterior.usable else None,
                "sd": part.posterior.sd.tolist() if part.posterior.usable else None,
            }
            for part in parts
        },
    }  # fmt: skip
