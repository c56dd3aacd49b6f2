"""A run for another process to be killed in: `python -m tests.sampling.interrupted_run FILE`."""

import sys
import time

import numpy as np

from tests.sampling.densities import rosenbrock
from workbench.sampling import Posterior, sample


def run(path: str | None, pause: float = 0.0) -> Posterior:
    return sample(
        rosenbrock(),
        {"x": np.ones(2)},
        steps=400,
        walkers=16,
        thin=2,
        seed=7,
        checkpoint=path,
        every=0.0,
        stop_when_usable=False,
        callback=lambda progress: time.sleep(pause),
    )


if __name__ == "__main__":
    run(sys.argv[1], pause=0.02)
