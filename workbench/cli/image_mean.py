"""`workbench fit KEYPOINTS.json --mean`: the mean of the posterior beside the likeliest body."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console

from workbench.blocks import Values
from workbench.cli.leaving import interrupts_say
from workbench.fitting.setup import Setup
from workbench.sampling import posterior_mean
from workbench.writing import write_arrays

FILE = "mean.npz"


@contextmanager
def drawing(folder: Path) -> Iterator[Path]:
    """The file for a mean beside a report that is written; an interrupt says that it is missing."""
    with interrupts_say(lambda: f"interrupted; the report is written, but {FILE} is not"):
        yield folder / FILE


def add_mean(console: Console, setup: Setup, values: Values, folder: Path) -> None:
    """Draw about the fit, and write the mean of the draws to `mean.npz` in the report's folder.

    It holds all blocks of the body, with the mean of what is free, and other means of the problem,
    such as an unknown focal length; and, of the body's landmarks by their `names` (M,), `landmarks`
    (M, 3) m in that body and `sd` (M,) m, their standard deviations in space once the middle of all
    landmarks of a draw is brought to that of the mean.
    """
    body = setup.body
    assert body is not None
    console.print("[dim]drawing from the posterior[/]")
    with drawing(folder) as file:
        found = posterior_mean(setup.problem, values)
    kind = next(view.landmarks for view in setup.views)
    blocks = [block.name for block in body.blocks()]
    free, given = setup.problem.free, setup.problem.split(values)[1]
    drawn = [setup.problem.values(x, given) for x in found.draws]
    places = body.landmark(kind, *(np.array([one[name] for one in drawn]) for name in blocks))
    mean, likeliest = (
        body.landmark(kind, *(at[name] for name in blocks)) for at in (found.values, values)
    )
    sd = np.sqrt(np.sum((_centred(places) - _centred(mean)) ** 2, axis=2).mean(axis=0))
    apart = np.linalg.norm(_centred(mean) - _centred(likeliest), axis=1)
    moved = np.linalg.norm(mean.mean(axis=0) - likeliest.mean(axis=0))
    error = np.linalg.norm(free.unpack(found.error, values)[blocks[2]])
    arrays = {name: found.values[name] for name in (*blocks, *free.names)}
    arrays |= {"landmarks": mean, "sd": sd, "names": np.array(body.landmark_names(kind))}
    write_arrays(file, arrays)
    console.print(
        f"the mean of the posterior puts the body {1e3 * moved:.0f} mm from its likeliest place "
        f"(a standard error of {1e3 * error:.0f} mm, from {len(found.draws)} draws); with their "
        f"middles brought together, landmarks are {1e3 * apart.mean():.0f} mm apart on average, "
        f"and have a standard deviation of {1e3 * np.sqrt(np.mean(sd**2)):.0f} mm",
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"mean: {file}", highlight=False, soft_wrap=True)


def _centred(places: np.ndarray) -> np.ndarray:
    return np.asarray(places - places.mean(axis=-2, keepdims=True))
