"""Mistakes of users: a sentence, and nothing written; options that change nothing say so."""

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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("run balanse", "no experiment is called 'balanse'; there are balance"),
        ("run missing.py", "there is no file missing.py"),
        ("run --solver newtons", "no solver is called 'newtons'; there are dogleg"),
        ("run --set frames=1", "no argument of balance is called 'frames'"),
        ("run --set frame=abc", "frame of balance must be a whole number, not 'abc'"),
        ("run known-correspondences --set seed=-1", "cannot be built with seed=-1: ValueError"),
        ("run exits.py", "exits.py line 3: it ends the program (sys.exit(3))"),
        ("run broken.py", "broken.py line 1: SyntaxError"),
        ("run nan.py", "has no finite cost, or no derivatives, where it starts"),
        ("fit missing.json", "cannot be read as JSON"),
        ("fit walk.bvh", "`workbench convert` skeletons and motions"),
        ("fit dlc.csv", "it takes keypoints as .json of a detector"),
        ("fit nobody.json", "nobody.json holds no person: its list `people` is empty"),
        ("fit 3.json", "annotations must be a list of objects"),
        ("fit kp.json --focal nan", "--focal takes a number above 0, not nan"),
        ("fit kp.json --sigma 0", "--sigma takes a number above 0"),
        ("fit walk.c3d --across 1", "--across takes a length in m, above 0 and below 0.1"),
        ("fit walk.c3d --marker-height nan", "--marker-height takes a length in m, above 0"),
        ("fit kp.json --size 0x0", "--size takes WIDTHxHEIGHT"),
        ("fit kp.json --person 1", "there are 0 (kp.json holds 1 person, counted from 0)"),
        ("fit kp.json --cameras 3.json", "3.json holds no cameras"),
        ("fit kp.json --size 9x9 --focal 9 --height 172", "metres"),
        ("fit kp.json --size 9x9 --focal 9 --hypotheses 0", "1 to 8 starts"),
        ("body card huge", "default-blend-scape, default-female"),
        ("compare balance --out mine", "mine exists and holds no comparison"),
        ("design nobody", "no experiment is called 'nobody'"),
        ("register nowhere.ply", "there is no"),
        ("lecture show 77", "no lecture is called '77'"),
    ],
)
def test_mistake_ends_in_a_sentence_and_writes_nothing(
    workbench: Run, tmp_path: Path, arguments: str, said: str
) -> None:
    write_keypoints(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "diary.txt").write_text("mine")
    (tmp_path / "3.json").write_text("3")
    (tmp_path / "nobody.json").write_text('{"version": 1.3, "people": []}')
    (tmp_path / "exits.py").write_text("import sys\n\nsys.exit(3)\n")
    (tmp_path / "broken.py").write_text("def f(:\n")
    (tmp_path / "nan.py").write_text(
        LINE + "start['a'][:] = 1e200; start['x'] = 1e200 * start['x']"
    )
    code, _, err = workbench(*arguments.split())
    assert code == 2
    assert err.startswith("error: ")
    assert said in " ".join(err.split())
    assert "Traceback" not in err
    assert not list(tmp_path.glob("runs/*"))


def test_misuse_of_options_ends_with_code_2(workbench: Run) -> None:
    code, out, _ = workbench("run", "--help")
    assert code == 0
    assert "Run an experiment" in out
    for arguments in (("run", "--nope"), ("nope",), ("fit",), ("fit", "a", "--focal", "x")):
        code, _, err = workbench(*arguments)
        assert code == 2
        assert "Traceback" not in err
        assert err


def test_file_without_one_solver_is_refused(workbench: Run) -> None:
    Path("two.py").write_text("import workbench as wb\na = b = wb.GaussNewton()\n")
    Path("none.py").write_text("x = 3\n")
    for file, said in (
        ("two.py", "defines several solvers: a and b"),
        ("none.py", "none.py defines no solver"),
        ("missing.py", "there is no file missing.py"),
    ):
        code, _, err = workbench("run", "nist-misra1a", "--solver", file)
        assert code == 2
        assert said in err
    assert not Path("runs/nist-misra1a").exists()


@pytest.fixture
def fitted(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Setup, bool]]:
    """What `fit` would solve, and whether with other solvers too; nothing is solved here."""
    asked: list[tuple[Setup, bool]] = []

    def carried_out(
        _: object, experiment: Experiment, __: object, compare: bool, *rest: object
    ) -> Values:
        asked.append((experiment.setup(), compare))
        return {}

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
