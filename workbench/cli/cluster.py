"""Sending work to a Dask cluster."""

from collections.abc import Iterator
from contextlib import contextmanager

from joblib import parallel_config

from workbench.errors import WorkbenchError
from workbench.installation import pip_install


@contextmanager
def cluster(address: str | None) -> Iterator[None]:
    """Inside, joblib sends work to the Dask cluster whose scheduler has this address, if one is
    given. Raises WorkbenchError if Dask is not installed, or no scheduler answers.
    """
    if address is None:
        yield
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise WorkbenchError(
            f"--dask needs Dask, which is not installed: {pip_install('dask')}"
        ) from error
    try:
        client = Client(address, timeout=5)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise WorkbenchError(
            f"no Dask scheduler answers at {address}: {error}; start one with `dask scheduler`"
        ) from error
    with client, parallel_config(backend="dask"):
        yield
