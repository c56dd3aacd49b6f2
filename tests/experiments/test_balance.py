"""The real person on the beam: how near the fit comes, and from how little."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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


def test_overlays_are_projections_of_the_fitted_body(outcome: Outcome) -> None:
    body = outcome.setup.body
    assert body is not None
    points = body.landmark("coco", *(outcome.values[b.name] for b in body.blocks()))
    for overlay, view in zip(outcome.overlays, outcome.setup.views, strict=True):
        K = np.diag([*outcome.values[f"{view.name}/focal"], 1.0])
        K[:2, 2] = outcome.values[f"{view.name}/centre"]
        # the lens moves points by a few pixels, so the pinhole alone is near but not equal
        R = Rotation.from_rotvec(outcome.values[f"{view.name}/rotation"]).as_matrix()
        seen = (points @ R.T + outcome.values[f"{view.name}/translation"]) @ K.T
        pinhole = seen[:, :2] / seen[:, 2:]
        assert np.abs(pinhole - overlay.projected).max() < 10


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


@pytest.mark.thorough
def test_data_alone_leave_null_directions(outcome: Outcome) -> None:
    assert outcome.diagnosis.rank == 85
    alone = outcome.data_alone
    assert alone is not None
    assert alone.shape == (184, 85)
    assert alone.rank < 85
    assert len(alone.null_directions) == 85 - alone.rank
    assert max(direction.change for direction in alone.null_directions) < 1e-9
