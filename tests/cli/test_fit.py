"""`workbench fit` of one person: files of detectors, meshes, clips of video."""

import json
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from workbench.experiments.balance import NAMES, observations, published
from workbench.fitting.files.layouts import OPENPOSE_25
from workbench.geometry.meshes import write_mesh
from workbench.motions import read_motion

pytestmark = pytest.mark.thorough


def test_fit_takes_openpose_files_and_a_calibration(workbench: Run) -> None:
    seen, _ = observations(40)
    cameras, files = {}, []
    for photo in seen.photographs:
        rows: list[float] = []
        for name in OPENPOSE_25:
            i = seen.names.index(name) if name in seen.names else None
            row = [0.0, 0.0, 0.0] if i is None else [*photo.pixels[i], photo.confidence[i]]
            rows += [float(number) for number in row]
        file = Path(f"{'abcd'[len(files)]}.json")  # not by the camera's name: the order counts
        file.write_text(json.dumps({"people": [{"pose_keypoints_2d": rows}]}))
        files.append(file.name)
        cameras[photo.name] = {
            "K": np.asarray(photo.K).tolist(),
            "R": np.asarray(photo.R).tolist(),
            "t": np.asarray(photo.t).tolist(),
            "distortion": photo.distortion.tolist() if photo.distortion is not None else [],
            "size": list(photo.size),
        }
    Path("cameras.json").write_text(json.dumps(cameras))
    code, _, err = workbench("fit", *files, "--cameras", "cameras.json", "--no-compare")
    assert code == 0, err
    folder = next(Path("runs").iterdir())
    assert json.loads((folder / "summary.json").read_text())["status"] == "CONVERGED"
    code, out, err = workbench("fit", *files[::-1], "--cameras", "cameras.json", "--no-compare")
    assert code == 0, err
    (folder,) = set(Path("runs").iterdir()) - {folder}
    (doubt,) = json.loads((folder / "summary.json").read_text())["warnings"]
    assert "they would agree if the cameras belong to the files in the order 4, 3, 2, 1" in doubt
    assert f"warning: {doubt}" in out
    assert "ending good" not in (folder / "index.html").read_text()
    one = ("--size", "1088x1920", "--no-compare", "--out", "one")
    code, _, err = workbench("fit", files[0], *one)
    assert code == 0, err  # its focal length is estimated, too


def test_fit_takes_a_mesh_of_the_bodys_topology(workbench: Run) -> None:
    body = wb.load_body("small")
    posed = body.vertices(0.1 * np.ones((24, 3)), [1.0, -1.0], [0.5, 1.0, 0.0])
    write_mesh("me.obj", posed, body.faces)
    code, _, err = workbench("fit", "me.obj", "--body", "small", "--no-compare")
    assert code == 0, err
    (folder,) = Path("runs").iterdir()
    with np.load(folder / "values.npz") as values:
        off = np.linalg.norm(values["surface"] - posed, axis=1)
    assert off.mean() < 2e-3  # m; priors draw the hands a few mm away
    write_mesh("mm.obj", 1000 * posed, body.faces)
    code, _, err = workbench("fit", "mm.obj", "--body", "small")
    assert code == 2
    assert "metres are expected" in err
    _, _, err = workbench("fit", "me.obj")
    assert "369 vertices, but body 'default' has 1229" in " ".join(err.split())


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Five frames of the first camera, of which one is missing."""
    folder = tmp_path / "clip"
    folder.mkdir()
    known = [NAMES.get(str(name), "") for name in published()["keypoint_names"]]
    for t in (40, 41, 43, 44):
        seen = published()["keypoints"][t, 0]
        order = [known.index(name) if name in known else None for name in OPENPOSE_25]
        points = [n for i in order for n in (seen[i].tolist() if i is not None else (0, 0, 0))]
        file = folder / f"film_{t:04d}_keypoints.json"
        file.write_text(json.dumps({"people": [{"pose_keypoints_2d": points}]}))
    return folder


def test_clip_becomes_a_page_and_a_motion(clip: Path, workbench: Run) -> None:
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
    mean, likeliest = (read_motion(f"runs/clip/{name}.npz") for name in ("mean", "motion"))
    assert len(likeliest) == 5
    assert mean.pose.shape == likeliest.pose.shape
    np.testing.assert_array_equal(mean.betas, likeliest.betas)
    assert 0.01 < abs(mean.pose - likeliest.pose).max() < 1.5
    summary = json.loads(Path("runs/clip/summary.json").read_text())
    measures = {one["name"]: one["value"] for one in summary["measures"]}
    assert summary["frames"] == 5
    assert measures["reprojection, camera"] < 20  # px: the keypoints are those of the landmarks
    code, _, error = workbench("fit", str(next(clip.iterdir())), "--video")
    assert code != 0
    assert "give a file of AlphaPose or COCO" in error
