"""`workbench register`, as typed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from tests.registration.clouds import person, write_scan
from workbench import load_body
from workbench.bodies.body import Body
from workbench.registration import FitStage, Recipe, usual_recipe

QUICK = (FitStage(200, 0.05, 0.1, 4, 8),)


def quickly(body: Body) -> Recipe:
    """A recipe with a short fit."""
    return replace(usual_recipe(body), fit_stages=QUICK)


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    """A folder of three scans, one of them bad, and a note."""
    folder = tmp_path / "scans"
    folder.mkdir()
    write_scan(str(folder / "left.xyz"), 0.5)
    write_scan(str(folder / "right.xyz"), -0.5)
    (folder / "empty.ply").write_bytes(b"")
    (folder / "notes.txt").write_text("of Monday")
    return folder


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short fit, for what does not depend on its quality."""

    import workbench.cli.register as command

    monkeypatch.setattr(command, "usual_recipe", quickly)


@pytest.mark.thorough
def test_register_writes_a_page_and_a_surface(workbench: Run, scans: Path) -> None:
    code, out, err = workbench("register", str(scans / "left.xyz"), "--body", "small")
    assert code == 0, err
    assert "note: the unit is taken to be m" in out
    assert "stage 3 of 3, starts: 2 of 3" in out
    folder = Path("runs/register-left")
    assert f"report: {folder / 'index.html'}" in out
    with np.load(folder / "registration.npz") as stored:
        off = np.linalg.norm(stored["vertices"] - person(load_body("small"), 0.5), axis=1)
    assert off.mean() < 0.01  # m


@pytest.mark.thorough
@pytest.mark.usefixtures("quick")
def test_register_skips_what_is_registered(workbench: Run, scans: Path) -> None:
    given = ("register", str(scans), "--body", "small", "--model-only")
    code, out, _ = workbench(*given)
    assert code == 1  # one was bad
    assert "note: not taken for scans: notes.txt" in out
    assert "not registered: empty:" in out
    table = Path("runs/register-scans/registrations.csv")
    assert [line.split(",")[:2] for line in table.read_text().splitlines()] == [
        ["file", "subject"],
        ["left/registration.npz", "left"],
        ["right/registration.npz", "right"],
    ]
    before = Path("runs/register-scans/left/summary.json").stat().st_mtime_ns
    (scans / "empty.ply").unlink()
    code, out, _ = workbench(*given)
    assert code == 0
    assert "2 of 2 scans are registered already" in out
    assert Path("runs/register-scans/left/summary.json").stat().st_mtime_ns == before
    told = json.loads(Path("runs/register-scans/summary.json").read_text())
    assert told["scans"] == ["left", "right"]
    assert told["failed"] == {}


@pytest.mark.thorough
@pytest.mark.usefixtures("quick")
def test_register_reads_a_table_of_subjects(workbench: Run, scans: Path, tmp_path: Path) -> None:
    table = tmp_path / "people.csv"
    table.write_text("file,subject,gender\nleft.xyz,anna,female\nright.xyz,anna,female\n")
    files = [str(scans / name) for name in ("left.xyz", "right.xyz")]
    given = ("register", *files, "--body", "small", "--model-only", "--subjects")
    assert workbench(*given, str(table))[0] == 0
    text = Path("runs/register-scans/registrations.csv").read_text()
    assert text.count(",anna,female,poses") == 2
    table.write_text("file,subject\nleft.xyz,anna\n")
    code, _, err = workbench(*given, str(table))
    assert code == 2
    assert "has no line for right.xyz" in err
    table.write_text("file,subject\nleft.xyz,anna\nup.xyz,anna\n")
    assert "names files that are not among the scans: up.xyz" in workbench(*given, str(table))[2]


def test_register_refuses_wrong_options(workbench: Run, scans: Path) -> None:
    for given, said in (
        (("--camera", "0,0"), "--camera takes x,y,z such as 0,0,0"),
        (("--camera", "0,0,inf"), "three finite numbers"),
        (("--workers", "0"), "--workers takes 1 or more"),
        (("--boundary", "-1"), "--boundary takes a width of 0 m or more"),
        (("--unit", "ft"), "no unit is called 'ft'"),
        (("--up", "w"), "no axis is called 'w'"),
        (("--points", "10"), "at least 1,000 points"),
        (("--body", "smal"), "small"),
    ):
        code, _, err = workbench("register", str(scans / "left.xyz"), *given)
        assert code == 2
        assert said in err
        assert workbench("register", str(scans), *given)[0] == 2  # nor is a folder begun
    assert not list(Path().glob("runs/*/*"))


def test_register_refuses_folders_without_scans(workbench: Run, tmp_path: Path) -> None:
    (tmp_path / "nothing").mkdir()
    assert "holds no scans" in workbench("register", str(tmp_path / "nothing"))[2]
    assert "there is no" in workbench("register", str(tmp_path / "missing.ply"))[2]


@pytest.mark.thorough
@pytest.mark.usefixtures("quick")
def test_interrupted_register_says_what_is_kept(
    workbench: Run, scans: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import workbench.cli.register as command

    whole = command.registered

    def pressed(*given: object) -> object:
        if given[-1].name == "right":  # type: ignore[attr-defined]
            raise KeyboardInterrupt
        return whole(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(command, "registered", pressed)
    code, _, err = workbench("register", str(scans), "--body", "small", "--model-only")
    assert code == 130
    assert "interrupted; 1 of 3 scans are registered in runs/register-scans" in err
