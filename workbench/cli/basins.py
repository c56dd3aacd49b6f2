"""`workbench basins`: from which starts a rigid registration ends at the truth."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.console import folder_to_write, print_page, rich_table, say
from workbench.cli.run import Out
from workbench.environment import expanded
from workbench.errors import BadArgument, check_known
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.plots import (
    Figure,
    caption_basin_grid,
    caption_basins,
    plot_basin_grid,
    plot_basins,
    png,
    svg,
)
from workbench.plots.style import drawn
from workbench.registration import (
    BasinMap,
    Icp,
    basin_map,
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
    random_surface_points,
)
from workbench.registration.basins import AXES, grid
from workbench.reports.folder import Content, write_folder
from workbench.reports.page import Table

METHODS = {
    "distance": Icp(distance_gauss_newton),
    "point-to-plane": Icp(point_to_plane, halvings=0),
    "point-to-point": Icp(point_to_point),
}
AxisOption = Annotated[
    list[str] | None,
    typer.Option(
        "--axis",
        help="An axis that starts are turned about, x, y or z; may be repeated, and x,z is a map "
        "of turns about both. Without it, one map for each axis.",
    ),
]


def basins(
    body: Annotated[str, typer.Option(help=f"One of {', '.join(BODIES)}, or a file.")] = "default",
    axis: AxisOption = None,
    step: Annotated[float, typer.Option(help="Degrees between neighbouring starts.")] = 30.0,
    method: Annotated[
        str, typer.Option(help=f"The form of the step: {', '.join(METHODS)}.")
    ] = "distance",
    points: Annotated[int, typer.Option(min=1, help="Number of points of the scan.")] = 1000,
    noise: Annotated[float, typer.Option(min=0, help="Noise of the points, mm.")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the points.")] = 0,
    out: Out = Path("runs"),
) -> None:
    """Map the starts from which rigid ICP finds where a scan of a body belongs.

    The scan is synthetic: points on the body's surface at rest, with noise, whose true place is
    known.
    """
    console = Console()
    check_known("method", method, METHODS)
    if not np.isfinite(noise):
        raise BadArgument(f"--noise must be a finite number of mm, not {noise}")
    maps = [text.split(",") for text in axis or AXES]
    starts = sum(len(grid(axes, step)) for axes in maps)
    if any(len(axes) > 2 for axes in maps):
        raise BadArgument("--axis takes one axis or two, such as x,z; a figure has no third")
    model = load_body(body)
    source = "" if body in BODIES else str(expanded(body).resolve())
    folder = folder_to_write(out, f"basins-{Path(body).stem}", source)
    scan, truth, surface = _made_up(model.template, model.faces, points, noise, seed)
    align = partial(METHODS[method].align, scan, surface)
    found: list[BasinMap] = []
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("registering", total=starts)
        for axes in maps:
            done = partial(_tell, bar, task)
            found.append(
                basin_map(lambda start: align(start), scan, truth, axes, step, progress=done)
            )
    say(console, f"{starts} registrations of {points:,} points to {escape(body)}, {method}")
    console.print(rich_table(_table(found)))
    figures = _figures(found)
    for name, (_, caption) in figures.items():
        say(console, f"[bold]{name}[/]: {escape(caption)}")
    options = {"body": body, "step": step, "method": method, "points": points, "noise": noise}
    summary = {
        "options": options | {"seed": seed},
        "captions": {name: caption for name, (_, caption) in figures.items()},
        "maps": [_facts(one) for one in found],
    }
    write_folder(folder, source, _contents(found, figures), summary)
    for name in figures:
        print_page(console, "figure", folder / f"{name}.png")


def _made_up(
    vertices: Any, faces: Any, count: int, noise: float, seed: int
) -> tuple[Any, Similarity, SurfaceTree]:
    """The scan (count, 3) m, away from where it belongs; the motion to there; and the surface."""
    rng = np.random.default_rng(seed)
    right, _ = random_surface_points(vertices, faces, count, rng)
    right = right + 1e-3 * noise * rng.normal(size=right.shape)
    truth = Similarity(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3))
    return truth.inverse()(right), truth, SurfaceTree(vertices, faces)


def _tell(bar: Progress, task: Any, done: int, of: int) -> None:
    bar.advance(task)


def _table(found: list[BasinMap]) -> Table:
    columns: dict[str, Callable[[BasinMap], str]] = {
        "axis": lambda one: ", ".join(one.axes),
        "starts": lambda one: str(len(one.found)),
        "at the truth": lambda one: str(one.found.sum()),
        "all up to, degrees": lambda one: "-" if np.isnan(one.reach) else f"{one.reach:g}",
        "rotation error, degrees": lambda one: _median(one.turned[one.found], 3),
        "mean distance, mm": lambda one: _median(1e3 * one.off[one.found], 2),
        "iterations": lambda one: _median(one.iterations[one.found], 0),
    }
    return Table.of(found, columns, tuple(range(1, 7)))


def _median(numbers: Any, digits: int) -> str:
    return f"{np.median(numbers):.{digits}f}" if len(numbers) else "-"


def _figures(found: list[BasinMap]) -> dict[str, tuple[Figure, str]]:
    """One figure of all maps of one axis, and one for each map of two, with captions."""
    figures = {}
    single = [one for one in found if len(one.axes) == 1]
    if single:
        figure = drawn(partial(plot_basins, single), 7.0, 4.2)
        figures["basins"] = figure, caption_basins(single)
    for one in found:
        if len(one.axes) == 2:
            figure = drawn(partial(plot_basin_grid, one), 5.6, 4.6)
            figures[f"basins-{'-'.join(one.axes)}"] = figure, caption_basin_grid(one)
    return figures


def _contents(found: list[BasinMap], figures: dict[str, tuple[Figure, str]]) -> dict[str, Content]:
    contents: dict[str, Content] = {}
    for name, (figure, _) in figures.items():
        contents[f"{name}.png"] = partial(_write, png(figure))
        contents[f"{name}.svg"] = partial(_write, svg(figure))
    for one in found:
        text = "".join(f"{','.join(row)}\n" for row in one.rows())
        contents[f"starts-{'-'.join(one.axes)}.csv"] = text
    return contents


def _write(content: bytes, path: Path) -> None:
    path.write_bytes(content)


def _facts(one: BasinMap) -> dict[str, Any]:
    return {
        "axes": list(one.axes),
        "starts": len(one.found),
        "found": int(one.found.sum()),
        "reach_deg": None if np.isnan(one.reach) else one.reach,
        "near_mm": 1e3 * one.near,
    }
