"""A direction of the unknowns as a picture: the body moved along it, one way and the other."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from workbench.arrays import Array, Index
from workbench.plots.body import Figurine, Look, front, line_up, side
from workbench.plots.palette import SKIN, VERMILLION

MOVES = 0.2  # of the largest movement: what moves less is not part of a close-up
AROUND = 0.08  # m that a close-up shows beside what moves
CLOSE = 0.55  # of the body's height: what is smaller is shown as a close-up
SEEN_WELL = 1.2  # times as much movement must be seen from the side for that view


def plot_direction(moved: Mapping[str, Array], faces: Index, *, ax: Axes) -> Axes:
    """Surfaces (N, 3) m by label, the second of three being where the fit is.

    The whole body is shown from the side that shows the movement best, and beside it the part that
    moves, one way and the other, as large as the whole. What moves is red, as red as it moves far,
    on one scale for all.
    """
    labels, surfaces = list(moved), list(moved.values())
    here = surfaces[len(surfaces) // 2]
    look, word = _best_view(surfaces)
    far = [np.linalg.norm(s - here, axis=1) for s in surfaces]
    most = max(float(d.max()) for d in far) or 1.0
    pale, red = np.array(to_rgb(SKIN)), np.array(to_rgb(VERMILLION))

    def coloured(share: Array, shown: Index) -> Array:
        return np.asarray(pale + share[shown].mean(axis=1)[:, None] * (red - pale))

    times, part = close_up(moved, faces)
    figurines = []
    if times > 1:
        both = np.max(far, axis=0) / most
        figurines.append(Figurine(word, here - here.mean(axis=0), look, coloured(both, faces)))
    used, shown = np.unique(faces[part], return_inverse=True)
    shown = shown.reshape(-1, 3)
    middle = here[used].mean(axis=0)
    for label, surface, d in zip(labels, surfaces, far, strict=True):
        share = coloured((d / most)[used], shown)
        figurines.append(Figurine(label, times * (surface[used] - middle), look, share, shown))
    line_up(figurines, faces, ax=ax)
    if times > 1:
        ax.set(ylabel="", xlabel=f"{word}, and the part that moves, {times:.2g} times as large")
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
    else:
        ax.set_xlabel(f"{word}; {ax.get_xlabel()}")
    return ax


def close_up(moved: Mapping[str, Array], faces: Index) -> tuple[float, Index]:
    """How many times larger the part that moves is shown, 1 for the whole body; and its faces."""
    surfaces = list(moved.values())
    here = surfaces[len(surfaces) // 2]
    far = np.max([np.linalg.norm(s - here, axis=1) for s in surfaces], axis=0)
    moving = far > MOVES * far.max(initial=0.0)
    every = np.arange(len(faces))
    if not moving.any():
        return 1.0, every
    low, high = here[moving].min(axis=0) - AROUND, here[moving].max(axis=0) + AROUND
    inside = ((here >= low) & (here <= high)).all(axis=1)
    part = np.flatnonzero(inside[faces].all(axis=1))
    height = float(np.ptp(here[:, 1]))
    size = float((high - low).max())
    if size > CLOSE * height or not part.size:
        return 1.0, every
    return height / size, part


def _best_view(surfaces: list[Array]) -> tuple[Look, str]:
    """From the front, unless the side shows clearly more of the movement."""
    seen = [
        sum(float(np.linalg.norm((look(b) - look(a))[:, :2])) for a, b in pairwise(surfaces))
        for look in (front, side)
    ]
    return (side, "from the side") if seen[1] > SEEN_WELL * seen[0] else (front, "from the front")


def caption_direction(name: str, moved: Mapping[str, Array], amount: float, unit: str) -> str:
    """What `plot_direction` shows."""
    surfaces = list(moved.values())
    here = surfaces[len(surfaces) // 2]
    most = max(float(np.linalg.norm(s - here, axis=1).max()) for s in surfaces)
    return (
        f"{name}: the body moved {amount:.3g} {unit} along it, both ways. The reddest "
        f"point moves {100 * most:.3g} cm."
    )
