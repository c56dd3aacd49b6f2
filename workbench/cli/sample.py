"""`workbench sample`: draws from a posterior."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from workbench import sampling
from workbench.blocks.layout import entries
from workbench.cli import Interrupted, interrupts_say
from workbench.cli.console import Bars, print_page, rich_table, say, warn_of
from workbench.cli.run import Name, Out, Setting, SolverName, prepare, solve_setup, solver_named
from workbench.fitting.measures import measured_in, person_of
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.reports import write_posterior
from workbench.reports.folder import make_folder
from workbench.reports.page import Table
from workbench.reports.posterior import BlockPosterior, anchors, contradictions, posterior_text
from workbench.solvers import DEFAULT

EXIT_NOT_USABLE = 1  # the exit code if a block is not usable


def sample(
    name: Name = "balance-monocular",
    setting: Setting = None,
    block: Annotated[
        list[str] | None,
        typer.Option(
            help="What to sample together, such as betas,trans,pose[left_elbow], or everything. "
            "May be repeated; without it, parts of up to 21 entries are chosen."
        ),
    ] = None,
    conditional: Annotated[
        bool,
        typer.Option("--conditional", help="Hold the other unknowns fixed, as if known exactly."),
    ] = False,
    steps: Annotated[int, typer.Option(help="Largest number of steps of each walker.")] = 20_000,
    walkers: Annotated[int | None, typer.Option(help="Number of walkers in each ensemble.")] = None,
    ensembles: Annotated[int, typer.Option(help="Number of independent ensembles.")] = 4,
    seed: Annotated[int, typer.Option(help="The same seed gives the same draws.")] = 0,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Begin anew, even if an earlier run left draws.")
    ] = False,
    solver: SolverName = DEFAULT,
    out: Out = Path("runs"),
) -> None:
    """Sample the posterior of a fit, block by block, and judge whether the draws can be used.

    Draws are saved in runs/NAME-draws/ while they are made; after an interrupt the same command
    continues from them. The exit code is 1 if a block is not usable.
    """
    console = Console()
    experiment, setup, folder = prepare(console, name, setting, out, "posterior")
    draws = out / f"{experiment.name}-draws"
    make_folder(draws)
    values, _ = solve_setup(console, setup, solver_named(solver))
    problem = setup.problem
    rest = sampling.fixed if conditional else sampling.integrated
    blocks = _blocks(problem, block or ())
    parts: list[BlockPosterior] = []

    def interruption() -> str:
        if not any(draws.iterdir()):
            return "interrupted; nothing was written"
        return f"interrupted; {draws} holds the draws, and the same command continues with them"

    with interrupts_say(interruption):
        for (part, names), file in zip(blocks.items(), anchors(blocks), strict=True):
            path = draws / f"{file}.npz"
            if fresh:
                path.unlink(missing_ok=True)
            console.print(f"\n[bold]{escape(part)}[/]")
            with Bars(console) as bars:

                def tell(progress: sampling.SamplingProgress, bars: Bars = bars) -> None:
                    by = "Hamiltonian Monte Carlo" if progress.all_free else "sampling"
                    bars(by, progress.step, progress.steps)

                posterior = sampling.sample(
                    problem,
                    values,
                    names,
                    rest=rest,
                    walkers=walkers,
                    steps=steps,
                    ensembles=ensembles,
                    seed=seed,
                    checkpoint=path,
                    callback=tell,
                )
            approximation = sampling.laplace(
                problem, values, names, rest=rest, seed=seed, against=posterior
            )
            parts.append(BlockPosterior(part, posterior, approximation))
            say(console, escape(posterior.judgement[0].value))
            if posterior.interrupted:
                break
        console.print()
        warn_of(console, contradictions(setup, [part.posterior for part in parts]))
        say(console, escape(posterior_text(parts, setup)))
        _print_measurements(console, [part.posterior for part in parts], setup)
        console.print("[dim]writing the page[/]")
        page = write_posterior(
            parts, folder, title=experiment.name, setup=setup, source=experiment.source
        )
        print_page(console, "report", page)
    last = parts[-1].posterior
    if last.interrupted and last.unsaved:
        raise Interrupted(
            f"interrupted; these draws are on the page, but could not be saved to continue from: "
            f"{last.unsaved}"
        )
    if last.interrupted:
        raise Interrupted(f"interrupted; the same command continues with what {draws} holds")
    if not all(part.posterior.usable for part in parts):
        raise typer.Exit(EXIT_NOT_USABLE)


def _blocks(problem: Problem, texts: Sequence[str]) -> dict[str, sampling.Names]:
    """The entries to sample together, by the texts that name them; without texts, the usual ones.

    `betas,pose[left_elbow, x]` is split at the commas that are in no brackets.
    """
    if not texts:
        return dict(sampling.sampling_blocks(problem.free, problem.trees))
    blocks: dict[str, sampling.Names] = {}
    for text in texts:
        parts = [part.strip() for part in re.split(r",(?![^\[]*\])", text)]
        everything = text == "everything"
        blocks[text] = problem.free.names if everything else tuple(filter(None, parts))
    return blocks


def _print_measurements(
    console: Console, posteriors: list[sampling.Posterior], setup: Setup
) -> None:
    """The measurements of the person, from the first usable draws that have all betas in them."""
    body, free = person_of(setup.body, setup.problem), setup.problem.free
    if body is None:
        return
    betas = free.labels_of(entries(free, body.blocks()[1].name))
    for posterior in posteriors:
        if posterior.usable and set(betas) <= set(posterior.labels):
            measurements = measured_in(posterior, body)
            rows = []
            for name, metres in measurements.items():
                low, median, high = np.quantile(metres, (0.05, 0.5, 0.95))
                rows.append((name, f"{median:.3f}", f"{low:.3f} to {high:.3f}"))
            console.print("\n[bold]measurements[/]")
            console.print(rich_table(Table(("measurement", "median, m", "90 %, m"), tuple(rows))))
            return
