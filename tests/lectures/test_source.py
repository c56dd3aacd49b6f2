"""The library's own code in a lecture: with the constants that it reads, and no others."""

import workbench as wb
from workbench.course import source
from workbench.motions.accelerations import MovingFrames, second_differences
from workbench.sampling.autocorrelation import integrated_time


def test_constants_stand_above_the_code_that_reads_them() -> None:
    shown = source(integrated_time)
    assert shown.text.startswith("WINDOW = 5.0  # autocorrelation times")
    assert "TOGETHER = " not in shown.text
    assert shown.where == "workbench.sampling.autocorrelation.integrated_time"


def test_several_functions_stand_together() -> None:
    shown = source(second_differences, MovingFrames.forces)
    order = [shown.text.index(part) for part in ("GRAVITY = ", "def second_d", "def forces")]
    assert order == sorted(order)
    assert shown.where.count("workbench.motions.accelerations.") == 2


def test_a_cached_property_is_the_function_that_it_wraps() -> None:
    assert source(wb.Linearization.gradient).text.startswith("@cached_property\ndef gradient")
