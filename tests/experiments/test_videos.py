"""The walk in eight frames, and a real person on a beam: one shape for all frames."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import tube_body
from workbench.errors import BadArgument, UnknownName
from workbench.experiments import find, run
from workbench.fitting.videos import landmarks_of
from workbench.reports import write_report


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
        found = wb.solve(setup.problem, setup.start | begun)
        assert found.converged
        assert found.cost == pytest.approx(setup.known.cost, rel=1e-6)
    first, last = (measured(setup, setup.start | v) for v in ({}, found.values))
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


def test_bodies_without_arms_and_legs_stand_still(tmp_path: Path) -> None:
    file = tmp_path / "tube.npz"
    wb.save_body(tube_body(), file)
    setup = find("body-video", {"body": str(file), "frames": 3}).setup()
    assert wb.solve(setup.problem, setup.start).converged


@pytest.mark.thorough
def test_page_of_a_video_shows_its_frames(tmp_path: Path) -> None:
    outcome = run(find("balance-video", {"last": 50}), compare=False)
    assert outcome.solution.converged
    text = write_report(outcome, tmp_path / "page").read_text()
    assert "cam01: 3 of 3 frames at 12 a second" in text
    assert "frames are worth" in text
    assert outcome.values["pose"].shape == (3, 24, 3)


def test_unknown_frames_and_cameras_are_refused() -> None:
    for wrong in ({"first": 40, "last": 40}, {"last": 100}, {"step": 0}, {"first": -1}):
        with pytest.raises(BadArgument, match="two frames or more"):
            find("balance-video", wrong).setup()
    with pytest.raises(UnknownName):
        find("balance-video", {"cameras": ["cam09"]}).setup()


@pytest.mark.thorough
def test_two_cameras_place_the_body_better_than_one() -> None:
    apart = []
    four = find("balance-video", {"last": 50, "cameras": ["cam01", "cam02", "cam03", "cam04"]})
    true = None
    for experiment in (
        four,
        find("balance-video", {"last": 50, "cameras": ["cam01", "cam02"]}),
        find("balance-video", {"last": 50}),
    ):
        outcome = run(experiment, compare=False)
        moving = outcome.setup.moving
        assert moving is not None
        places = landmarks_of(moving, outcome.values)
        true = places if true is None else true
        apart.append(np.linalg.norm(places - true, axis=-1).mean())
    assert apart[1] < 0.7 * apart[2]


def test_markers_keep_what_a_fit_of_markers_doubts() -> None:
    """Whatever `marker_fit` says of a result, the experiment says too."""
    setup = find("markers", {"frames": "2", "body": "small"}).setup()
    away = dict(setup.start) | {"offsets": setup.start["offsets"] + 0.5}  # half a metre off
    assert setup.doubts(away)
    assert setup.measures(away)[1].value > 400  # mm, to the synthetic truth
