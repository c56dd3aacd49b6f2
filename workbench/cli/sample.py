"""`workbench sample`: how well each number of a fit is known, by draws that are judged first."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from workbench import sampling
from workbench.cli.leaving import Interrupted
from workbench.cli.run import Name, Out, Setting, SolverName, make_folder, settings, solver_named
from workbench.cli.without_effect import changes_nothing
from workbench.errors import UnknownName
from workbench.experiments import find
from workbench.reports import refuse_foreign, write_posterior
from workbench.reports.posterior_page import Part, truth_of
from workbench.sampling import MOVES

NOT_CONVERGED = 1  # the exit code if a block is not usable


def sample(
    name: Name = "balance-monocular",
    setting: Setting = None,
    block: Annotated[
        list[str] | None,
        typer.Option(
            help="What to sample together: betas,trans,pose[left_elbow]; `everything`. "
            "May be repeated; else parts of up to 21 entries are chosen."
        ),
    ] = None,
    directions: Annotated[
        int | None, typer.Option(help="Sample so many directions that the data know best instead.")
    ] = None,
    conditional: Annotated[
        bool,
        typer.Option(
            "--conditional", help="Integrate the rest out, by its Gaussian; else it is fixed."
        ),
    ] = False,
    steps: Annotated[int, typer.Option(help="Of each walker, at most.")] = 20_000,
    walkers: Annotated[int | None, typer.Option(help="In each ensemble.")] = None,
    ensembles: Annotated[int, typer.Option(help="Independent ones.")] = 4,
    seed: Annotated[int, typer.Option(help="The same seed gives the same draws.")] = 0,
    move: Annotated[str, typer.Option(help=f"One of {', '.join(MOVES)}.")] = "de",
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Begin anew where draws of an earlier run are.")
    ] = False,
    solver: SolverName = "levenberg-marquardt",
    out: Out = Path("runs"),
) -> None:
    """Sample the posterior of a fit, block by block, and say whether the draws are worth anything.

    Draws are kept in runs/NAME-draws/ while they are made; the same command goes on after an
    interrupt. Exits with 1 if a block is not usable.
    """  # fmt: skip
    console = Console()
    if move not in MOVES:
        raise UnknownName("move", move, MOVES)
    experiment = find(name, settings(setting))
    make_folder(out)
    folder, kept = out / f"{experiment.name}-posterior", out / f"{experiment.name}-draws"
    refuse_foreign(folder, experiment.source)
    make_folder(kept)
    console.print(f"[dim]building {escape(experiment.name)}[/]")
    setup = experiment.setup()
    console.print("[dim]solving[/]")
    solution = solver_named(solver).solve(setup.problem, setup.start)
    said = f"{solution.status.name}, cost {solution.cost:.6g}"
    console.print(f"[dim]{said}: {escape(solution.message)}[/]", soft_wrap=True)
    at = setup.start | solution.values
    problem = setup.problem
    rest = sampling.conditional if conditional else sampling.fixed
    chosen: dict[str, sampling.Names] = {}
    for text in block or ():
        everything = text == "everything"
        chosen[text] = problem.free.names if everything else _names(text)
    if directions is not None:
        chosen[f"{directions} directions"] = sampling.directions(directions, setup.priors)
    if not chosen:
        chosen |= sampling.blocks_of(problem.free, problem.trees)
    if conditional:
        _mind_rests(console, chosen, problem.free.names)
    parts: list[Part] = []
    interrupted = False
    for part, names in chosen.items():
        path = kept / (re.sub(r"[^A-Za-z0-9]+", "-", part).strip("-") + ".h5")
        if fresh:
            path.unlink(missing_ok=True)
        console.print(f"\n[bold]{escape(part)}[/]")
        with _bar(console) as bar:
            task = bar.add_task("sampling", total=steps, info="")

            def tell(progress: sampling.Progress, bar: Bar = bar, task: TaskID = task) -> None:
                bar.update(
                    task, completed=progress.step, info=f"{progress.acceptance:.0%} accepted"
                )

            posterior = sampling.sample(
                problem, at, names, rest=rest, walkers=walkers, steps=steps, ensembles=ensembles,
                seed=seed, moves=MOVES[move](), checkpoint=path, callback=tell,
            )  # fmt: skip
        approximation = sampling.laplace(problem, at, names, rest=rest, seed=seed)
        parts.append(Part(part, posterior, approximation))
        told = sampling.summary(posterior, truth_of(posterior, setup))
        console.print(escape(told), highlight=False, soft_wrap=True)
        _print_beside(console, posterior, approximation)
        if posterior.interrupted:
            interrupted = True
            break
    console.print("[dim]writing the page[/]")
    page = write_posterior(
        parts, folder, title=experiment.name, setup=setup, source=experiment.source
    )
    console.print(f"report: [bold]{escape(str(page))}[/]", soft_wrap=True)
    if interrupted and parts[-1].posterior.unsaved:
        raise Interrupted(
            f"interrupted; these draws are on the page, but not kept to go on with: "
            f"{parts[-1].posterior.unsaved}"
        )
    if interrupted:
        raise Interrupted(f"interrupted; the same command goes on with what {kept} holds")
    if not all(part.posterior.usable for part in parts):
        raise typer.Exit(NOT_CONVERGED)


def _mind_rests(
    console: Console, chosen: Mapping[str, sampling.Names], free: Iterable[str]
) -> None:
    """Where --conditional changes nothing: nothing is left, or directions are sampled."""
    for part, names in chosen.items():
        if callable(names):
            changes_nothing(console, "--conditional", f"beside {part}, the rest never is fixed")
        elif names is None or set(free) <= set(names):
            changes_nothing(console, "--conditional", f"{part} is all that there is to sample")


def _names(text: str) -> tuple[str, ...]:
    """`betas,pose[left_elbow, x]` at the commas that are in no brackets."""
    return tuple(part.strip() for part in re.split(r",(?![^\[]*\])", text) if part.strip())


def _bar(console: Console) -> Bar:
    return Bar(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"),
        TextColumn("{task.fields[info]}"), TimeElapsedColumn(), TimeRemainingColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    )  # fmt: skip


def _print_beside(
    console: Console, posterior: sampling.Posterior, approximation: sampling.Posterior
) -> None:
    """What Laplace's approximation is worth by itself, and where it does not do."""
    console.print(
        f"Laplace's approximation by itself: {escape(approximation.verdict)}",
        highlight=False, soft_wrap=True,
    )  # fmt: skip
    rows = sampling.beside_laplace(posterior, approximation)
    unlike = [row for row in rows if row.said != "agrees"]
    if not posterior.mixed:
        return
    console.print(
        f"Laplace's approximation agrees in {len(rows) - len(unlike)} of {len(rows)} entries",
        highlight=False,
    )
    for row in unlike:
        console.print(
            f"  {escape(row.label)}: {row.said} (sd {row.ratio:.2f} times Laplace's, mean "
            f"{row.shift:+.2f} of them off)",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
