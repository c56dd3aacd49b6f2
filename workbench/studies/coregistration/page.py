"""The page of the coregistration study."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.reports.page import Columns, Table, page, plotted
from workbench.studies.coregistration import figures
from workbench.studies.coregistration.scans import START, TRUTH
from workbench.studies.coregistration.study import CONTROL, TOGETHER, Cell, TogetherStudy
from workbench.studies.pages import text_of, write_study

REMARKS = (
    f"Everything here is synthetic. People are made of the body {TRUTH!r}, each with a shape of "
    "its own that is 6 mm (rms) from what betas reach, in draws of the pose prior. Two depth "
    "cameras see them, with noise of 2 mm at 2 m. Holes are regions of a scan that are left out, "
    f"at random places. Registering starts from the body {START!r}, which has other weights, "
    "joints and pose blend shapes, at a pose that is 0.03 rad per angle and 10 mm from the truth: "
    "the question is how accurate a registration is, and not whether it finds the person.",
    "“Apart” registers each scan by itself, as the command “workbench register” does, and then "
    "goes on for as many rounds as registering together has, so that time is no advantage. "
    "“Together” is the command “workbench coregister” with its defaults.",
    "A vertex is hidden if no camera saw it, or if it is in a hole.",
)


def in_short(s: TogetherStudy) -> str:
    """When it is worth it."""
    found = [(cell, cell.share("hidden")) for cell in s.cells]
    best, least = min(found, key=lambda one: one[1][0]), max(found, key=lambda one: one[1][0])
    worth = [cell for cell, (_, _, high) in found if high < 1]
    told = (
        "in every set"
        if len(worth) == len(found)
        else f"in {len(worth)} of {len(found)} sets"
        if worth
        else "in no set"
    )
    return (
        f"Registering scans together brings hidden vertices nearer to the truth {told}, counted "
        "where the whole interval over people says so. It gained most with "
        f"{_set(best[0])}: an error of {best[0].mean(TOGETHER, 'hidden'):.1f} mm instead of "
        f"{best[0].mean(CONTROL, 'hidden'):.1f}; and least with {_set(least[0])}: "
        f"{least[0].mean(TOGETHER, 'hidden'):.1f} mm instead of "
        f"{least[0].mean(CONTROL, 'hidden'):.1f}."
    )


def _set(cell: Cell) -> str:
    return f"{cell.scans} scans with {cell.holes} holes in each"


def table(s: TogetherStudy) -> Table:
    """All sets in numbers."""

    columns: Columns[Cell] = {
        "holes in each scan": lambda c: str(c.holes),
        "scans": lambda c: str(c.scans),
        "vertices hidden": lambda c: f"{c.unseen:.0%}",
        "hidden, apart (mm)": lambda c: f"{c.mean(CONTROL, 'hidden'):.2f}",
        "hidden, together (mm)": lambda c: f"{c.mean(TOGETHER, 'hidden'):.2f}",
        "hidden, together / apart": lambda c: _told(c.share("hidden")),
        "seen, apart (mm)": lambda c: f"{c.mean(CONTROL, 'seen'):.2f}",
        "seen, together (mm)": lambda c: f"{c.mean(TOGETHER, 'seen'):.2f}",
        "seen, together / apart": lambda c: _told(c.share("seen")),
    }
    return Table.of(s.cells, columns, tuple(range(len(columns))))


def _told(share: tuple[float, ...]) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*share)


def together_text(s: TogetherStudy) -> str:
    """The table for a terminal."""
    return text_of(table(s))


def together_data(s: TogetherStudy) -> dict[str, Any]:
    """Every number of it."""
    return {
        "kind": "together",
        "name": "together",
        "plan": asdict(s.plan),
        "sets": [asdict(cell) for cell in s.cells],
    }


def write_together(s: TogetherStudy, folder: str | Path) -> Path:
    """Write the folder of a study, and return its page; it is written whole or not at all."""
    return write_study(folder, together_page(s), together_text(s), together_data(s), {})


def together_page(s: TogetherStudy) -> str:
    """The page as HTML."""
    return page(
        "together.html",
        title="Scans registered one by one, and together",
        study=s,
        summary=in_short(s),
        remarks=REMARKS,
        sets=table(s),
        curves=[
            plotted(6.4, 4.6, figures.plot_hidden, figures.caption_hidden, s),
            plotted(6.4, 4.6, figures.plot_shares, figures.caption_shares, s),
        ],
        example=plotted(8.5, 4.6, figures.plot_example, figures.caption_example, s.example),
    )
