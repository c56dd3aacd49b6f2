"""The pages of a run and of a fitted clip, and their tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from workbench import plots
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics import Diagnosis
from workbench.errors import joined, some_of
from workbench.experiments.running import Outcome, ending_in_words
from workbench.fitting.doubts import doubts
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.measures import Measurement
from workbench.fitting.setup import Measure, Moving, Setup
from workbench.geometry.meshes import Mesh, write_mesh
from workbench.plots.body import distances_sheet
from workbench.plots.solutions import convergence_sheet
from workbench.reports.diagnosis import directions_table, gathered_directions_table, terms_table
from workbench.reports.folder import SUMMARY, Content, write_folder
from workbench.reports.page import (
    Columns,
    Shown,
    Table,
    drawn,
    number,
    of_solvers,
    page,
    plotted,
    shown,
    sparsity_figure,
    spectrum,
    unit_text,
)
from workbench.reports.replay import recorded_frames, recorded_run
from workbench.residuals import Residual
from workbench.solvers import Hypothesis, Solution, Status
from workbench.solvers.starts import AS_GOOD
from workbench.writing import write_arrays

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
        mesh = Mesh(surface, body.faces, *body.texture)
        contents["body.glb"] = lambda path: write_mesh(path, mesh)
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
    advice, message = ending_in_sentences(solution)
    return page(
        "run.html",
        title=outcome.name,
        outcome=outcome,
        setup=outcome.setup,
        solution=solution,
        diagnosis=diagnosis,
        truth=truth_name(outcome),
        measures=measures_table(outcome.measures),
        measurements=measurements_table(outcome.measurements),
        status=solution.status.name.lower().replace("_", " "),
        better=better_sentence(outcome),
        interrupted=interruption_sentence(outcome),
        advice=advice,
        message=message,
        residuals=residuals_table(outcome),
        priors=priors_sentence(outcome),
        cost=number(solution.cost, 6),
        optimality=number(solution.optimality, 2),
        overlays=[
            plotted(4.8, 6.2, plots.plot_overlay, plots.caption_overlay, outcome, i)
            for i in range(len(outcome.overlays))
        ],
        seen=LEAST_CONFIDENCE,
        distances=distance_figure(outcome),
        convergence=of_solvers(
            drawn(convergence_sheet, plots.caption_convergence, outcome.compared)
        ),
        solvers=solvers_table(outcome),
        hypotheses=hypotheses_table(solution),
        condition=number(diagnosis.condition, 3),
        sparsity=sparsity_figure(diagnosis),
        terms=terms_table(diagnosis),
        spectrum=spectrum(diagnosis),
        directions=directions_table(diagnosis),
        alone=data_alone(outcome),
        values=value_tables(outcome),
        files=files,
        recording=recorded_run(outcome),
    )


def data_alone(outcome: Outcome) -> dict[str, object] | None:
    """The diagnosis of the data alone, or None if there are no priors."""
    diagnosis = outcome.data_alone
    if diagnosis is None:
        return None
    return {
        "priors": joined(outcome.setup.priors),
        "diagnosis": diagnosis,
        "spectrum": spectrum(diagnosis),
        "directions": directions_table(diagnosis),
        "weak": gathered_directions_table(diagnosis.weak_directions, "characteristic scale"),
    }


def distance_figure(outcome: Outcome) -> Shown | None:
    """The distances to the true surface, or None if it is not known."""
    truth, surface, body = outcome.setup.truth, outcome.surface, outcome.setup.body
    if truth is None or surface is None or body is None:
        return None
    distances = 1e3 * np.linalg.norm(surface - truth, axis=1)  # mm
    called = truth_name(outcome)
    figure = distances_sheet(surface, distances, body.faces, called)
    return shown(figure, plots.caption_distances(distances, called))


def truth_name(outcome: Outcome) -> str:
    """What the true surface is called: `synthetic truth` if the data are synthetic."""
    return "synthetic truth" if outcome.setup.synthetic else "truth"


def arrays(outcome: Outcome) -> dict[str, Array]:
    """Every block under its own name, and per view `projected:`, `observed:` (M, 2) px and
    `confidence:` (M,), exactly as drawn; `surface` (N, 3) m where there is a body.
    """
    by_name: dict[str, Array] = {}
    if outcome.surface is not None:
        by_name["surface"] = outcome.surface
    for overlay in outcome.overlays:
        by_name[f"projected:{overlay.view.name}"] = overlay.projected
        by_name[f"observed:{overlay.view.name}"] = overlay.view.observed
        by_name[f"confidence:{overlay.view.name}"] = overlay.view.confidence
    return by_name | {name: np.asarray(value) for name, value in outcome.values.items()}


def run_summary(outcome: Outcome) -> dict[str, Any]:
    """How a run ended, what it measured, and what it ran on."""
    data_alone, priors = outcome.data_alone, list(outcome.setup.priors)
    return {
        "kind": "run",
        "name": outcome.name,
        "synthetic": outcome.setup.synthetic,
        "warnings": list(outcome.doubts),
        "notes": list(outcome.setup.notes),
        **_solution_summary(outcome.solution),
        "solver": outcome.solver,
        "better": outcome.better,
        "best_cost": outcome.best_cost,
        **_rank_summary(outcome.diagnosis),
        "data_alone": None
        if data_alone is None
        else {"without": priors, **_rank_summary(data_alone)},
        "costs": dict(outcome.costs),
        "priors": priors,
        "measures": [asdict(measure) for measure in outcome.measures],
        "measurements": measurements_summary(outcome.measurements),
        "compared": {
            name: _solution_summary(solution) | {"excess": outcome.excess(name)}
            for name, solution in outcome.compared.items()
        },
        "interrupted": outcome.interrupted,
        "skipped": list(outcome.skipped),
    }


def _rank_summary(diagnosis: Diagnosis) -> dict[str, int]:
    rows, unknowns = diagnosis.shape
    return {"rows": rows, "unknowns": unknowns, "rank": diagnosis.rank}


def _solution_summary(solution: Solution) -> dict[str, Any]:
    return {
        "status": solution.status.name,
        "message": solution.message,
        "cost": solution.cost,
        "optimality": solution.optimality,
        "iterations": solution.iterations,
        "evaluations": asdict(solution.evaluations),
        "seconds": solution.seconds,
    }


SMALL_BLOCK = 24  # entries of a block that is listed number by number
MOST_STARTS = 12  # that are listed by number


def measures_table(measures: tuple[Measure, ...]) -> Table:
    """The measures with their units, and what each is a mean over."""
    rows = tuple((m.name, number(m.value), unit_text(m.unit), m.over) for m in measures)
    return Table(("measure", "value", "unit", "mean over"), rows)


def measurements_table(measurements: Sequence[Measurement]) -> Table:
    """The measurements of a person, and what is known of each with and without the priors."""
    columns: dict[str, Callable[[Measurement], str]] = {
        "measurement": lambda m: m.name,
        "m": lambda m: f"{m.value:.3f}",
        "90 %, m": lambda m: _between(*m.interval),
    }
    if any(np.isfinite(m.prior_sd) for m in measurements):
        columns["contraction"] = lambda m: f"{m.contraction:.2f}"
    return Table.of(measurements, columns, (1, 2, 3))


def measurements_summary(measurements: Sequence[Measurement]) -> list[dict[str, Any]]:
    """The same for programs, in m."""
    return [asdict(m) | {"contraction": m.contraction} for m in measurements]


def _between(low: float, high: float) -> str:
    return f"{low:.3f} to {high:.3f}" if np.isfinite(low) else "not determined"


def residuals_table(outcome: Outcome) -> Table:
    """The part of the cost that each residual makes up, and which residuals are priors."""
    setup, costs, whole = outcome.setup, outcome.costs, sum(outcome.costs.values())
    columns: Columns[Residual] = {
        "residual": lambda r: r.name,
        "kind": lambda r: "prior" if r.name in setup.priors else "data",
        "rows": lambda r: f"{r.size:,}",
        "sigma": lambda r: _sigma(r.sigma),
        "unit": lambda r: unit_text(r.unit),
        "cost": lambda r: number(costs[r.name]),
        "share": lambda r: f"{costs[r.name] / whole:.1%}" if whole else "–",
    }
    return Table.of(setup.problem.residuals, columns, (2, 3, 5, 6))


def priors_sentence(outcome: Outcome) -> str:
    """Which residuals are priors, and their share of the cost, in a sentence."""
    priors = outcome.setup.priors
    if not priors:
        return "The setup names no residual as a prior."
    prior, make = ("prior", "makes") if len(priors) == 1 else ("priors", "make")
    share = f"{outcome.prior_share:.1%}" if math.isfinite(outcome.prior_share) else "nothing"
    return f"The {prior}, {joined(priors)}, {make} up {share} of the cost at the end."


def better_sentence(outcome: Outcome) -> str:
    """That another solver found a lower cost, and by how much; empty if none did."""
    if outcome.better is None:
        return ""
    own, other = outcome.solution.cost, outcome.compared[outcome.better].cost
    return (
        f"{outcome.better} found a lower cost from the same start: {number(other, 6)}, which is "
        f"{number(own - other)} ({(own - other) / own:.1%}) less than {outcome.solver} found. This "
        "is not the lowest cost known."
    )


def interruption_sentence(outcome: Outcome) -> str:
    """That an interrupt ended the run early, and what is missing; empty if none did."""
    if not outcome.interrupted:
        return ""
    lacks = f"; not run: {', '.join(outcome.skipped)}" if outcome.skipped else ""
    what = "run" if outcome.solution.status is Status.STOPPED else "comparison of solvers"
    return f"The {what} was cut short from the keyboard{lacks}."


def status_in_words(outcome: Outcome, solver: str) -> str:
    """How a solver ended, in words: `converged, not lowest` if another one found a lower cost."""
    return ending_in_words(outcome.compared[solver].status, outcome.excess(solver) > AS_GOOD)


def solvers_table(outcome: Outcome) -> Table:
    """How each solver ended, and with which cost and time."""
    columns: Columns[tuple[str, Solution]] = {
        "solver": lambda of: of[0],
        "status": lambda of: status_in_words(outcome, of[0]),
        "seconds": lambda of: f"{of[1].seconds:.2f}",
        "cost": lambda of: number(of[1].cost, 8),
        "above the best": lambda of: number(outcome.excess(of[0]), 2),
        "optimality": lambda of: number(of[1].optimality, 2),
        "iterations": lambda of: str(of[1].iterations),
        "evaluations": lambda of: str(of[1].evaluations.total),
    }
    return Table.of(outcome.compared.items(), columns, tuple(range(2, 8)))


def ending_in_sentences(solution: Solution) -> tuple[str, str]:
    """How a run ended: what its status means, and what the solver adds to that.

    The message of a converged run says what was verified, which is less if the gradient tolerance
    is large.
    """
    advice, message = solution.status.value, solution.message
    if message.startswith(advice):
        return advice, message.removeprefix(advice).lstrip("; ")
    return (message, "") if solution.converged else (advice, message)


def hypotheses_table(solution: Solution) -> Table:
    """The minima that several starts led to."""
    columns: Columns[tuple[int, Hypothesis]] = {
        "minimum": lambda of: str(of[0]),
        "cost": lambda of: number(of[1].cost, 8),
        "starts": lambda of: str(len(of[1].starts)),
        "their numbers": lambda of: some_of(list(map(str, sorted(of[1].starts))), MOST_STARTS),
        "best run": lambda of: ending_in_words(of[1].status, of[0] > 1),
    }
    return Table.of(enumerate(solution.hypotheses, 1), columns, (0, 1, 2))


def value_tables(outcome: Outcome) -> list[Table]:
    """The unknowns of each small block, one by one."""
    tables = []
    for block in outcome.diagnosis.free.blocks:
        if block.size <= SMALL_BLOCK:
            rows = tuple(
                (block.name + block.entry(i), number(float(value)))
                for i, value in enumerate(block.taken(outcome.values[block.name]).ravel())
            )
            tables.append(Table((block.name, f"value {unit_text(block.unit)}".rstrip()), rows))
    return tables


def _sigma(sigma: float | np.ndarray) -> str:
    low, high = float(np.min(sigma)), float(np.max(sigma))
    return number(low, 3) if low == high else f"{number(low, 3)} to {number(high, 3)}"


VIDEO_FILES = {
    "index.html": "this page",
    "motion.npz": "poses (T, K, 3) rad, trans (T, 3) m, betas, fps, and the names of joints",
    SUMMARY: "how the fit ended, for programs",
}


def motion_arrays(moving: Moving, values: Values) -> dict[str, Array]:
    """The arrays of `motion.npz`, which `read_motion` reads."""
    pose, betas, trans = (values[block.name] for block in moving.body.blocks())
    return {
        "poses": pose,
        "trans": trans,
        "betas": betas,
        "fps": np.array(moving.fps),
        "joint_names": np.array(moving.body.joint_names),
        "up_axis": np.array("y"),
    }


def write_video(
    setup: Setup, solution: Solution, folder: str | Path, title: str, source: str
) -> Path:
    """Write the folder of a fitted clip, and return its page `index.html`; raises BadFile."""
    values = {**setup.start, **solution.values}
    moving = setup.moving
    assert moving is not None  # a fit of a clip says what moves
    motion = motion_arrays(moving, values)
    measures, doubted = setup.measures(values), doubts(setup, values, solution)
    text = page(
        "video.html",
        title=title,
        setup=setup,
        solution=solution,
        status=solution.status.name.lower().replace("_", " "),
        said="; ".join(text for text in ending_in_sentences(solution) if text),
        cost=number(solution.cost, 6),
        measures=measures_table(measures),
        doubted=doubted,
        files=VIDEO_FILES,
        recording=recorded_frames(setup, values),
    )
    contents: dict[str, Content] = {
        "index.html": text,
        "motion.npz": lambda path: write_arrays(path, motion),
    }
    summary = {
        "kind": "video",
        "status": solution.status.name,
        "cost": solution.cost,
        "frames": len(motion["poses"]),
        "warnings": list(doubted),
        "notes": list(setup.notes),
        "measures": [{"name": m.name, "value": m.value, "unit": m.unit} for m in measures],
    }
    return write_folder(folder, source, contents, summary)
