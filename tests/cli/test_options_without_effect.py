"""Options that change nothing say so; those that were thought to do something, do."""

import json
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.cli.own_files import LINE, write_keypoints
from workbench.blocks import Values
from workbench.errors import WorkbenchError
from workbench.experiments import Experiment, Setup
from workbench.fitting.setup import MANY
from workbench.geometry.meshes import write_mesh


@pytest.fixture
def fitted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[Setup, bool]]:
    """What `fit` would solve, and whether with other solvers too; nothing is solved here."""
    asked: list[tuple[Setup, bool]] = []

    def carried_out(
        _: object, experiment: Experiment, __: object, compare: bool, *rest: object
    ) -> tuple[Values, Path]:
        asked.append((experiment.setup(), compare))
        return {}, tmp_path

    monkeypatch.setattr("workbench.cli.fit.carry_out", carried_out)
    return asked


def test_fit_of_a_mesh_ignores_cameras(
    workbench: Run, tmp_path: Path, fitted: list[object]
) -> None:
    body = wb.load_body("small")
    posed = body.vertices(0.1 * np.ones((24, 3)), [1.0, -1.0], [0.5, 1.0, 0.0])
    write_mesh(tmp_path / "me.obj", posed, body.faces)
    given = ("--size", "1088x1920", "--focal", "1500", "--person", "0", "--cameras", "none.toml")
    of_markers = ("--across", "0.001", "--marker-height", "0.007")
    code, out, _ = workbench("fit", "me.obj", "--body", "small", "--mean", *given, *of_markers)
    assert code == 0
    for option in (*given[::2], *of_markers[::2], "--mean"):
        assert f"{option} changes nothing: it is not for a mesh" in out
    assert workbench("fit", "me.obj", "--body", "small")[1] == ""
    assert len(fitted) == 2


def test_fit_prefers_the_focal_length_of_a_calibration(
    workbench: Run, tmp_path: Path, fitted: list[tuple[Setup, bool]]
) -> None:
    write_keypoints(tmp_path)
    camera = {"K": [[1500, 0, 544], [0, 1500, 960], [0, 0, 1]], "R": [0, 0, 0], "t": [0, 0, 4]}
    (tmp_path / "cameras.json").write_text(json.dumps({"front": camera}))
    code, out, _ = workbench("fit", "kp.json", "--cameras", "cameras.json", "--focal", "900")
    assert code == 0
    assert "--focal changes nothing: cameras.json says the focal length" in out
    (setup, _) = fitted[0]
    assert setup.start["front/focal"][0] == 1500


def test_fit_compares_solvers_when_asked(
    workbench: Run, tmp_path: Path, fitted: list[tuple[Setup, bool]]
) -> None:
    write_keypoints(tmp_path)
    for option in ("--compare", "--no-compare"):
        code, out, _ = workbench("fit", "kp.json", "--focal", "1500", option)
        assert (code, out) == (0, "")
    assert [compare for _, compare in fitted] == [True, False]
    assert set(fitted[0][0].compared) == set(MANY)


def test_train_of_made_up_people_ignores_gender(
    workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise WorkbenchError("enough for this test")

    monkeypatch.setattr("workbench.cli.train.train_body", stop)
    _, out, err = workbench("train", "--gender", "female", "--reach", "1", "--start", "small")
    assert "enough for this test" in err
    for option in ("--gender", "--reach", "--start"):
        assert f"{option} changes nothing: " in out
    assert [path.name for path in Path("runs").iterdir()] == ["train-made-up"]
    assert "changes nothing" not in workbench("train")[1]


def test_compare_on_a_cluster_ignores_workers(
    workbench: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent(address: str | None) -> None:
        raise WorkbenchError("no cluster in this test")

    monkeypatch.setattr("workbench.cli.options.cluster", absent)
    (tmp_path / "line.py").write_text(LINE)
    _, out, err = workbench("compare", "line.py", "--dask", "tcp://somewhere:1", "--workers", "2")
    assert "no cluster in this test" in err
    assert "--workers changes nothing: with --dask, the cluster says how many" in out
