"""The page of sliders: it opens at a fit, and refuses bodies that it cannot draw."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.cli.conftest import Run, workbench  # noqa: F401 - a fixture
from workbench.errors import BadArgument, BadFile
from workbench.reports.sliders import pose_and_betas, settings_of, write_sliders
from workbench.writing import write_arrays

BODY = wb.load_body("small")
POSE = np.zeros((24, 3))
POSE[18] = 0, -1.5, 0
BETAS = np.linspace(-1, 1, 10)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    write_arrays(folder / "values.npz", {"pose": POSE, "betas": BETAS, "trans": np.zeros(3)})
    return folder


def test_fit_of_a_run_has_its_pose_and_betas(run: Path) -> None:
    pose, betas = pose_and_betas(run, BODY)
    np.testing.assert_array_equal(pose, POSE)
    np.testing.assert_array_equal(betas, BETAS)
    settings = settings_of(pose, betas, BODY)
    assert settings["pose"] == {"left_elbow": [0.0, pytest.approx(-85.9437), 0.0]}
    assert settings["betas"] == pytest.approx(BETAS, abs=1e-5)


def test_fit_of_a_motion_is_one_frame(tmp_path: Path) -> None:
    motion = wb.Motion(np.array([0 * POSE, POSE]), np.zeros((2, 3)), 30.0, BODY.joint_names, BETAS)
    wb.save_motion(tmp_path / "walk.npz", motion)
    np.testing.assert_allclose(pose_and_betas(tmp_path / "walk.npz", BODY, 1)[0], POSE, atol=1e-9)
    with pytest.raises(BadArgument, match="has the frames 0 to 1, and not 2"):
        pose_and_betas(tmp_path / "walk.npz", BODY, 2)


def test_fit_of_another_body_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(BadArgument, match=r"name the body of the fit: workbench body sliders NAME"):
        pose_and_betas(run, wb.load_body("hand"))
    with pytest.raises(BadFile, match=r"holds none of values\.npz"):
        pose_and_betas(tmp_path, BODY)
    np.savez(tmp_path / "other.npz", pose=POSE)
    with pytest.raises(BadFile, match="is no fit with a pose and betas"):
        pose_and_betas(tmp_path / "other.npz", BODY)


def test_sliders_open_at_a_fit(run: Path, workbench: Run) -> None:  # noqa: F811
    code, out, error = workbench("body", "sliders", "small", "--from", "run", "--out", "pages")
    assert code == 0, error
    assert "sliders-small.html" in out
    text = Path("pages/sliders-small.html").read_text(encoding="utf-8")
    found = re.search(r"const START = (.*?); //", text)
    assert found
    start = json.loads(found[1])
    assert start["pose"]["left_elbow"][1] == pytest.approx(-85.9437)
    assert "The page opens with the pose and the betas of run" in text
    code, _, error = workbench("body", "sliders", "small", "--from", "missing", "--out", "pages")
    assert code == 2
    assert "missing" in error


def test_sliders_refuse_what_they_cannot_show(tmp_path: Path) -> None:
    for body, text in (
        (replace(BODY, skinning=wb.dual_quaternion_blend), "is not blended linearly"),
        (random_body(bound=True), "drawn in a pose that is not zero"),
        (BODY.freed("template"), "has free arrays"),
        (replace(random_body(), weights=np.full((30, 5), 0.2)), "has 5 weights in a vertex"),
    ):
        with pytest.raises(BadArgument, match=text):
            write_sliders(body, tmp_path / "page.html")
    assert not list(tmp_path.iterdir())
    for body in (random_body(n_joints=1), random_body(n_betas=0, n_joints=2)):
        assert write_sliders(body, tmp_path / "page.html").stat().st_size > 10_000
    with pytest.raises(BadFile, match="choose an existing folder"):
        write_sliders(BODY, tmp_path / "nowhere" / "page.html")
