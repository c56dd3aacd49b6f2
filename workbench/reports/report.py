"""A run as a folder: one page with the figures in it, and the numbers beside it."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from workbench import plots
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.capsules import posed_capsules
from workbench.bodies.forward.sources import arguments_from_values
from workbench.diagnostics import Diagnosis
from workbench.errors import joined
from workbench.experiments.running import Outcome
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.geometry.meshes import write_mesh
from workbench.plots import sheets
from workbench.replay import recorded_run
from workbench.reports import tables
from workbench.reports.figures import Shown, drawn, of_solvers, plotted, shown, spectrum
from workbench.reports.folder import SUMMARY, Content, write_folder
from workbench.reports.moving import moving_figures
from workbench.reports.page import page
from workbench.solvers import Solution
from workbench.writing import write_arrays

MOST_SHOWN = 6  # stages, or hypotheses, that are drawn side by side
FILES = {
    "index.html": "this page",
    "values.npz": "every block by its name, free and fixed, and the points drawn in each view",
    "solution.npz": "the solution with its trace, for Solution.load",
    "body.glb": "the fitted, posed body, in metres",
    "diagnosis.txt": "the diagnosis with and without the priors, as text",
    SUMMARY: "how the run ended, for programs",
}


def write_report(outcome: Outcome, folder: str | Path) -> Path:
    """Write the folder of a run, and return its page `index.html`.

    The folder appears whole or not at all: whatever interrupts the writing, a previous report
    stays. Raises BadFile if the place cannot be written or holds something else.
    """
    body, surface = outcome.setup.body, outcome.surface
    contents: dict[str, Content] = {
        "values.npz": lambda path: write_arrays(path, arrays(outcome)),
        "solution.npz": outcome.solution.save,
        "diagnosis.txt": diagnosis_text(outcome),
    }
    if body is not None and surface is not None:
        contents["body.glb"] = lambda path: write_mesh(path, surface, body.faces)
    present = {*contents, "index.html", SUMMARY}
    files = {name: text for name, text in FILES.items() if name in present}
    contents["index.html"] = run_page(outcome, files)
    return write_folder(folder, outcome.source, contents, run_summary(outcome))


def diagnosis_text(outcome: Outcome) -> str:
    """The diagnosis with and without the priors, as text."""
    text = f"{outcome.diagnosis}\n"
    if outcome.data_alone is not None:
        heading = f"The data alone, without {joined(outcome.setup.priors)}"
        text += f"\n{heading}\n{'-' * len(heading)}\n{outcome.data_alone}\n"
    return text


def run_page(outcome: Outcome, files: dict[str, str]) -> str:
    """The page of a run."""
    solution, diagnosis = outcome.solution, outcome.diagnosis
    advice, message = tables.ending_said(solution)
    return page(
        "run.html",
        title=outcome.name,
        outcome=outcome,
        setup=outcome.setup,
        solution=solution,
        diagnosis=diagnosis,
        truth=truth_called(outcome),
        measures=tables.measures_table(outcome.measures),
        status=solution.status.name.lower().replace("_", " "),
        better=tables.better_said(outcome),
        interrupted=tables.interrupted_said(outcome),
        advice=advice,
        message=message,
        residuals=tables.residuals_table(outcome),
        priors=tables.priors_said(outcome),
        cost=tables.number(solution.cost, 6),
        optimality=tables.number(solution.optimality, 2),
        overlays=overlay_figures(outcome),
        stages=numbered_figures(
            outcome, len(outcome.stages), plots.plot_stage, plots.caption_stage
        ),
        ends=numbered_figures(
            outcome, len(outcome.hypotheses), plots.plot_hypothesis, plots.caption_hypothesis
        ),
        moving=moving_figures(outcome.setup, outcome.values),
        seen=LEAST_CONFIDENCE,
        distances=distance_figure(outcome),
        capsules=capsule_figure(outcome),
        convergence=of_solvers(
            drawn(sheets.convergence_sheet, plots.caption_convergence, outcome.compared)
        ),
        solvers=tables.solvers_table(outcome),
        minima=minima_figure(solution),
        hypotheses=tables.hypotheses_table(solution),
        condition=tables.number(diagnosis.condition, 3),
        sparsity=drawn(sheets.sparsity_sheet, plots.caption_sparsity, diagnosis),
        terms=tables.terms_table(diagnosis),
        spectrum=spectrum(diagnosis),
        directions=tables.directions_table(diagnosis),
        alone=data_alone(outcome),
        values=tables.value_tables(outcome),
        arrays=tables.array_tables(outcome),
        fixed=tables.fixed_table(outcome),
        files=files,
        recording=recorded_run(outcome),
    )


def minima_figure(solution: Solution) -> Shown | None:
    """Where several starts ended, or None if there was one."""
    if not solution.hypotheses:
        return None
    return plotted(8.0, 3.6, plots.plot_minima, plots.caption_minima, solution)


def data_alone(outcome: Outcome) -> dict[str, object] | None:
    """The diagnosis of the data alone, or None if there are no priors."""
    found = outcome.data_alone
    if found is None:
        return None
    return {
        "priors": joined(outcome.setup.priors),
        "diagnosis": found,
        "spectrum": spectrum(found),
        "directions": tables.directions_table(found),
        "weak": tables.gathered_directions_table(found.weak_directions, "characteristic scale"),
    }


def overlay_figures(outcome: Outcome) -> list[Shown]:
    """The fitted body over the keypoints, one figure per view."""
    views = range(len(outcome.overlays))
    return [plotted(4.8, 6.2, plots.plot_overlay, plots.caption_overlay, outcome, i) for i in views]


def numbered_figures(
    outcome: Outcome,
    count: int,
    plot: Callable[..., object],
    caption: Callable[[Outcome, int], str],
) -> list[Shown]:
    """A figure for each stage or hypothesis; of many hypotheses the first ones."""
    return [plotted(3.8, 5.0, plot, caption, outcome, i) for i in range(min(count, MOST_SHOWN))]


def distance_figure(outcome: Outcome) -> Shown | None:
    """The distances to the true surface, or None if it is not known."""
    truth, surface, body = outcome.setup.truth, outcome.surface, outcome.setup.body
    if truth is None or surface is None or body is None:
        return None
    distances = 1e3 * np.linalg.norm(surface - truth, axis=1)  # mm
    called = truth_called(outcome)
    figure = sheets.distances_sheet(surface, distances, body.faces, called)
    return shown(figure, plots.caption_distances(distances, called))


def capsule_figure(outcome: Outcome) -> Shown | None:
    """The fitted body with its capsules, or None if the problem reads none of them."""
    body, surface, problem = outcome.setup.body, outcome.surface, outcome.setup.problem
    if surface is None or not isinstance(body, SkinnedBody) or body.capsules is None:
        return None
    points = [*problem.points, *(p for c in problem.constraints for p in c.points)]
    read = any(p.source.labels == body.capsules.end_names for p in points)
    arguments = arguments_from_values(body, points, outcome.values)
    if not read or arguments is None:
        return None
    posed = posed_capsules(body, *arguments)
    figure = sheets.capsules_sheet(surface, body.faces, posed)
    return shown(figure, plots.caption_capsules(posed))


def truth_called(outcome: Outcome) -> str:
    """What the true surface is called: `synthetic truth` if the data are synthetic."""
    return "synthetic truth" if outcome.setup.synthetic else "truth"


def arrays(outcome: Outcome) -> dict[str, Array]:
    """Every block under its own name, and per view `projected:`, `observed:` (M, 2) px and
    `confidence:` (M,), exactly as drawn; `surface` (N, 3) m where there is a body.
    """
    found: dict[str, Array] = {}
    if outcome.surface is not None:
        found["surface"] = outcome.surface
    for overlay in outcome.overlays:
        found[f"projected:{overlay.view.name}"] = overlay.projected
        found[f"observed:{overlay.view.name}"] = overlay.view.observed
        found[f"confidence:{overlay.view.name}"] = overlay.view.confidence
    return found | {name: np.asarray(value) for name, value in outcome.values.items()}


def run_summary(outcome: Outcome) -> dict[str, Any]:
    """How a run ended, what it measured, and what it ran on."""
    alone, priors = outcome.data_alone, list(outcome.setup.priors)
    return {
        "kind": "run",
        "name": outcome.name,
        "synthetic": outcome.setup.synthetic,
        "warnings": list(outcome.doubts),
        "notes": list(outcome.setup.notes),
        **_ending(outcome.solution),
        "solver": outcome.solver,
        "better": outcome.better,
        "best_cost": outcome.best_cost,
        **_seen(outcome.diagnosis),
        "data_alone": None if alone is None else {"without": priors, **_seen(alone)},
        "costs": dict(outcome.costs),
        "priors": priors,
        "measures": [asdict(measure) for measure in outcome.measures],
        "compared": {
            name: _ending(solution) | {"excess": outcome.excess(name)}
            for name, solution in outcome.compared.items()
        },
        "interrupted": outcome.interrupted,
        "skipped": list(outcome.skipped),
    }


def _seen(diagnosis: Diagnosis) -> dict[str, int]:
    rows, unknowns = diagnosis.shape
    return {"rows": rows, "unknowns": unknowns, "rank": diagnosis.rank}


def _ending(solution: Solution) -> dict[str, Any]:
    return {
        "status": solution.status.name,
        "message": solution.message,
        "cost": solution.cost,
        "optimality": solution.optimality,
        "iterations": solution.iterations,
        "evaluations": asdict(solution.evaluations),
        "seconds": solution.seconds,
    }
