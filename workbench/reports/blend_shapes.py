"""The comparison of predictors as a page, as text, and as data."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.plots import Figure, house_style, sheet
from workbench.plots import blend_shapes as drawn
from workbench.reports.figures import shown
from workbench.reports.folder import MAKER, SUMMARY, replacing_folder
from workbench.reports.page import page
from workbench.reports.summary import as_json, versions
from workbench.reports.tables import Table
from workbench.training.blend_shapes.comparison import Comparison
from workbench.training.blend_shapes.contest import repaired

KNOWN = (
    "The teacher is synthetic: a finer rig with twist spread along the limbs, blended by dual "
    "quaternions. That DQB does well is partly because the teacher does the same; measured people "
    "would not grant it that. Only the poses come from people.",
    "Repaired is the share of the mean distance of linear blending alone that is gone. Learned are "
    "numbers that are not zero, beside template and weights. The time is the least of one pose: "
    "features and skinning by CasADi, the product between them by NumPy or, sparse, SciPy.",
)


def predictor_table(comparison: Comparison) -> Table:
    """All predictors, the best first."""
    rows = tuple(
        (
            str(place), r.name, f"{r.learned:,}", f"{r.mean:.2f}", f"{r.rms:.2f}",
            f"{r.largest:.1f}", f"{repaired(r, comparison.results):.0%}".replace("-", "−"),
            f"{r.milliseconds:.2f}",
        )
        for place, r in enumerate(comparison.results, start=1)
    )  # fmt: skip
    head = ("", "predictor", "learned", "mean mm", "rms mm", "max mm", "repaired", "ms")
    return Table(head, rows, (0, 2, 3, 4, 5, 6, 7))


def table_text(comparison: Comparison) -> str:
    """The table for a terminal."""
    table = predictor_table(comparison)
    lines = [table.head, *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.head))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if i in table.numbers else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip().replace("−", "-")
        for line in lines
    )  # fmt: skip


def write_blend_shapes(comparison: Comparison, folder: str | Path) -> Path:
    """Write the folder of a comparison and return its page; whole or not at all."""
    target = Path(folder)
    with replacing_folder(target, "") as fresh:
        (fresh / "index.html").write_text(blend_shapes_page(comparison), encoding="utf-8")
        (fresh / "table.txt").write_text(table_text(comparison) + "\n", encoding="utf-8")
        summary = blend_shapes_data(comparison) | {"files": ["index.html", "table.txt", SUMMARY]}
        (fresh / SUMMARY).write_text(as_json(summary), encoding="utf-8")
    return target / "index.html"


def blend_shapes_data(comparison: Comparison) -> dict[str, Any]:
    """Every number of it."""
    return {
        "made_by": MAKER,
        "kind": "blend shapes",
        "name": "blendshapes",
        "source": "",
        "plan": asdict(comparison.plan),
        "test": comparison.test,
        "n_test": comparison.n_test,
        "results": [asdict(result) for result in comparison.results],
        "by_size": [asdict(row) for row in comparison.by_size],
        "by_reach": {name: list(sizes) for name, sizes in comparison.by_reach.items()},
        "by_turn": {name: list(sizes) for name, sizes in comparison.by_turn.items()},
        "by_distance": [asdict(row) for row in comparison.by_distance],
        "by_sparsity": [asdict(row) for row in comparison.by_sparsity],
        "versions": versions(),
    }


def blend_shapes_page(c: Comparison) -> str:
    """The page."""
    figures = {
        "What each of them leaves": [
            (_sheet(8.0, 5.2, lambda ax: drawn.plot_predictors(c.results, ax=ax)),
             drawn.caption_predictors(c.results, c.test, c.n_test)),
        ],
        "Between examples": [
            (_sheet(6.2, 4.0, lambda ax: drawn.plot_by_size(c.by_size, ax=ax)),
             drawn.caption_by_size(c.by_size)),
            (_sheet(6.2, 4.0, lambda ax: drawn.plot_by_reach(c.by_reach, ax=ax)),
             drawn.caption_by_reach(c.by_reach)),
        ],
        "Which function of theta": [
            (_sheet(7.0, 4.0, lambda ax: drawn.plot_by_turn(c.by_turn, ax=ax)),
             drawn.caption_by_turn(c.by_turn)),
        ],
        "Near the joint, and few": [
            (_sheet(6.2, 4.0, lambda ax: drawn.plot_by_price(
                c.by_distance, "norm of the blend shapes beyond 0.2 m of their joint (%)", ax=ax)),
             drawn.caption_by_distance(c.by_distance)),
            (_sheet(6.2, 4.0, lambda ax: drawn.plot_by_price(
                c.by_sparsity, "numbers that are not zero (%)", ax=ax)),
             drawn.caption_by_sparsity(c.by_sparsity)),
        ],
    }  # fmt: skip
    return page(
        "blend_shapes.html",
        title="What skinning gets wrong, and who predicts it",
        comparison=c,
        table=predictor_table(c),
        known=KNOWN,
        sections={
            name: [shown(figure, caption) for figure, caption in some]
            for name, some in figures.items()
        },
        versions=versions(),
    )


def _sheet(width: float, height: float, draw: Any) -> Figure:
    with house_style():
        figure, (ax,) = sheet(width, height)
        draw(ax)
    return figure
