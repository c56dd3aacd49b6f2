"""Options that several commands have, and where work is done: in processes or on a cluster."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from joblib import parallel_config
from rich.console import Console

from workbench.cli.console import at_least_one, warn_without_effect
from workbench.environment import pip_install
from workbench.errors import WorkbenchError
from workbench.training.execution import Executor, Processes, by_backend

BodyName = Annotated[str, typer.Option(help="An embedded body, or a file of your own.")]
Fit = Annotated[
    Path | None,
    typer.Option("--from", help="Take pose and betas of a fit: its folder, or an .npz."),
]
Frame = Annotated[int, typer.Option(help="Which frame of --from, where the fit has several.")]
Workers = Annotated[int, typer.Option(callback=at_least_one, help="Number of processes.")]
Dask = Annotated[str | None, typer.Option(help="Work on the workers of this Dask scheduler.")]


@contextmanager
def executing(console: Console, workers: int, dask: str | None) -> Iterator[Executor]:
    """An executor of so many processes, or of the Dask cluster whose scheduler has an address.

    Raises WorkbenchError if Dask is not installed, or no scheduler answers.
    """
    if workers > 1 and dask is not None:
        warn_without_effect(
            console, "--workers", "with --dask, the cluster says how many there are"
        )
    if dask is None:
        yield Processes(workers)
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise WorkbenchError(
            f"--dask needs Dask, which is not installed: {pip_install('dask')}"
        ) from error
    try:
        client = Client(dask, timeout=5)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise WorkbenchError(
            f"no Dask scheduler answers at {dask}: {error}; start one with `dask scheduler`"
        ) from error
    with client, parallel_config(backend="dask"):
        yield by_backend
