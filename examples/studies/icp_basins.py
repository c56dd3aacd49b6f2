"""From which starts does rigid ICP find where a scan of a body belongs?

    python -m examples.studies.icp_basins [--axes y x,z] [--method point-to-plane] ...

The scan is synthetic: points on the body's surface at rest, with noise, whose true place is known.
Starts are turned away from it about an axis, or about two, such as x,z. It takes half a minute.
"""

from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MultipleLocator

from examples.studies.output import arguments, report, write_study
from workbench.arrays import Array
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument, check_known
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.lectures.material.basins import AXES, BasinMap, basin_map, plot_basins
from workbench.plots.palette import AMOUNT, INK
from workbench.registration import (
    Icp,
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
    random_surface_points,
)
from workbench.reports.page import Columns, Table

METHODS = {
    "distance": Icp(distance_gauss_newton),
    "point-to-plane": Icp(point_to_plane, halvings=0),
    "point-to-point": Icp(point_to_point),
}


@dataclass(frozen=True)
class BasinPlan:
    """What the study does. Raises BadArgument, or UnknownName for a method or an axis.

    Attributes:
        body: a name of an embedded body, or a file.
        axes: what starts are turned about: one axis of x, y and z, or two such as `x,z`.
        step: degrees between neighbouring starts.
        method: the form of the step.
        points: of the scan.
        noise: of the points, in mm.
        seed: of the points.
    """

    body: str = "default"
    axes: tuple[str, ...] = tuple(AXES)
    step: float = 30.0
    method: str = "distance"
    points: int = 1000
    noise: float = 2.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_known("method", self.method, METHODS)
        if not 0 <= self.noise < np.inf or self.points < 1:
            raise BadArgument("noise must be finite and not negative, and points at least 1")
        for text in self.axes:
            if text.count(",") > 1:
                raise BadArgument(f"a map has one axis or two, such as x,z, not {text}")
            for axis in text.split(","):
                check_known("axis", axis, AXES)


def basin_maps(plan: BasinPlan) -> list[BasinMap]:
    """A map for each entry of `axes`."""
    body, rng = load_body(plan.body), np.random.default_rng(plan.seed)
    right, _ = random_surface_points(body.template, body.faces, plan.points, rng)
    right = right + 1e-3 * plan.noise * rng.normal(size=right.shape)
    truth = Similarity(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3))
    scan, surface = truth.inverse()(right), SurfaceTree(body.template, body.faces)
    align = partial(METHODS[plan.method].align, scan, surface)
    maps = []
    for text in plan.axes:
        report(f"registering from starts about {text}")
        axes = text.split(",")
        maps.append(basin_map(lambda start: align(start), scan, truth, axes, plan.step))
    return maps


def plot_basin_grid(one: BasinMap, *, ax: Axes) -> Axes:
    """The error at the end over the angles of the start about two axes, as colours.

    A cross is a start that did not end at the truth.
    """
    x, y, errors = error_grid(one)
    step = float(x[1] - x[0]) if len(x) > 1 else 1.0
    edges = [np.append(a - step / 2, a[-1] + step / 2) for a in (x, y)]
    image = ax.pcolormesh(*edges, errors.T, cmap=AMOUNT, norm=Normalize(0, 180))
    lost = one.angles[~one.found]
    ax.plot(lost[:, 0], lost[:, 1], "x", color="white", markersize=5, markeredgewidth=1.6)
    ax.plot(lost[:, 0], lost[:, 1], "x", color=INK, markersize=4, markeredgewidth=0.8)
    ax.set_xlabel(f"start turned about {one.axes[0]} (degrees)")
    ax.set_ylabel(f"then about {one.axes[1]} (degrees)")
    ax.set_aspect("equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(60))
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(image, ax=ax, shrink=0.85, pad=0.02)
    bar.set_label("rotation error at the end (degrees)")
    bar.locator = MultipleLocator(30)
    bar.update_ticks()
    return ax


def error_grid(one: BasinMap) -> tuple[Array, Array, Array]:
    """The angles (X,) and (Y,) of a map of two axes, and (X, Y) the errors at the end; degrees."""
    x, y = np.unique(one.angles[:, 0]), np.unique(one.angles[:, 1])
    errors = np.full((len(x), len(y)), np.nan)
    errors[np.searchsorted(x, one.angles[:, 0]), np.searchsorted(y, one.angles[:, 1])] = one.turned
    return x, y, errors


def table(maps: list[BasinMap]) -> Table:
    """A line for each map: how many starts ended at the truth, and how well."""

    def median(numbers: Array, digits: int) -> str:
        return f"{np.median(numbers):.{digits}f}" if len(numbers) else "-"

    columns: Columns[BasinMap] = {
        "axis": lambda one: ",".join(one.axes),
        "starts": lambda one: str(len(one.found)),
        "at the truth": lambda one: str(one.found.sum()),
        "all up to, degrees": lambda one: "-" if np.isnan(one.reach) else f"{one.reach:g}",
        "rotation error, degrees": lambda one: median(one.turned[one.found], 3),
        "mean distance, mm": lambda one: median(1e3 * one.off[one.found], 2),
        "iterations": lambda one: median(one.iterations[one.found], 0),
    }
    return Table.of(maps, columns, tuple(range(1, 7)))


def main() -> None:
    """Carry out the study and write its folder."""
    plan, chosen = arguments(BasinPlan, __doc__)
    maps = basin_maps(plan)
    single = [one for one in maps if len(one.axes) == 1]
    figures = {"basins": (7.0, 4.2, partial(plot_basins, single))} if single else {}
    starts = {}
    for one in maps:
        name = "-".join(one.axes)
        if len(one.axes) == 2:
            figures[f"basins-{name}"] = 5.6, 4.6, partial(plot_basin_grid, one)
        starts[f"starts-{name}.csv"] = "".join(f"{','.join(row)}\n" for row in one.rows())
    found = {"+".join(one.axes): [len(one.found), int(one.found.sum())] for one in maps}
    data = {"kind": "basins", "plan": asdict(plan), "starts and those at the truth": found}
    write_study(chosen.out / "icp-basins", [table(maps)], data, figures, starts)


if __name__ == "__main__":
    main()
