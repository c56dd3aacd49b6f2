"""How a joint cost fell from block to block, and which terms it consists of."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from workbench.plots.palette import LINES, MARKERS
from workbench.training.execution import LogEntry

SMALL = 1e-3  # of the largest cost: terms that are always smaller are left out


def plot_joint_cost(log: Sequence[LogEntry], *, ax: Axes) -> Axes:
    """The terms of a cost after each block, and their sum, on a logarithmic axis."""
    terms = [log[0].before, *(entry.after for entry in log)]
    total = [sum(costs.values()) for costs in terms]
    x = range(len(terms))
    ax.plot(x, total, color="black", linewidth=2.0, label="sum")
    names = [n for n in terms[0] if max(costs[n] for costs in terms) > SMALL * total[0]]
    for k, name in enumerate(names):
        line = [max(costs[name], SMALL * total[0]) for costs in terms]
        ax.plot(x, line, color=LINES[k % len(LINES)], marker=MARKERS[k], markersize=4, label=name)
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
        "priors. Terms that stay below a thousandth of the first sum are left out."
    )
