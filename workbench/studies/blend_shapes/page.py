"""The study of predictors as a page, as text, and as data."""

from dataclasses import asdict
from functools import partial
from pathlib import Path

from workbench.reports.page import Columns, Table, page, plotted
from workbench.studies.blend_shapes import figures
from workbench.studies.blend_shapes.predictors import Result, repaired
from workbench.studies.blend_shapes.study import PredictorStudy
from workbench.studies.pages import text_of, write_study

REMARKS = (
    "The teacher is synthetic: a finer rig, which spreads twist along the limbs, blended by dual "
    "quaternions. That DQB does well is partly because the teacher blends in the same way; on "
    "measured people it would have no such advantage. Only the poses come from people.",
    "“Repaired” is the share of the mean distance of linear blending alone that is gone. "
    "“Parameters” counts the fitted numbers that are not zero, beside template and weights. The "
    "time is the least that one pose took: features and skinning by CasADi, the product between "
    "them by NumPy or, where most numbers are zero, by SciPy.",
)


def predictor_table(study: PredictorStudy) -> Table:
    """All predictors, the best first."""
    columns: Columns[Result] = {
        "": lambda r: str(1 + study.results.index(r)),
        "predictor": lambda r: r.name,
        "parameters": lambda r: f"{r.parameters:,}",
        "mean mm": lambda r: f"{r.accuracy.mean:.2f}",
        "rms mm": lambda r: f"{r.accuracy.rms:.2f}",
        "max mm": lambda r: f"{r.accuracy.largest:.1f}",
        "repaired": lambda r: f"{repaired(r, study.results):.0%}".replace("-", "−"),
        "ms": lambda r: f"{r.accuracy.milliseconds:.2f}",
    }
    return Table.of(study.results, columns, (0, 2, 3, 4, 5, 6, 7))


def table_text(study: PredictorStudy) -> str:
    """The table for a terminal."""
    return text_of(predictor_table(study))


def write_predictor_study(study: PredictorStudy, folder: str | Path) -> Path:
    """Write the folder of a study and return its page; whole or not at all."""
    data = {"kind": "blend shapes", "name": "blendshapes", **asdict(study)}
    return write_study(folder, predictor_page(study), table_text(study), data, {})


def predictor_page(s: PredictorStudy) -> str:
    """The page as HTML."""
    caption_predictors = partial(figures.caption_predictors, test=s.test, n_test=s.n_test)
    far = "norm of the blend shapes beyond 0.2 m of their joint (%)"
    nonzero = "numbers that are not zero (%)"
    sections = {
        "The error of each predictor": [
            plotted(8.0, 5.2, figures.plot_predictors, caption_predictors, s.results)
        ],
        "Interpolation between examples": [
            plotted(6.2, 4.0, figures.plot_by_examples, figures.caption_by_examples, s.by_examples),
            plotted(6.2, 4.0, figures.plot_by_factor, figures.caption_by_factor, s.by_factor),
        ],
        "Which function of theta": [
            plotted(7.0, 4.0, figures.plot_by_angle, figures.caption_by_angle, s.by_angle)
        ],
        "Local and sparse blend shapes": [
            plotted(6.2, 4.0, partial(figures.plot_by_penalty, what=name), caption, rows)
            for rows, name, caption in (
                (s.by_distance_penalty, far, figures.caption_by_distance_penalty),
                (s.by_group_penalty, nonzero, figures.caption_by_group_penalty),
            )
        ],
    }
    return page(
        "blend_shapes.html",
        title="What skinning gets wrong, and which predictor repairs it",
        study=s,
        table=predictor_table(s),
        remarks=REMARKS,
        sections=sections,
    )
