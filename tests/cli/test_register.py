"""`workbench register` and `coregister`, as typed."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from tests.registration.clouds import person, write_scan
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.files.saving import save_body
from workbench.registration import FitStage, Recipe, usual_recipe
from workbench.registration.coregistration.folder import BODY_FILE, SCAN_FILE
from workbench.synthetic.made_up import jointed_tube, random_smpl
from workbench.training.folder import TABLE, open_folder
from workbench.writing import write_arrays

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
    assert "note: skipped, because they are no scans: notes.txt" in out
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
        (("--camera", "0,0,inf"), "takes finite numbers"),
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


WHO = ("ann", "ann", "bob", "bob")


@cache
def tube() -> SkinnedBody:
    return random_smpl(jointed_tube(7, 5), 2, seed=3)


def write_registered(place: Path, who: tuple[str, ...] = WHO, alike: bool = False) -> None:
    """What `workbench register` leaves of scans of tubes with bones, of 300 points each."""
    body, rng = tube(), np.random.default_rng(3)
    lines = ["file,subject,gender,set"]
    for j, name in enumerate(who):
        pose = 0.1 * np.random.default_rng(0 if alike else j).standard_normal((body.n_joints, 3))
        betas = np.full(body.n_betas, 0.5 if name == "ann" else -0.5)
        vertices = body.vertices(pose, betas, np.zeros(3))
        some = np.random.default_rng(0 if alike else j).choice(body.n_vertices, 300)
        corners = vertices[body.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        on = np.array([np.flatnonzero((body.faces == v).any(axis=1))[0] for v in some])
        unit = normals[on] / np.linalg.norm(normals[on], axis=1)[:, None]
        folder = place / f"scan{j}"
        folder.mkdir(parents=True)
        points = vertices[some].astype(np.float32)
        write_arrays(folder / SCAN_FILE, {"points": points, "normals": unit.astype(np.float32)})
        off = pose + 0.01 * rng.standard_normal(pose.shape)
        fit = {"pose": off, "betas": betas, "trans": np.zeros(3), "vertices": vertices}
        write_arrays(folder / "registration.npz", fit)
        lines.append(f"scan{j}/registration.npz,{name},neutral,poses")
    (place / TABLE).write_text("\n".join(lines) + "\n")
    save_body(body, place / BODY_FILE)


@pytest.mark.thorough
def test_coregister_writes_what_training_reads(workbench: Run, tmp_path: Path) -> None:
    place = tmp_path / "register-some"
    write_registered(place)
    code, out, err = workbench("coregister", str(place), "--rounds", "1")
    assert code == 0, err
    costs = [float(x) for pair in re.findall(r"cost (\S+) -> (\S+)", out) for x in pair]
    assert len(costs) == 6
    assert costs == sorted(costs, reverse=True)
    made = Path("runs/coregister-some")
    assert f"report: {made / 'index.html'}" in out
    body = tube()
    read = open_folder(made / "registrations", body.n_vertices, body.faces)
    with np.load(place / "scan0" / "registration.npz") as file:
        truth = file["vertices"]
    assert read.subjects == ("ann", "bob")
    assert np.linalg.norm(read.read(slice(0, 1)).vertices[0] - truth, axis=1).mean() < 0.005  # m
    assert load_body(made / "body.npz").n_betas == 1
    told = json.loads((made / "summary.json").read_text())
    assert told["blocks"] == ["registrations", "model", "registrations"]
    page = (made / "index.html").read_text()
    assert "4 scans of 2 people" in page
    assert page.count("<figure") == 2
    code, out, err = workbench("coregister", str(place), "--rounds", "2")
    assert code == 2
    assert "other settings); remove it to start anew" in err


def test_coregister_refuses_what_it_cannot_use(workbench: Run, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    twice, alone, broken = (tmp_path / name for name in ("twice", "alone", "broken"))
    write_registered(twice, alike=True, who=("ann", "ann"))
    write_registered(alone, who=("ann", "ann"))
    write_registered(broken, who=("ann", "bob"))
    (broken / "scan1" / SCAN_FILE).write_bytes(b"PK")
    for folder, why in (
        (empty, "register them first with `workbench register SCANS/ --subjects TABLE.csv`"),
        (tmp_path / "nowhere", "register them first"),
        (twice, "scan0 and scan1 are the same points"),
        (alone, "two subjects or more, not of 1"),
        (broken, "repeat `workbench register`"),
    ):
        code, _, err = workbench("coregister", str(folder))
        assert code == 2
        assert why in " ".join(err.split()), folder
    for option in (("--rounds", "0"), ("--edges", "0"), ("--coupling", "nan"), ("--workers", "0")):
        code, _, err = workbench("coregister", str(alone), *option)
        assert code == 2
        assert option[0] in err
    (broken / "scan1" / SCAN_FILE).unlink()
    write_arrays(broken / "scan1" / SCAN_FILE, {"points": np.zeros((0, 3))})
    code, _, err = workbench("coregister", str(broken))
    assert code == 2
    assert "empty" in err
