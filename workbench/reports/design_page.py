"""A design of measurements as a folder: one page with its figures, and the same as data."""

import json
from pathlib import Path

from workbench import plots
from workbench.diagnostics import MeasurementDesign
from workbench.plots.diagnosis import MOST_RANKED
from workbench.reports.folder import SUMMARY, write_folder
from workbench.reports.page import page, plotted

FILES = {
    "index.html": "this page",
    "design.txt": "the design as text",
    "design.json": "the design as data, for programs",
    SUMMARY: "the title and the choice, for programs",
}


def write_design(
    found: MeasurementDesign,
    folder: str | Path,
    *,
    title: str,
    question: str = "",
    check: str = "",
    source: str | None = None,
) -> Path:
    """Write the folder of a design, and return its page. `check` is a sentence on simulated fits.

    The folder appears whole or not at all; raises BadFile if it cannot be written.
    """
    rows = min(len(found.ranking), MOST_RANKED)
    ranking = plotted(
        7.4,
        1.2 + 0.21 * rows,
        plots.plot_measurement_ranking,
        plots.caption_measurement_ranking,
        found,
    )
    choice = None
    if len(found.chosen) > 1:
        choice = plotted(
            7.4,
            1.1 + 0.24 * len(found.chosen),
            plots.plot_measurement_choice,
            plots.caption_measurement_choice,
            found,
        )
    text = found.report() + (f"\n{check}" if check else "")
    contents = {
        "index.html": page(
            "design.html",
            title=title,
            question=question,
            d=found,
            outcome=outcome(found),
            ranking=ranking,
            choice=choice,
            report=found.report(),
            check=check,
            files=FILES,
        ),
        "design.txt": text + "\n",
        "design.json": json.dumps(found.data(), indent=1, allow_nan=False),
    }
    return write_folder(folder, source, contents, {"title": title, "chosen": list(found.chosen)})


def outcome(found: MeasurementDesign) -> str:
    """What the choice changes, in a sentence."""
    unit = "" if found.unit == "1" else f" {found.unit}"
    if found.after.open:
        return (
            f"{found.after.open} of the numbers that matter stay undetermined; "
            f"{found.before.open} were before."
        )
    if found.before.open:
        return f"what was undetermined has a standard deviation of {found.after.sd:.3g}{unit}."
    return (
        f"from {found.before.sd:.3g} to {found.after.sd:.3g}{unit}, {found.gain:.3g} times smaller."
    )
