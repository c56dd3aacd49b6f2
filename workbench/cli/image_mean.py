"""`workbench fit KEYPOINTS.json --mean`: the mean of the posterior beside the likeliest body."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console

from workbench.blocks import Values
from workbench.cli.leaving import interrupts_say
from workbench.fitting.images import SPREAD, image_mean
from workbench.fitting.setup import Setup
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
    landmarks of a draw is brought to that of the mean. `sd_is` says what these were compared with.
    """
    assert setup.body is not None  # which every fit to images has
    console.print("[dim]drawing from the posterior[/]")
    with drawing(folder) as file:
        found = image_mean(setup, values)
    blocks = [block.name for block in setup.body.blocks()]
    arrays = {name: found.values[name] for name in (*blocks, *setup.problem.free.names)}
    of_landmarks = {"landmarks": found.landmarks, "sd": found.sd, "names": np.array(found.names)}
    of_landmarks["sd_is"] = np.array(SPREAD)
    write_arrays(file, arrays | of_landmarks)
    console.print(
        f"the mean of the posterior puts the body {1e3 * found.moved:.0f} mm from its likeliest "
        f"place (a standard error of {1e3 * found.error:.0f} mm, from {found.draws} draws); with "
        f"their middles brought together, landmarks are {1e3 * found.apart.mean():.0f} mm apart on "
        f"average, and have a standard deviation of {1e3 * np.sqrt(np.mean(found.sd**2)):.0f} mm, "
        f"which is {SPREAD}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"mean: {file}", highlight=False, soft_wrap=True)
