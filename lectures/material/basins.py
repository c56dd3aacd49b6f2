"""From which starts a rigid registration ends at the truth: its basin, start by start."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument, UnknownName
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.plots.palette import DASHES, FAINT, LINES, MARKERS
from workbench.registration.icp import Alignment, Stopped

AXES: Mapping[str, tuple[float, float, float]] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
NEAR = 0.02  # m: a mean distance from the truth up to which a registration has found it
HALF_TURN = 180.0  # degrees


@dataclass(frozen=True, eq=False)
class BasinMap:
    """Where a registration ended from S starts, each turned about A axes away from the truth.

    Attributes:
        axes: the names of the A axes, in the order in which the turns follow each other.
        angles: (S, A) degrees, above -180 and at most 180, by which a start is turned.
        turned: (S,) degrees between the rotation at the end and the true one.
        off: (S,) m, the mean distance of the points at the end from where the truth puts them.
        iterations: (S,) steps.
        stopped: (S,) why each stopped.
        near: m; a start is in the basin if `off` is at most this.
    """

    axes: tuple[str, ...]
    angles: Array
    turned: Array
    off: Array
    iterations: Index
    stopped: tuple[Stopped, ...]
    near: float = NEAR

    @property
    def found(self) -> Mask:
        """(S,), whether a start ended at the truth."""
        return np.asarray(self.off <= self.near)

    @property
    def reach(self) -> float:
        """Degrees, the largest turn up to which all starts are in the basin, whatever their sign.

        With several axes, the turn of a start is the largest of its angles. NaN if the start at the
        truth itself is not in the basin.
        """
        sizes = np.abs(self.angles).max(axis=1)
        lost = sizes[~self.found].min(initial=np.inf)
        return float(sizes[sizes < lost].max()) if (sizes < lost).any() else float("nan")

    def rows(self) -> Iterable[tuple[str, ...]]:
        """The map as a table of texts, its head first: one row for each start."""
        yield (
            *(f"{a}_deg" for a in self.axes),
            "found",
            "turned_deg",
            "off_mm",
            "iterations",
            "stopped",
        )
        each = zip(self.angles, self.found, self.turned, self.off, strict=True)
        for s, (angles, found, turned, off) in enumerate(each):
            numbers = (f"{turned:.4f}", f"{1e3 * off:.4f}", str(self.iterations[s]))
            starts = (f"{angle:g}" for angle in angles)
            yield (*starts, "yes" if found else "no", *numbers, self.stopped[s].name)


def basin_map(
    align: Callable[[Similarity], Alignment],
    points: ArrayLike,
    truth: Similarity,
    axes: Sequence[str] = ("y",),
    step: float = 30.0,
    near: float = NEAR,
    progress: Callable[[int, int], None] | None = None,
) -> BasinMap:
    """The basin map of a registration of points (M, 3) m whose true rigid motion is known.

    A start is the truth followed by turns about the named axes (of AXES) through the mean of the
    points, on a grid of `step` degrees. `progress` is told how many of how many starts are done.
    Raises UnknownName for another axis, and BadArgument for a step that is not above 0 and at most
    180 degrees, or for an axis that is named twice.
    """
    right = truth(points)
    centre = right.mean(axis=0)
    angles = grid(axes, step)
    ends: list[Alignment] = []
    for several in angles:
        start = truth
        for axis, angle in zip(axes, several, strict=True):
            R = matrix_from_vector(np.radians(angle) * np.array(AXES[axis]))
            start = Similarity(R, centre - R @ centre).after(start)
        ends.append(align(start))
        if progress:
            progress(len(ends), len(angles))
    off = [np.linalg.norm(end.motion(points) - right, axis=1).mean() for end in ends]
    turned = [np.linalg.norm(vector_from_matrix(end.R @ truth.R.T)) for end in ends]
    return BasinMap(
        axes=tuple(axes),
        angles=angles,
        turned=np.degrees(turned),
        off=np.array(off),
        iterations=np.array([end.iterations for end in ends]),
        stopped=tuple(end.stopped for end in ends),
        near=near,
    )


def grid(axes: Sequence[str], step: float) -> Array:
    """The starts (S, A) degrees: multiples of the step above -180 and at most 180, on A axes."""
    for axis in axes:
        if axis not in AXES:
            raise UnknownName("axis", axis, AXES)
    if not axes or len(set(axes)) < len(axes):
        raise BadArgument(f"name one axis or several different ones, not {' and '.join(axes)!r}")
    if not 0 < step <= HALF_TURN:
        raise BadArgument(f"the step must be above 0 and at most 180 degrees, not {step}")
    most = int(HALF_TURN / step + 1e-9)
    one = float(step) * np.arange(-most, most + 1)
    one = one[one > -HALF_TURN + 1e-9]
    return np.array(list(product(one, repeat=len(axes))))


def plot_basins(maps: Sequence[BasinMap], *, ax: Axes) -> Axes:
    """The error at the end over the angle of the start, a line for each map of one axis.

    Filled marks are starts that ended at the truth, empty ones ended elsewhere. Raises BadArgument
    for a map of several axes, or for no map.
    """
    if not maps or any(len(one.axes) != 1 for one in maps):
        raise BadArgument("plot_basins takes maps of one axis")
    for k, one in enumerate(maps):
        order = np.argsort(one.angles[:, 0])
        x, y, found = one.angles[order, 0], one.turned[order], one.found[order]
        colour, mark = LINES[k % len(LINES)], MARKERS[k % len(MARKERS)]
        dashes = DASHES[k % len(DASHES)]
        ax.plot(x, y, dashes, color=colour, linewidth=1.2, alpha=0.7)
        size = max(4.0, 10.0 - 2.5 * k)  # so that equal ends of several maps are all seen
        ax.plot(x[found], y[found], mark, color=colour, ms=size, label=f"about {one.axes[0]}")
        ax.plot(x[~found], y[~found], mark, color=colour, ms=size, markerfacecolor="white")
    ax.set(xlim=(-187, 187), ylim=(-6, 186))
    ax.set_xlabel("angle of the start from the truth (degrees)")
    ax.set_ylabel("rotation error at the end (degrees)")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(30))
    ax.grid(color=FAINT, alpha=0.25)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=len(maps))
    return ax


def caption_basins(maps: Sequence[BasinMap]) -> str:
    """What `plot_basins` shows. Raises BadArgument as it does."""
    if not maps or any(len(one.axes) != 1 for one in maps):
        raise BadArgument("caption_basins takes maps of one axis")
    reaches = "; ".join(
        (
            "for no range of angles"
            if np.isnan(one.reach)
            else f"for angles up to {one.reach:g} degrees"
        )
        + f" about {one.axes[0]}"
        for one in maps
    )
    return (
        "Rotation error at the end of a rigid registration, over the angle by which its start was "
        f"turned about one axis. Filled marks ended at the truth, within {1e3 * maps[0].near:.0f} "
        f"mm on average, and empty ones elsewhere. All starts ended at the truth {reaches}."
    )
