"""A clip of the user, fitted and written as a page with its motion: `workbench fit --video`."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.cli.image_mean import FILE, drawing
from workbench.cli.leaving import Interrupted
from workbench.cli.output import folder_to_write, print_page, warn_of
from workbench.cli.progress import LiveTrace
from workbench.fitting.doubts import doubts
from workbench.fitting.observations import Clip
from workbench.fitting.videos import video_fit, video_mean
from workbench.reports.run import motion_arrays, write_video
from workbench.solvers import Solver, Status
from workbench.writing import write_arrays


def fit_video(
    console: Console,
    source: Path,
    clip: Clip,
    body: SkinnedBody | TriangleBody,
    sigma: float | None,
    solver: Solver,
    out: Path,
    mean: bool,
) -> None:
    """Fit all frames of a clip together, and write the page.

    With `mean`, the folder gets `mean.npz` as well, the mean of the posterior as a motion. After an
    interrupt the page holds the motion that was found until then, and the exit code is 130.
    """
    folder = folder_to_write(out, source.resolve().name, str(source.resolve()))
    question = f"Which shape and which motion explain the {clip.count} frames of {source}?"
    with console.status("") as status:
        setup = video_fit(
            clip,
            body,
            question,
            sigma=sigma,
            told=lambda done, all_: status.update(f"frame {done} of {all_}"),
        )
    for note in setup.notes:
        console.print(f"[dim]{escape(note)}.[/]", highlight=False)
    console.print(f"[dim]fitting {clip.count} frames together[/]", highlight=False)
    with LiveTrace(console) as trace:
        solution = solver.solve(setup.problem, setup.start, callback=trace)
    values = {**setup.start, **solution.values}
    warn_of(console, doubts(setup, values, solution))
    console.print(f"{solution.status.name}: {escape(solution.message)}", highlight=False)
    for one in setup.measures(values):
        console.print(f"{escape(one.name)}: {one.value:.4g} {one.unit}", highlight=False)
    title = source.resolve().name
    page = write_video(setup, solution, folder, title, str(source.resolve()))
    (folder / FILE).unlink(missing_ok=True)  # of an earlier fit
    print_page(console, "report", page)
    if solution.status is Status.STOPPED:
        raise Interrupted("interrupted; the page holds the motion that was found until then")
    if mean and setup.moving is not None:
        with drawing(folder) as file, console.status("") as status:
            expected = video_mean(
                setup,
                values,
                told=lambda done, all_: status.update(f"drawing: frame {done} of {all_}"),
            )
        write_arrays(file, motion_arrays(setup.moving, expected))
        console.print(f"mean: {file}", highlight=False, soft_wrap=True)
