"""The walk in eight frames: what sharing a shape is worth, and that every command takes it."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.experiments import find


def measured(setup: object, values: wb.Values) -> dict[str, float]:
    return {m.name: m.value for m in setup.measures(values)}  # type: ignore[attr-defined]


def test_the_walk_is_found_with_one_shape() -> None:
    setup = find("body-video").setup()
    assert setup.known is not None
    assert setup.made_of is not None
    assert setup.problem.free.names == ("pose", "betas", "trans")
    assert setup.problem.known["betas"].shape == (10,)
    assert setup.problem.known["pose"].shape == (8, 24, 3)
    for start in (0, 1):
        begun = find("body-video", {"start": start}).setup().start
        found = wb.solve(setup.problem, setup.start | begun)
        assert found.converged
        assert found.cost == pytest.approx(setup.known.cost, rel=1e-6)
    first, last = (measured(setup, setup.start | v) for v in ({}, found.values))
    assert last["joint to synthetic truth, rms"] < first["joint to synthetic truth, rms"] / 5
    assert last["joint to synthetic truth, rms"] < 40  # mm


def test_the_person_walks_forwards_and_is_filmed_with_gaps() -> None:
    setup = find("body-video", {"frames": 4, "cameras": 3, "missing": 0.3}).setup()
    assert setup.made_of is not None
    z = setup.made_of["trans"][:, 2]
    np.testing.assert_allclose(np.diff(z), 0.04)
    sure = np.array([setup.start[f"camera {i}/confidence"] for i in (1, 2, 3)])
    assert set(np.unique(sure)) == {0.0, 1.0}
    assert 0.15 < (sure == 0).mean() < 0.45
    assert "walks through 4 frames, seen by 3 cameras" in setup.question
    assert "30 % of its keypoints" in setup.question
    assert "with noise in the images; nobody was filmed" in setup.synthetic


def test_what_makes_no_video_is_said() -> None:
    with pytest.raises(BadArgument, match="keypoints that were not observed, from 0 to 1, not 1"):
        find("body-video", {"missing": 1.0}).setup()
    with pytest.raises(BadArgument, match="one camera or more, not by 0"):
        find("body-video", {"cameras": 0}).setup()
    for frames in (0, 1):
        with pytest.raises(BadArgument, match=f"two frames or more, not {frames}"):
            find("body-video", {"frames": frames}).setup()


def test_a_body_without_these_joints_stands_still_and_is_found(tmp_path: Path) -> None:
    from tests.bodies_made_up import tube_body

    file = tmp_path / "tube.npz"
    wb.save_body(tube_body(), file)
    setup = find("body-video", {"body": str(file), "frames": 3}).setup()
    assert wb.solve(setup.problem, setup.start).converged
