"""Registered scans: distances, the cost over a joint's angle, and the basins of ICP."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure

from workbench.arrays import Array, Index, Mask
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots.body import Look, back, front, painted, side
from workbench.plots.palette import AMOUNT, FAINT, LINES, MARKERS
from workbench.plots.style import house_style
from workbench.registration import Registration
from workbench.training.execution import LogEntry

MM = 1e3
HIDDEN_DEPTH = 0.02  # m: a point this far behind the surface that hides it is not drawn
SCALE_PERCENTILE = 98  # percent of the points in contact are within the scale of colours
MOST_POINTS = 15_000  # points drawn in one view
VIEWS_WIDTH, TITLES_HEIGHT = 7.4, 0.4  # inches: of a sheet's width for four views, of its height


def left(vertices: Array) -> Array:
    """The view from the body's left side; it faces to the left."""
    x, y, z = vertices.T
    return np.column_stack([-z, y, x])


SIDES: dict[str, Look] = {"front": front, "right side": side, "back": back, "left side": left}


def registered_scan_sheet(registration: Registration) -> Figure:
    """The points of a scan on the registered surface, from four sides of the body.

    Their distances give the colours of those that touch it; the others are grey.
    """
    points, touching = registration.scan.points, registration.touching
    amounts = MM * np.abs(registration.distances)
    end = 1.0
    if touching.any():
        end = float(np.ceil(np.percentile(amounts[touching], SCALE_PERCENTILE)))
    scale = ScalarMappable(Normalize(0.0, end), AMOUNT)
    colours = np.asarray(scale.to_rgba(np.where(touching, amounts, 0.0)))
    colours[~touching] = (*to_rgb(FAINT), 1.0)
    some = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
    turn = matrix_from_vector([0.0, -registration.facing, 0.0]).T
    vertices = registration.vertices @ turn

    def plot(look: Look, ax: Axes) -> None:
        solid, dots = look(vertices), look(points[some] @ turn)
        ax.add_collection(painted(solid[:, :2], solid, registration.faces))
        shown = _in_front(dots, solid)
        order = np.argsort(dots[shown, 2])
        across, up = dots[shown][order, :2].T
        ax.scatter(across, up, c=colours[some][shown][order], s=1.2, linewidths=0, rasterized=True)

    figure = _four_views(plot, vertices)
    beyond = "max" if bool((amounts[touching] > end).any()) else "neither"
    figure.colorbar(scale, ax=figure.axes, shrink=0.8, pad=0.01, extend=beyond).set_label(
        "distance to the surface (mm)"
    )
    return figure


def caption_registered_scan(registration: Registration) -> str:
    """What `registered_scan_sheet` shows."""
    touching = registration.touching
    near = MM * np.abs(registration.distances[touching])
    if not len(near):
        return "The points of the scan over the registered surface: none of them touches it."
    half, most = np.percentile(near, [50, 95])
    return (
        f"The points of the scan over the registered surface, from four sides of the body. "
        f"{100 * touching.mean():.0f} % of the points touch the surface; of these, half are within "
        f"{half:.1f} mm and 95 % within {most:.1f} mm. Grey points have no contact. Look for whole "
        "regions of one colour: there the surface misses the scan, where single points only "
        "scatter."
    )


def _four_views(plot: Callable[[Look, Axes], None], vertices: Array) -> Figure:
    limits = [_extents(look, vertices) for look in SIDES.values()]
    widths = [across[1] - across[0] for across, _ in limits]
    low, high = limits[0][1]
    tall = float(np.clip(VIEWS_WIDTH * (high - low) / sum(widths), 2.0, 6.0))
    with house_style():
        figure = Figure(figsize=(9.0, tall + TITLES_HEIGHT), layout="constrained")
        axes = list(figure.subplots(1, len(SIDES), sharey=True, width_ratios=widths))
        for (name, look), (across, up), ax in zip(SIDES.items(), limits, axes, strict=True):
            plot(look, ax)
            ax.set(xlim=across, ylim=up)
            ax.set_aspect("equal")
            ax.set_title(name)
            ax.set_xticks([])
            ax.spines["bottom"].set_visible(False)
        axes[0].set_ylabel("y (m)")
    return figure


def _extents(look: Look, vertices: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """The limits of x and y of a view, with room on all sides."""
    flat = look(vertices)[:, :2]
    room = 0.05 * float(np.ptp(flat[:, 1]))
    (left, low), (right, high) = flat.min(axis=0) - room, flat.max(axis=0) + room
    return (float(left), float(right)), (float(low), float(high))


def _in_front(dots: Array, solid: Array) -> Mask:
    """Which points (M, 3) are hidden by no vertex (N, 3), in coordinates right, up, towards.

    A vertex hides what is more than 2 cm behind it in the same cell of a coarse grid.
    """
    low = np.minimum(dots[:, :2].min(axis=0), solid[:, :2].min(axis=0))
    cell = max(float(np.ptp(solid[:, 1])) / 80, 1e-6)
    across = int((max(dots[:, 0].max(), solid[:, 0].max()) - low[0]) / cell) + 1

    def cells(x: Array) -> Index:
        at = ((x[:, :2] - low) / cell).astype(np.int64)
        return np.asarray(at[:, 1] * across + at[:, 0])

    of_dots, of_solid = cells(dots), cells(solid)
    nearest = np.full(int(max(of_dots.max(), of_solid.max())) + 1, -np.inf)
    np.maximum.at(nearest, of_solid, solid[:, 2])
    return np.asarray(dots[:, 2] > nearest[of_dots] - HIDDEN_DEPTH)


LEAST_SHARE = 1e-3  # of the largest cost: terms that are always smaller are left out


def plot_joint_cost(log: Sequence[LogEntry], *, ax: Axes) -> Axes:
    """The terms of a cost after each block, and their sum, on a logarithmic axis."""
    terms = [log[0].before, *(entry.after for entry in log)]
    total = [sum(costs.values()) for costs in terms]
    x = range(len(terms))
    ax.plot(x, total, color="black", linewidth=2.0, label="sum")
    names = [n for n in terms[0] if max(costs[n] for costs in terms) > LEAST_SHARE * total[0]]
    for k, name in enumerate(names):
        line = [max(costs[name], LEAST_SHARE * total[0]) for costs in terms]
        ax.plot(
            x,
            line,
            color=LINES[k % len(LINES)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=4,
            label=name,
        )
    ax.set(yscale="log", ylabel="cost")
    ax.set_xticks(list(x), ["start", *(entry.block for entry in log)], rotation=45, ha="right")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def caption_joint_cost(log: Sequence[LogEntry]) -> str:
    """What `plot_joint_cost` shows."""
    first, last = (sum(costs.values()) for costs in (log[0].before, log[-1].after))
    return (
        f"The joint cost after each block, and its terms. It fell from {first:.5g} to {last:.5g}, "
        "and no block raised it. If it still falls at the right end, more rounds would change the "
        "result. E_S: scans to registrations; E_C: registrations to the model; E_pose, E_T, E_J, "
        "E_P and E_W: poses, templates, joints, pose blend shapes and weights against their "
        "priors; E_D and E_Q: what people and bending do to triangles. Terms that stay below a "
        "thousandth of the first sum are left out."
    )
