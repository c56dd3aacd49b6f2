"""`workbench fit CLIP --video`: a folder of keypoint files becomes a page and a motion."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from workbench.experiments.balance import NAMES, published
from workbench.fitting.detector_layouts import OPENPOSE
from workbench.motions import read_motion


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Five frames of the first camera, of which one is missing."""
    folder = tmp_path / "clip"
    folder.mkdir()
    known = [NAMES.get(str(name), "") for name in published()["keypoint_names"]]
    for t in (40, 41, 43, 44):
        found = published()["keypoints"][t, 0]
        order = [known.index(name) if name in known else None for name in OPENPOSE.bodies[25]]
        points = [n for i in order for n in (found[i].tolist() if i is not None else (0, 0, 0))]
        file = folder / f"film_{t:04d}_keypoints.json"
        file.write_text(json.dumps({"people": [{"pose_keypoints_2d": points}]}))
    return folder


def test_a_clip_becomes_a_page_and_a_motion(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workbench: Run
) -> None:
    monkeypatch.chdir(tmp_path)
    options = "--video", "--fps", "60", "--size", "1088x1920", "--focal", "1681", "--mean"
    code, said, _ = workbench("fit", str(clip), *options)
    assert code == 0
    assert "independent frames" in said
    text = Path("runs/clip/index.html").read_text()
    assert "there are no files of frames 42" in text
    with np.load("runs/clip/motion.npz") as motion:
        assert motion["poses"].shape == (5, 24, 3)
        assert motion["trans"].shape == (5, 3)
        assert motion["fps"] == 60
    assert len(read_motion("runs/clip/motion.npz")) == 5
    mean, likeliest = (read_motion(f"runs/clip/{name}.npz") for name in ("mean", "motion"))
    assert mean.pose.shape == likeliest.pose.shape
    np.testing.assert_array_equal(mean.betas, likeliest.betas)
    assert 0.01 < abs(mean.pose - likeliest.pose).max() < 1.5
    summary = json.loads(Path("runs/clip/summary.json").read_text())
    measures = {one["name"]: one["value"] for one in summary["measures"]}
    assert summary["frames"] == 5
    assert measures["reprojection, camera"] < 20  # px: the keypoints are those of the landmarks


def test_a_file_is_no_clip(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workbench: Run
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, error = workbench("fit", str(next(clip.iterdir())), "--video")
    assert code != 0
    assert "give a file of AlphaPose or COCO" in error
    assert "or a folder with a file for each frame" in error
