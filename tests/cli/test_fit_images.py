"""`workbench fit FOLDER`: images that are fitted one by one, and kept."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from workbench import Camera, load_body
from workbench.cli import Interrupted
from workbench.cli.app import app
from workbench.fitting.images import INTERVAL_NOTE
from workbench.fitting.observations import COCO
from workbench.priors.poses import draw_poses, shipped_gaussian

pytestmark = pytest.mark.thorough

BODY = load_body("small")
SIZE = (1080, 1080)
K = np.array([[1100.0, 0, 540], [0, 1100, 540], [0, 0, 1]])
ORDER = [BODY.landmark_names("coco").index(name) for name in COCO]
OPTIONS = ("--size", f"{SIZE[0]}x{SIZE[1]}", "--focal", "1100", "--body", "small")


def written(folder: Path, count: int) -> list[Path]:
    """Files of people 4 m away, with 17 keypoints each."""
    camera = Camera("c/")
    lens = camera.values(K=K, R=np.diag([1.0, -1.0, -1.0]), t=(0, 0, 4.0))
    found = []
    for i in range(count):
        rng = np.random.default_rng(i)
        pose = draw_poses(shipped_gaussian(), 1, rng)[0]
        pose[0] = [0.0, 0.4 * rng.normal(), 0.0]
        betas = rng.normal(size=BODY.n_betas)
        seen = BODY.landmark("coco", pose, betas, np.array([0, 0, 0.2]))[ORDER]
        pixels = camera.pixels(seen, lens) + 2.0 * rng.normal(size=(17, 2))
        numbers = np.column_stack([pixels, np.ones(17)]).ravel().tolist()
        found.append(folder / f"frame{i}.json")
        found[-1].write_text(json.dumps([{"keypoints": numbers}]))
    return found


def fit(*arguments: str) -> Result:
    """What the command did, in this process, whose handlers of signals stay as they are."""
    return CliRunner().invoke(app, ["fit", *arguments])


def test_folder_refits_only_what_changed(tmp_path: Path) -> None:
    images, out = tmp_path / "images", tmp_path / "runs"
    images.mkdir()
    files = written(images, 3)
    assert fit(str(images), *OPTIONS, "--out", str(out)).exit_code == 0
    folder = out / "fit-images"
    first = {path.name: path.stat().st_mtime_ns for path in (folder / "fits").iterdir()}
    assert len(first) == 9
    rows = list(csv.DictReader((folder / "fits.csv").read_text().splitlines()))
    assert [row["file"] for row in rows] == ["frame0", "frame1", "frame2"]
    for row in rows:
        depth, low, high = (float(row[f"depth{end} (m)"]) for end in ("", ", 5 %", ", 95 %"))
        assert 0 < low < depth < high
        assert f"{low:.2f} to {high:.2f}" in (folder / "index.html").read_text()
        assert f'src="fits/{row["file"]}.svg"' in (folder / "index.html").read_text()
    assert INTERVAL_NOTE.split(";")[0] in (folder / "index.html").read_text()
    with np.load(folder / "poses.npz") as poses:
        assert poses["pose"].shape == (3, 24, 3)
        assert poses["file"].tolist() == ["frame0", "frame1", "frame2"]
    files[1].write_text(files[2].read_text())
    told = fit(str(images), *OPTIONS, "--out", str(out))
    assert "2 of 3 images are fitted already" in told.output
    again = {path.name: path.stat().st_mtime_ns for path in (folder / "fits").iterdir()}
    assert {name for name in first if again[name] != first[name]} == {
        f"frame1.{kind}" for kind in ("npz", "json", "svg")
    }
    assert fit(str(images), *OPTIONS, "--sigma", "8", "--out", str(out)).exit_code == 0
    changed = {path.name: path.stat().st_mtime_ns for path in (folder / "fits").iterdir()}
    assert all(changed[name] != again[name] for name in again)


def test_unreadable_file_does_not_end_the_others(tmp_path: Path) -> None:
    images = tmp_path / "images"
    images.mkdir()
    written(images, 1)
    (images / "broken.json").write_text("{")
    (images / "notes.txt").write_text("mine")
    told = fit(str(images), *OPTIONS, "--out", str(tmp_path / "runs"))
    assert told.exit_code == 1
    said = told.output
    assert "not fitted: broken" in said
    assert "notes.txt" in said
    page = (tmp_path / "runs" / "fit-images" / "index.html").read_text()
    assert "broken.json" in page
    assert "frame0" in page


def test_interrupted_mean_leaves_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("workbench.cli.fit.image_mean", interrupted)
    (file,) = written(tmp_path, 1)
    with pytest.raises(Interrupted, match=r"report is written, but mean\.npz is not"):
        fit(str(file), *OPTIONS, "--mean", "--out", str(tmp_path / "runs"))
    assert (tmp_path / "runs" / "frame0" / "index.html").exists()


def test_one_image_by_other_terms(tmp_path: Path) -> None:
    (file,) = written(tmp_path, 1)
    for options in (
        ("--recipe", "smplify", "--height", "1.7"),
        ("--recipe", "smplify", "--prior", "gaussian", "--contact"),
        ("--prior", "mixture", "--contact"),
    ):
        done = fit(str(file), *OPTIONS, *options, "--out", str(tmp_path))
        assert done.exit_code == 0, done.output
        assert ("SMPLify has spheres" in done.output) == ({"smplify", "--contact"} <= {*options})
        told = json.loads((tmp_path / "frame0" / "summary.json").read_text())
        assert told["measurements"][0]["name"] == "stature"
        assert {"pose prior", "contact"} <= set(told["costs"])
