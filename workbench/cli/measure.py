"""`workbench measure`: stature, lengths and girths of a body."""

from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from workbench.bodies.body import why_not_skinned
from workbench.bodies.catalogue import BODIES, load_body
from workbench.bodies.skinned import SkinnedBody
from workbench.cli.console import comma_separated, rich_table
from workbench.cli.options import Fit, Frame
from workbench.environment import expanded
from workbench.errors import BadArgument
from workbench.fitting.measures import measured
from workbench.reports.page import Table
from workbench.reports.sliders import pose_and_betas


def measure(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    betas: Annotated[
        str | None, typer.Option(help="Shape coefficients with commas between, such as 1,-0.5.")
    ] = None,
    place: Fit = None,
    frame: Frame = 0,
) -> None:
    """Measure a body at rest: stature, inseam, arm span, shoulder width, and six girths.

    `fit`, `register` and `sample` print these with their uncertainties.
    """
    body = load_body(name)
    if not isinstance(body, SkinnedBody):
        raise BadArgument(why_not_skinned(body, "a measurement", "measure its vertices"))
    shape = np.zeros(body.n_betas)
    if place is not None:
        if betas is not None:
            raise BadArgument("give --betas or --from, not both")
        shape = pose_and_betas(expanded(place), body, frame)[1]
    elif betas is not None:
        numbers = comma_separated("--betas", betas)
        if len(numbers) > body.n_betas:
            raise BadArgument(f"body {name} has {body.n_betas} betas, not {len(numbers)}")
        shape[: len(numbers)] = numbers
    lengths = measured(body, shape)
    rows = tuple((what, f"{float(length):.3f}") for what, length in lengths.items())
    Console().print(rich_table(Table(("measurement", "m"), rows)))
