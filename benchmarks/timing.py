"""Timing candidates side by side: one thread, one core, taking turns."""

import gc
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import cycle, islice
from typing import Any

import numpy as np

Timings = dict[str, list[float]]  # candidate -> seconds of every timed call
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
ONE_THREAD = dict.fromkeys(THREADS, "1") | {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
TURN = 0.03  # s: a quick candidate is called a few times in its turn, a slow one once
AT_MOST = 5  # timed calls in a turn


def alone_on_one_core() -> None:
    """Start this command again with one thread for every library, pinned to its last core.

    Libraries read these variables when they are imported, so it has to happen before.
    """
    if hasattr(os, "sched_setaffinity"):  # Linux
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        command = [sys.executable, "-m", "benchmarks", *sys.argv[1:]]
        os.execve(sys.executable, command, {**os.environ, **ONE_THREAD})


def side_by_side(
    candidates: Mapping[str, Callable[[Any], object]], inputs: Sequence[Any], rounds: int
) -> Timings:
    """Every candidate once per round, on changing inputs, so that nobody answers from memory.

    Each candidate gets all inputs in turn, again and again; the workbench remembers the points of
    the last two, so that three are enough. A turn begins with a call that is not timed: what the
    others left in the cache is their affair.
    """
    timings: Timings = {name: [] for name in candidates}
    following = {name: cycle(inputs) for name in candidates}
    calls = {name: _calls(run, following[name]) for name, run in candidates.items()}
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, run in candidates.items():
                run(next(following[name]))
                for _ in range(calls[name]):
                    given = next(following[name])
                    began = time.perf_counter()
                    run(given)
                    timings[name].append(time.perf_counter() - began)
    finally:
        gc.enable()
    return timings


def best(timings: Sequence[float]) -> float:
    """The least of some timings, s: the one that other processes disturbed least."""
    return min(timings)


def median(timings: Sequence[float]) -> float:
    """The middle of some timings, s."""
    return float(np.median(timings))


def _calls(run: Callable[[Any], object], inputs: Iterator[Any]) -> int:
    """How often to call in one turn; the first calls, which compile, are made here."""
    for given in islice(inputs, 3):
        began = time.perf_counter()
        run(given)
        took = time.perf_counter() - began
    return int(np.clip(TURN / took, 1, AT_MOST))
