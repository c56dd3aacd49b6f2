"""The figure of the gym: performance profiles."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, PercentFormatter

from benchmarks.gym.page import profile, profiled
from workbench.plots import style
from workbench.plots.palette import FAINT, solver_styles

WIDEST = 30.0  # factor of the least evaluations
POINTS = 400
TICKS = (1, 2, 5, 10, 20, 30)


def draw(found: Mapping[str, Any], path: Path) -> None:
    """Save the performance profiles of one half as SVG."""
    factors = np.geomspace(1.0, WIDEST, POINTS)
    shares = profile(found, list(factors))
    with style.house_style():
        sheet = Figure(figsize=(8.0, 4.6), layout="constrained")
        ax = sheet.subplots()
        for k, (name, drawn) in enumerate(solver_styles(profiled(found)).items()):
            ax.step(factors, shares[:, k], where="post", label=name, **drawn.line)
        ax.set_xscale("log")
        ax.set_xlim(1.0, WIDEST)
        ax.xaxis.set_major_locator(FixedLocator(TICKS))
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_ylim(0.0, 1.02)
        ax.yaxis.set_major_formatter(PercentFormatter(1.0))
        ax.set_xlabel("evaluations over the least of all")
        ax.set_ylabel("share of the cases that are solved")
        ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
        ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    path.write_bytes(style.svg(sheet))
