"""The walk in eight frames, and a real person on a beam: one shape for all frames."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument, UnknownName
from workbench.experiments import find


def measured(setup: object, values: wb.Values) -> dict[str, float]:
    return {m.name: m.value for m in setup.measures(values)}  # type: ignore[attr-defined]


@pytest.mark.thorough
def test_walk_is_found_with_one_shape() -> None:
    setup = find("body-video").setup()
    assert setup.known is not None
    assert setup.made_of is not None
    assert setup.problem.free.names == ("pose", "betas", "trans")
    assert setup.problem.known["betas"].shape == (10,)
    assert setup.problem.known["pose"].shape == (8, 24, 3)
    for start in (0, 1):
        begun = find("body-video", {"start": start}).setup().start
        solution = wb.solve(setup.problem, setup.start | begun)
        assert solution.converged
        assert solution.cost == pytest.approx(setup.known.cost, rel=1e-6)
    first, last = (measured(setup, setup.start | v) for v in ({}, solution.values))
    assert last["joint to synthetic truth, rms"] < first["joint to synthetic truth, rms"] / 5
    assert last["joint to synthetic truth, rms"] < 40  # mm


def test_person_walks_forwards_and_is_filmed_with_gaps() -> None:
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


def test_impossible_videos_are_refused() -> None:
    with pytest.raises(BadArgument, match="keypoints that were not observed, from 0 to 1, not 1"):
        find("body-video", {"missing": 1.0}).setup()
    with pytest.raises(BadArgument, match="one camera or more, not by 0"):
        find("body-video", {"cameras": 0}).setup()
    for frames in (0, 1):
        with pytest.raises(BadArgument, match=f"two frames or more, not {frames}"):
            find("body-video", {"frames": frames}).setup()


def test_unknown_frames_and_cameras_are_refused() -> None:
    for wrong in ({"first": 40, "last": 40}, {"last": 100}, {"step": 0}, {"first": -1}):
        with pytest.raises(BadArgument, match="two frames or more"):
            find("balance-video", wrong).setup()
    with pytest.raises(UnknownName):
        find("balance-video", {"cameras": ["cam09"]}).setup()


def test_markers_keep_what_a_fit_of_markers_doubts() -> None:
    """Whatever `marker_fit` says of a result, the experiment says too."""
    setup = find("markers", {"frames": "2", "body": "small"}).setup()
    away = dict(setup.start) | {"offsets": setup.start["offsets"] + 0.5}  # half a metre off
    assert setup.doubts(away)
    assert setup.measures(away)[1].value > 400  # mm, to the synthetic truth
