"""The page of the study of the loop of fitting and learning."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.reports.page import Columns, Table, page, plotted
from workbench.studies.fitting_loop import figures
from workbench.studies.fitting_loop.study import REST, SHIPPED, TRUTH, Errors, LoopStudy, Round
from workbench.studies.pages import text_of, write_study

REMARKS = (
    "Everything here is synthetic: the people are made of the body that is fitted, each with a "
    "shape of their own, and every image has the 23 keypoints of one person, with normally "
    "distributed noise.",
    "SPIN's regressor sees a photograph, learns after every few images, and goes on learning; "
    "this one sees 17 keypoints and is trained anew in each round, on the kept poses seen by "
    "cameras at random. What is the same is the loop: the regressor begins the fits, a fit is "
    "kept if its cost is the lowest that its image ever had, and the kept fits teach.",
    "The loop never sees a truth. Its first fits begin at rest, where the torso was seen. The "
    "pose prior of the fits and of the shipped regressor is the same, and the shipped regressor "
    "was trained on 30,000 draws of it.",
)


def in_short(s: LoopStudy) -> str:
    """What the first round gained, and what the others."""
    none, first, last = s.rounds[0], s.rounds[1], s.rounds[-1]
    assert first.begun is not None
    assert last.begun is not None
    more = (
        ""
        if last is first
        else f" {_further(last.number - 1)} that to {last.kept.mean:.0f} mm, and fits to held-out "
        f"images from {first.begun.mean:.0f} to {last.begun.mean:.0f} mm."
    )
    return (
        f"One round of learning and fitting takes the mean error of the loop's images from "
        f"{none.kept.mean:.0f} to {first.kept.mean:.0f} mm, and the fits above 150 mm from "
        f"{none.kept.failed} to {first.kept.failed} of {s.plan.images}.{more} Fits to held-out "
        f"images are {s.others[REST].mean:.0f} mm off if they begin at rest, "
        f"{s.others[SHIPPED].mean:.0f} mm if the shipped regressor begins them, which learned from "
        f"the pose prior alone, and {s.others[TRUTH].mean:.0f} mm if they begin at the truth."
    )


def _further(rounds: int) -> str:
    return "Another round brings" if rounds == 1 else f"{rounds} more rounds bring"


def of_rounds(s: LoopStudy) -> Table:
    """The rounds in numbers."""
    columns: Columns[Round] = {
        "round": lambda r: str(r.number),
        "kept fits (mm)": lambda r: _told(r.kept),
        "mean cost": lambda r: f"{r.cost:.2f}",
        "replaced": lambda r: str(r.replaced),
        "held out: regressor alone (mm)": lambda r: _told(r.alone),
        "held out: fits it begins (mm)": lambda r: _told(r.begun),
    }
    return Table.of(s.rounds, columns, tuple(range(len(columns))))


def of_starts(s: LoopStudy) -> Table:
    """Held-out images from other starts."""
    rows = [*s.others.items(), ("the shipped regressor's own answers", s.shipped_alone)]
    columns: Columns[tuple[str, Errors]] = {
        "held-out images": lambda row: row[0],
        "mean error (mm), above 150 mm": lambda row: _told(row[1]),
    }
    return Table.of(rows, columns, (1,))


def _told(errors: Errors | None) -> str:
    return "" if errors is None else f"{errors.mean:.1f} ({errors.failed} of {len(errors.each)})"


def loop_text(s: LoopStudy) -> str:
    """The tables for a terminal."""
    return text_of(of_rounds(s), of_starts(s))


def loop_data(s: LoopStudy) -> dict[str, Any]:
    """Every number of it."""
    return {"kind": "loop", "name": "loop", **asdict(s)}


def write_loop(s: LoopStudy, folder: str | Path) -> Path:
    """Write the folder of a study, and return its page; it is written whole or not at all."""
    return write_study(folder, loop_page(s), loop_text(s), loop_data(s), {})


def loop_page(s: LoopStudy) -> str:
    """The page as HTML."""
    return page(
        "loop.html",
        title="Fitting and learning in a loop",
        study=s,
        summary=in_short(s),
        remarks=REMARKS,
        rounds=of_rounds(s),
        starts=of_starts(s),
        poses=(
            "of a recording, from clips of which no prior has learned; no clip is in both sets"
            if s.recorded
            else "draws of the mixture of poses"
        ),
        curves=[
            plotted(6.4, 4.6, figures.plot_rounds, figures.caption_rounds, s),
            plotted(6.4, 4.6, figures.plot_each, figures.caption_each, s),
        ],
    )
