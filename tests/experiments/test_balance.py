"""The real person on the beam: how near the fit comes, and from how little."""

import pytest

from workbench.errors import UnknownName
from workbench.experiments import EXPERIMENTS, Outcome, find, run

CAMERAS = ("cam01", "cam02", "cam03", "cam04")


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return run(EXPERIMENTS["balance"], compare=False)


def measured(outcome: Outcome) -> dict[str, float]:
    return {measure.name: measure.value for measure in outcome.measures}


def test_body_lands_on_the_keypoints(outcome: Outcome) -> None:
    assert outcome.solution.converged
    numbers = measured(outcome)
    assert numbers["reprojection, mean of the fitted"] <= 14  # px; linear triangulation: 12.5
    assert numbers["distance to triangulated keypoints"] <= 20  # mm
    assert numbers["distance to published keypoints"] <= 20  # mm
    assert numbers["largest |beta|"] <= 3


@pytest.mark.thorough
def test_left_out_camera_agrees() -> None:
    result = run(find("balance", {"held_out": ["cam02"]}), compare=False)
    assert measured(result)["reprojection, cam02 (held out)"] <= 25  # px


def test_unknown_cameras_and_frames_are_refused() -> None:
    with pytest.raises(UnknownName, match="cam01, cam02"):
        find("balance", {"held_out": ["cam09"]}).setup()
    with pytest.raises(UnknownName, match="0 to 99"):
        find("balance", {"frame": 100}).setup()


@pytest.mark.thorough
def test_one_camera_fits_itself_and_not_the_others() -> None:
    result = run(EXPERIMENTS["balance-monocular"], compare=False)
    numbers = measured(result)
    assert numbers["reprojection, cam01"] < 10
    held_out = [numbers[f"reprojection, {c} (held out)"] for c in CAMERAS[1:]]
    assert max(held_out) > 2 * numbers["reprojection, cam01"]
