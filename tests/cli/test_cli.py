"""The command line, as a user types it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.triangles import scape
from workbench.experiments.balance import observations
from workbench.fitting.detector_layouts import OPENPOSE_25
from workbench.geometry.meshes import write_mesh


def workbench(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from workbench.cli import main; main()", *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


def test_run_writes_a_whole_report(tmp_path: Path) -> None:
    done = workbench("run", "--no-compare", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "CONVERGED" in done.stdout
    assert "reprojection, cam01" in done.stdout
    said = done.stdout.splitlines()
    header = next(i for i, line in enumerate(said) if line.split()[:2] == ["iteration", "cost"])
    assert said[header - 1] == "solving"
    assert said[header + 1].split()[0] == "0"
    assert "The priors, pose prior and shape prior, make up " in done.stdout
    assert "without the priors: 184 x 85" in done.stdout
    folder = tmp_path / "runs" / "balance"
    for name in ("index.html", "values.npz", "solution.npz", "body.glb", "summary.json"):
        assert (folder / name).is_file(), name
    numbers = np.load(folder / "values.npz", allow_pickle=False)
    assert numbers["projected:cam01"].shape == (23, 2)
    assert wb.Solution.load(folder / "solution.npz").converged
    assert json.loads((folder / "summary.json").read_text())["status"] == "CONVERGED"


def test_run_lists_the_experiments(tmp_path: Path) -> None:
    done = workbench("run", "--list", cwd=tmp_path)
    assert done.returncode == 0
    for name in ("balance", "balance-monocular", "known-correspondences", "registration"):
        assert name in done.stdout
    assert "suites" in done.stdout
    assert "nist-misra1a" not in done.stdout
    assert len(done.stdout.splitlines()) < 20
    done = workbench("run", "nist", "--list", cwd=tmp_path)
    assert len(done.stdout.splitlines()) == 12
    assert "nist-misra1a" in done.stdout


def test_a_problem_of_a_suite_is_run_and_reported(tmp_path: Path) -> None:
    done = workbench("run", "nist-misra1a", "--set", "start=2", cwd=tmp_path)
    assert done.returncode == 0
    assert "agreement with NIST, worst parameter" in done.stdout
    assert (tmp_path / "runs" / "nist-misra1a" / "index.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "balanse"), "no experiment is called 'balanse'; there are balance"),
        (("run", "--solver", "newtons"), "no solver is called 'newtons'; there are dogleg"),
        (("run", "--set", "frames=1"), "no argument of balance is called 'frames'"),
        (("run", "missing.py"), "there is no file missing.py"),
        (("fit", "missing.json"), "cannot be read as JSON"),
        (("body", "huge"), "default-blend-scape, default-female"),
    ],
)
def test_mistakes_get_a_sentence_and_no_output(
    tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    done = workbench(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("runs/*"))


POLYNOMIAL = '''
"""A line through three points."""
import numpy as np
import workbench as wb
a = wb.Block("a", (2,)).symbol
x, y = wb.Block("x", (3,)).symbol, wb.Block("y", (3,)).symbol
problem = wb.Problem([wb.Residual("line", a[0] + a[1] * x - y, sigma=0.1)], ["a"])
start = {"a": np.zeros(2), "x": np.arange(3.0), "y": np.array([1.0, 3.0, 5.5])}
compared = ("gauss-newton", "nlopt-lbfgs")
'''


def test_a_file_of_ones_own_runs(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(POLYNOMIAL)
    done = workbench("run", "line.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs" / "line" / "index.html").is_file()
    assert not (tmp_path / "runs" / "line" / "body.glb").exists()


def test_fit_takes_openpose_files_and_a_calibration(tmp_path: Path) -> None:
    names = OPENPOSE_25
    seen, _ = observations(40)
    cameras, files = {}, []
    for photo in seen.photographs:
        rows = []
        for name in names:
            i = seen.names.index(name) if name in seen.names else None
            row = [0.0, 0.0, 0.0] if i is None else [*photo.pixels[i], photo.confidence[i]]
            rows += [float(number) for number in row]
        file = tmp_path / f"{photo.name}_keypoints.json"
        file.write_text(json.dumps({"people": [{"pose_keypoints_2d": rows}]}))
        files.append(file.name)
        assert photo.K is not None
        assert photo.R is not None
        assert photo.t is not None
        cameras[photo.name] = {
            "K": photo.K.tolist(),
            "R": photo.R.tolist(),
            "t": photo.t.tolist(),
            "distortion": photo.distortion.tolist() if photo.distortion is not None else [],
            "size": list(photo.size),
        }
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    done = workbench("fit", *files, "--cameras", "cameras.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = next((tmp_path / "runs").iterdir())
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "CONVERGED"
    alone = workbench("fit", files[0], "--size", "1088x1920", "--out", "one", cwd=tmp_path)
    assert alone.returncode == 0, alone.stderr  # its focal length is estimated, too


def test_fit_takes_a_mesh_of_the_bodys_topology(tmp_path: Path) -> None:
    body = wb.load_body("small")
    posed = body.vertices(0.1 * np.ones((24, 3)), [1.0, -1.0], [0.5, 1.0, 0.0])
    write_mesh(tmp_path / "me.obj", posed, body.faces)
    done = workbench("fit", "me.obj", "--body", "small", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    write_mesh(tmp_path / "mm.obj", 1000 * posed, body.faces)
    too_large = workbench("fit", "mm.obj", "--body", "small", cwd=tmp_path)
    assert too_large.returncode == 2
    assert "metres are expected" in too_large.stderr
    other = workbench("fit", "me.obj", cwd=tmp_path)
    assert "369 vertices, but body 'default' has 1229" in " ".join(other.stderr.split())


def test_body_prints_a_card_and_draws_it(tmp_path: Path) -> None:
    done = workbench("body", "small", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "369" in done.stdout
    assert (tmp_path / "runs" / "body-small" / "index.html").is_file()


def test_a_file_of_a_triangle_body_has_a_card_and_is_fitted(tmp_path: Path) -> None:
    body = wb.load_body("small")
    wb.save_body(scape(body), tmp_path / "scape.npz")
    done = workbench("body", "scape.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "TriangleBody, each triangle with one part, then stitched" in done.stdout
    assert (tmp_path / "runs" / "body-scape" / "index.html").is_file()
    write_mesh(tmp_path / "me.obj", body.vertices(), body.faces)
    fit = workbench("fit", "me.obj", "--body", "scape.npz", cwd=tmp_path)
    assert fit.returncode == 0, fit.stderr
    assert "vertex to observation, rms" in fit.stdout
    sliders = workbench("sliders", "scape.npz", cwd=tmp_path)
    assert sliders.returncode == 0, sliders.stderr
    study = workbench("blendshapes", "--body", "scape.npz", cwd=tmp_path)
    assert study.returncode == 2
