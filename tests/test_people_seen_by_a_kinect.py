"""The example on people seen by a Kinect: one who is simulated."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from tests.fitting.test_scan_surface import from_behind, rounded
from workbench import load_body
from workbench.registration import FitStage

pytestmark = pytest.mark.thorough

EXAMPLE = import_module("examples.26_people_seen_by_a_kinect")
FEW_STAGES = (
    FitStage(200, 0.05, 0.10, 16, 15),
    FitStage(600, 0.02, 0.05, 4, 20),
    FitStage(1500, 0.008, 0.03, 1, 30),
)


def test_a_simulated_person_is_found_from_behind(tmp_path: Path) -> None:
    body = load_body("small")
    simulated = from_behind(body, clothing=0.02)
    camera = simulated.scanners[0]
    np.savez(
        tmp_path / "people.npz",
        person_a=rounded(simulated.scan.points, camera),
        camera_position=camera.place,
    )
    one = EXAMPLE.person(tmp_path / "people.npz", "person_a", body, FEW_STAGES)
    assert 0.1 < one.held_out.mean() < 0.5
    assert EXAMPLE.facing_away(one) > 0.9
    model = EXAMPLE.away(one, one.fits["distance"].vertices(), body.faces)
    loose = EXAMPLE.away(one, one.fits["loose distance"].vertices(), body.faces)
    free = EXAMPLE.away(one, one.registered.vertices, body.faces)
    assert np.median(np.abs(free)) < np.median(np.abs(model)) < 7
    assert np.mean(loose > 0) > 0.7 > np.mean(model > 0)
    said = EXAMPLE.in_words("person_a", one, body.faces)
    assert f"model {np.median(np.abs(model)):.1f} mm" in said
    EXAMPLE.draw({"person_a": one}, body.faces, tmp_path / "people.png")
    assert (tmp_path / "people.png").stat().st_size > 10_000
