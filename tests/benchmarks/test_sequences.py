"""The memory of a long sequence, and what keeps it small."""

import tracemalloc

import numpy as np
import pytest

from benchmarks import sequences
from workbench import LevenbergMarquardt, Linearization
from workbench.arrays import Array, Mask
from workbench.solvers import valley
from workbench.solvers.end_point import EndPoint

A_FRAME = 0.45e6  # bytes of arrays in a solve; CasADi takes less than a tenth of a megabyte more
FEW, MANY = 60, 120


def peak(frames: int) -> int:
    """Bytes of arrays at the worst in a solve of a few iterations."""
    made = sequences.film(frames)
    made.video.prepare()
    tracemalloc.start()
    try:
        LevenbergMarquardt(max_iterations=5).solve(made.video, made.values)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_of_a_solve_grows_by_less_than_half_a_megabyte_a_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def first(end: EndPoint, *_: Array) -> Mask:  # so that a valley is looked for
        return np.arange(end.x.size) == 0

    monkeypatch.setattr(valley, "_running", first)
    followed = []
    step_of_others = valley._step_of_others

    def counted(end: EndPoint, x: Array, running: Mask) -> tuple[float, Array | None]:
        followed.append(x)
        return step_of_others(end, x, running)

    monkeypatch.setattr(valley, "_step_of_others", counted)
    few, many = peak(FEW), peak(MANY)
    assert followed
    assert (many - few) / (MANY - FEW) < A_FRAME


@pytest.mark.parametrize("dependent", [False, True])
def test_what_runs_is_held_without_copying_columns(dependent: bool) -> None:
    """The step of the other unknowns is that of their columns alone, where there is one."""
    with sequences._by_blocks():
        made = sequences.film(3)
        x, fixed = made.split
        here = made.video.linearize_at(x, fixed)
    assert here.by_frames
    if dependent:  # two unknowns that nothing determines
        kept = np.ones(x.size)
        kept[[5, 80]] = 0.0
        here = here.scaled(kept)
    running = np.zeros(x.size, dtype=bool)
    running[[0, 100, x.size - 1]] = True
    end = _End(here)
    cost, step = valley._step_of_others(end, x, running)  # type: ignore[arg-type]
    assert cost == here.cost
    assert step is not None
    assert not step[running].any()
    rest = np.flatnonzero(~running)
    expected = Linearization(here.residual, here.dense[:, rest]).step()
    tolerance = 1e-3 if dependent else 1e-10  # slightly damped, or not at all
    np.testing.assert_allclose(step[rest], expected, atol=tolerance * np.abs(expected).max())


class _End:
    """As much of an EndPoint as a step needs."""

    def __init__(self, here: Linearization) -> None:
        self.linearize = lambda _: here
