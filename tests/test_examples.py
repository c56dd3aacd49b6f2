"""Every example runs and asserts what it claims."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = sorted(p.stem for p in (Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


@pytest.mark.parametrize("name", EXAMPLES)
def test_it_runs(name: str) -> None:
    import_module(f"examples.{name}")


def test_the_cubic_is_found_within_its_spread() -> None:
    example = import_module("examples.01_polynomial")
    off = np.abs(example.solution.values["w"] - example.truth) / example.spread
    assert example.solution.converged
    assert off.max() < 4


def test_the_body_is_found_within_the_noise() -> None:
    example = import_module("examples.02_known_correspondences")
    assert example.solution.converged
    assert example.error.mean() < 0.0007  # 85 parameters average 1,107 noisy coordinates


def test_joints_leave_thirty_two_directions_unseen() -> None:
    example = import_module("examples.03_what_joints_cannot_see")
    assert example.diagnosis.rank == 40
    assert len(example.diagnosis.null_directions) == 32
    assert len(example.twists) == 17
    assert example.joints_moved < 1e-6  # m: second order in a turn of 1 mrad
    assert example.skin_moved > 1e-5
