"""Shape from 3D joints alone."""

import numpy as np
import pytest

from workbench import WorkbenchError, laplace, solve
from workbench.experiments import find


def test_the_joints_are_met_and_the_shape_stays_open() -> None:
    setup = find("landmarks", {"body": "small"}).setup()
    found = setup.start | solve(setup.problem, setup.start).values
    measures = {measure.name: measure.value for measure in setup.measures(found)}
    assert measures["joint to synthetic truth, rms"] < 15
    # joints know how tall somebody is, and hardly how heavy: the prior's 1 is left of the last
    known = laplace(setup.problem, found, "betas").sd
    assert known[0] < 0.15
    assert known.max() > 0.5
    assert known.max() <= 1.0 + 0.05


def test_noise_is_above_zero() -> None:
    with pytest.raises(WorkbenchError, match="noise must be above zero"):
        find("landmarks", {"noise": 0.0}).setup()


def test_the_same_seed_is_the_same_person() -> None:
    one, same, other = (find("landmarks", {"body": "small", "seed": s}).setup() for s in (3, 3, 4))
    np.testing.assert_array_equal(one.start["observed"], same.start["observed"])
    assert not np.array_equal(one.start["observed"], other.start["observed"])
