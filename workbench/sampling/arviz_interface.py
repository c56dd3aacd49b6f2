"""What is taken from ArviZ 0.x, in one place.

ArviZ 1 drops InferenceData for xarray's DataTree and changes `from_dict`; 0.x runs on every Python
that the workbench does, so `arviz>=0.20,<1` is asked for. It takes two seconds to import, hence
only when it is needed, and it says at each import that 1.0 will be different, which a user of the
workbench can do nothing about.
"""

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.environment import optional_library

PURPOSE = "smoothing importance weights, or InferenceData of a posterior,"
HOMES = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME")


def arviz() -> ModuleType:
    """The module ArviZ, without the announcement that it makes when it is imported.

    It keeps the date of its last announcement in the user's home. Where that cannot be written, it
    is imported with another home. Raises MissingLibrary where it is not installed.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        try:
            return optional_library("arviz", PURPOSE)
        except (OSError, RuntimeError):  # also where nobody knows of a home
            with _another_home():
                return optional_library("arviz", PURPOSE)


@contextmanager
def _another_home() -> Iterator[None]:
    """An empty folder is the user's home, and that of caches, inside."""
    from unittest.mock import patch  # which imports asyncio: not before it is needed

    with (
        TemporaryDirectory(prefix="workbench-") as folder,
        patch.dict(os.environ, dict.fromkeys(HOMES, folder)),
    ):
        yield


def psis(log_weights: Array) -> tuple[Array, float]:
    """Pareto-smoothed log weights (N,), and k-hat; infinite where no weight is finite."""
    finite = np.isfinite(log_weights)
    if finite.sum() < 20:
        return np.full_like(log_weights, -np.inf), np.inf
    kept = np.where(finite, log_weights, log_weights[finite].min() - 1e3)
    if np.ptp(kept) < 1e-9:
        return kept, -np.inf
    smoothed, k_hat = arviz().psislw(kept)
    return np.asarray(smoothed), float(k_hat)


def inference_data(draws: Array, log_prob: Array, labels: Sequence[str], said: str) -> Any:
    """arviz.InferenceData of draws (E, S, W, k): a chain is an ensemble, its draws S times W.

    The variable is `z` with the coordinate `entry`; `lp` is the log density; the verdict is an
    attribute of the posterior.
    """
    E, S, W, k = draws.shape
    found = arviz().from_dict(
        posterior={"z": draws.reshape(E, S * W, k)},
        sample_stats={"lp": log_prob.reshape(E, S * W)},
        coords={"entry": list(labels)},
        dims={"z": ["entry"]},
    )
    found.posterior.attrs["verdict"] = said
    return found
