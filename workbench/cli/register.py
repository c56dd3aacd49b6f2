"""`workbench register` and `workbench coregister`: scans, one, many or together."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.body import Body
from workbench.bodies.catalogue import load_body
from workbench.cli import interrupts_say
from workbench.cli.console import (
    Bars,
    Up,
    at_least_one,
    comma_separated,
    files_inside,
    folder_to_write,
    print_page,
    rich_table,
    say,
    say_notes,
    warn_of,
    warn_unused,
)
from workbench.cli.options import BodyName, Dask, Workers, executing
from workbench.cli.run import Out
from workbench.cli.train import Lines
from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile, some_of
from workbench.fitting.jobs import FailedFile
from workbench.fitting.scans.files import SCAN_READERS
from workbench.geometry.guesses import UNITS
from workbench.registration import (
    FailedScan,
    Reading,
    Recipe,
    ScanJob,
    jobs_of,
    registered,
    usual_recipe,
)
from workbench.registration.coregistration import (
    Coregistration,
    CoregistrationPlan,
    TriangleCoregistration,
    TrianglePlan,
    bent_as,
)
from workbench.registration.coregistration.coregistering import EDGE_SIGMA, FILE
from workbench.registration.coregistration.folder import open_registered
from workbench.registration.scan_jobs import MOST_POINTS
from workbench.reports.folder import own_folder
from workbench.reports.many import ImageFolder, RegistrationFolder
from workbench.reports.registration import (
    ARRAYS,
    begin_folder,
    stages_table,
    write_coregistration,
    write_registration,
)
from workbench.reports.run import measurements_table
from workbench.training.execution import Execution
from workbench.training.folder import Row, read_table

TEXT_SUFFIXES = (".txt", ".csv")  # in a folder these are taken for notes and tables


def register(
    ctx: typer.Context,
    scans: Annotated[
        list[Path],
        typer.Argument(
            help=f"Scans of one person each ({', '.join(SCAN_READERS)}), or folders of scans."
        ),
    ],
    body: BodyName = "default",
    unit: Annotated[
        str | None,
        typer.Option(
            help=f"Unit of the files ({', '.join(UNITS)}, or a number of m); else it is guessed."
        ),
    ] = None,
    up: Up = None,
    camera: Annotated[
        str | None,
        typer.Option(
            help="Place x,y,z of the camera, in the file's unit and axes, if each scan was taken "
            "from one place; 0,0,0 for most depth cameras."
        ),
    ] = None,
    array: Annotated[
        str | None, typer.Option(help="Name of the array of points, for .npz files.")
    ] = None,
    skeleton: Annotated[
        Path | None,
        typer.Option(
            help="Points (16 or 21, 3) of the joints of a scanned hand (.npz, .npy, .csv), in the "
            "scan's unit and axes; without a scan, use `convert --points hand`."
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(help="Number of points that are used of a larger scan, at random.")
    ] = MOST_POINTS,
    boundary: Annotated[
        float, typer.Option(help="Leave out points within so many m of a scan's boundary.")
    ] = 0.0,
    model: Annotated[
        bool, typer.Option("--model-only", help="Fit the body and leave its vertices as they are.")
    ] = False,
    subjects: Annotated[
        Path | None,
        typer.Option(help="Table (.csv) of file and subject, optionally gender and set."),
    ] = None,
    workers: Workers = 1,
    dask: Dask = None,
    out: Out = Path("runs"),
) -> None:
    """Register scans: fit a body to each from many starts, then free its vertices.

    Writes runs/register-NAME/ with a page, the vertices (.npz) and the surface (.ply); of several
    scans, a folder for each, for `workbench train`. After an interrupt the same command continues.
    """
    console = Console()
    if not 0 <= boundary < math.inf:
        raise BadArgument(f"--boundary takes a width of 0 m or more, not {boundary:g}")
    skeleton = None if skeleton is None else expanded(skeleton)
    reading = Reading(
        unit, up, array, None if camera is None else camera_place(camera), points, skeleton
    )
    scans = [expanded(path) for path in scans]
    template, jobs = load_body(body), jobs_of(_files(console, scans), array)
    recipe = replace(usual_recipe(template), boundary=boundary)
    if model:
        recipe = replace(recipe, vertex_stages=())
    if len(jobs) == 1 and not scans[0].is_dir():
        for_several = ("--subjects", "--workers", "--dask")
        warn_unused(console, ctx, for_several, "it is for several scans")
        _register_one(console, template, body, recipe, reading, jobs[0], out)
        return
    if skeleton is not None:
        raise BadArgument("--skeleton is of one scan; register the scans one by one with it")
    rows = _rows(jobs, subjects)
    source = scans[0].resolve() if len(scans) == 1 else scans[0].resolve().parent
    folder = RegistrationFolder(
        out / f"register-{source.name}", template, body, recipe, reading, str(source), rows
    )
    keys = {job: folder.key(job) for job in jobs}
    work = partial(registered, template, recipe, reading)
    with executing(console, workers, dask) as executor:
        do_missing_jobs(
            console, folder, keys, lambda missing: ([result] for result in executor(work, missing))
        )


def camera_place(text: str) -> tuple[float, float, float]:
    """The place of `--camera`. Raises BadArgument."""
    numbers = comma_separated("--camera", text)
    if len(numbers) != 3:
        raise BadArgument(f"--camera takes x,y,z such as 0,0,0; not {text!r}")
    return numbers[0], numbers[1], numbers[2]


def _register_one(
    console: Console,
    body: Body,
    name: str,
    recipe: Recipe,
    reading: Reading,
    job: ScanJob,
    out: Path,
) -> None:
    """Register one scan and write its folder."""
    folder = folder_to_write(out, f"register-{job.name}", str(job.path.resolve()))
    with Bars(console) as bars:
        scan_fit = registered(
            body,
            recipe,
            reading,
            job,
            lambda at: bars(f"stage {at.stage} of {at.stages}, starts", at.start - 1, at.starts),
        )
    if isinstance(scan_fit, FailedScan):
        raise BadFile(scan_fit.reason)
    say_notes(console, scan_fit.notes)
    warn_of(console, scan_fit.registration.doubts)
    console.print(rich_table(stages_table(scan_fit.registration)))
    if scan_fit.registration.measurements:
        console.print(rich_table(measurements_table(scan_fit.registration.measurements)))
    source = str(job.path.resolve())
    print_page(console, "report", write_registration(scan_fit, folder, body=name, source=source))


def _files(console: Console, paths: list[Path]) -> list[Path]:
    """The files of scans that were given, those in folders in the order of their names."""
    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        files += files_inside(console, path, {*SCAN_READERS} - {*TEXT_SUFFIXES}, "scans")
    return list(dict.fromkeys(files))


def _rows(jobs: tuple[ScanJob, ...], subjects: Path | None) -> dict[str, Row]:
    """The line of each scan in the table of subjects, by the scan's name."""
    listed = (
        {} if subjects is None else {row.file: row for row in read_table(subjects, SCAN_READERS)}
    )
    names = {job.path.name for job in jobs}
    if unknown := [file for file in listed if file not in names]:
        raise BadFile(f"{subjects} names files that are not among the scans: {some_of(unknown)}")
    if listed and (missing := sorted(names - set(listed))):
        raise BadFile(f"{subjects} has no line for {some_of(missing)}")

    def row(job: ScanJob) -> Row:
        file, line = f"{job.name}/{ARRAYS}", listed.get(job.path.name)
        if line is None:
            return Row(file, job.name)
        return Row(file, line.subject, line.gender, line.set)

    return {job.name: row(job) for job in jobs}


def do_missing_jobs(
    console: Console,
    folder: ImageFolder | RegistrationFolder,
    keys: Mapping[Any, str],
    work: Callable[[Sequence[Any]], Iterable[Sequence[Any]]],
) -> None:
    """Do the jobs that the folder does not hold under their keys, and finish it.

    `work` yields the results of some jobs at a time, or why a file failed. Exits with 1 if a file
    failed, and raises Interrupted after Ctrl-C.
    """
    files, done = folder.FILES, folder.DONE  # scans are registered
    kept = {job.name: folder.kept(job, key) for job, key in keys.items()}
    entries = {name: entry for name, entry in kept.items() if entry is not None}
    failed: list[FailedFile] = []
    if entries:
        say(console, f"{len(entries)} of {len(keys)} {files} are {done} already")

    def interruption() -> str:
        return (
            f"interrupted; {len(entries)} of {len(keys)} {files} are {done} in {folder.place}, and "
            "the same command continues with the others"
        )

    with interrupts_say(interruption):
        with Bars(console) as bars:
            bars(files, len(entries), len(keys))
            for some in work([job for job in keys if job.name not in entries]):
                for result in some:
                    name = result.job.name
                    if isinstance(result, FailedFile):
                        failed.append(result)
                        why = escape(result.reason)
                        say(console, f"[bold yellow]not {done}:[/] {escape(name)}: {why}")
                    else:
                        entries[name] = folder.keep(result, keys[result.job])
                bars(files, len(entries) + len(failed), len(keys))
        page = folder.finish([entries[job.name] for job in keys if job.name in entries], failed)
    for name, entry in entries.items():
        warn_of(console, entry.facts.get("warnings", ()), f"{name}: ")
    print_page(console, "report", page)
    if failed:
        say(console, f"{len(failed)} of {len(keys)} {files} could not be {done}")
        raise typer.Exit(1)


def coregister(
    ctx: typer.Context,
    folder: Annotated[
        Path,
        typer.Argument(help="Folder that `workbench register SCANS/ --subjects TABLE.csv` wrote."),
    ],
    rounds: Annotated[
        int,
        typer.Option(callback=at_least_one, help="Number of rounds of registrations and model."),
    ] = CoregistrationPlan().rounds,
    model: Annotated[
        Literal["smpl", "blend-scape"],
        typer.Option(help="The model that couples the scans; blend-scape acts on triangles."),
    ] = "smpl",
    coupling: Annotated[
        float | None,
        typer.Option(
            help="Sigma of a registered vertex (smpl) or edge (blend-scape) from the model's, per "
            f"coordinate, in m; else {CoregistrationPlan().sigmas.data:g} or "
            f"{TrianglePlan().coupling:g}."
        ),
    ] = None,
    edges: Annotated[
        float, typer.Option(help="Sigma of a template's edges beyond what betas explain, in m.")
    ] = EDGE_SIGMA,
    betas: Annotated[
        int, typer.Option(callback=at_least_one, help="Number of shape directions.")
    ] = 10,
    workers: Workers = 1,
    dask: Dask = None,
    out: Out = Path("runs"),
) -> None:
    """Coregister scans: registrations, poses, a template for each person and the model, together.

    Writes runs/coregister-NAME/ with a page, the body, and the registrations, which `workbench
    train` takes as they are. If it is interrupted or killed, the same command continues after the
    last block that ended.
    """
    console = Console()
    for option, length in (("--coupling", coupling), ("--edges", edges)):
        if length is not None and not 0 < length < 1:
            raise BadArgument(f"{option} takes a length in m above 0 and below 1, not {length:g}")
    folder = expanded(folder)
    body, scans = open_registered(folder)
    fits = [scans.fitted(j, body) for j in range(len(scans.rows))]
    problem: Coregistration | TriangleCoregistration
    run: Callable[..., Any]
    if model == "blend-scape":
        warn_unused(console, ctx, ("--edges",), "it is of vertices, and the model of triangles")
        triangles = TrianglePlan(rounds)
        triangles = replace(triangles, coupling=coupling or triangles.coupling)
        problem = TriangleCoregistration(bent_as(body, fits, triangles), scans, triangles)
        alone = np.stack([scans.registration(j, body) for j in range(len(fits))])
        run = partial(problem.run, fits, alone)
    else:
        plan = CoregistrationPlan(rounds, edges=edges)
        sigmas = replace(plan.sigmas, data=coupling or plan.sigmas.data)
        problem = Coregistration(body, scans, replace(plan, sigmas=sigmas))
        run = partial(problem.run, fits)
    name = folder.resolve().name.removeprefix("register-")
    place, source = out / f"coregister-{name}", str(folder.resolve())
    own_folder(place, source)
    begin_folder(place, source)
    if (place / FILE).exists():
        say(console, "continuing after the last block that ended")

    def interruption() -> str:
        if not (place / FILE).exists():
            return f"interrupted before the first block ended; there is nothing in {place} yet"
        return (
            f"interrupted; what was found until the last block is in {place}, and the same command "
            "continues from there"
        )

    with interrupts_say(interruption):
        with executing(console, workers, dask) as executor:
            state = run(folder=place, execution=Execution(executor, Lines(console)))
        page = write_coregistration(body, scans, problem, state, betas, place, source)
    for scan, doubts in scans.doubts().items():
        warn_of(console, doubts, f"{scan}, by itself: ")
    print_page(console, "body", place / "body.npz")
    print_page(console, "report", page)
