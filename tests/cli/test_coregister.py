"""`workbench coregister`, as typed."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.bodies.files.saving import save_body
from workbench.bodies.triangles import TriangleBody
from workbench.registration.coregistration.folder import BODY, SCAN
from workbench.synthetic.made_up import jointed_tube, random_smpl
from workbench.training.folder import TABLE, open_folder
from workbench.writing import write_arrays

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
        write_arrays(folder / SCAN, {"points": points, "normals": unit.astype(np.float32)})
        off = pose + 0.01 * rng.standard_normal(pose.shape)
        fit = {"pose": off, "betas": betas, "trans": np.zeros(3), "vertices": vertices}
        write_arrays(folder / "registration.npz", fit)
        lines.append(f"scan{j}/registration.npz,{name},neutral,poses")
    (place / TABLE).write_text("\n".join(lines) + "\n")
    save_body(body, place / BODY)


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
    (broken / "scan1" / SCAN).write_bytes(b"PK")
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
    (broken / "scan1" / SCAN).unlink()
    write_arrays(broken / "scan1" / SCAN, {"points": np.zeros((0, 3))})
    code, _, err = workbench("coregister", str(broken))
    assert code == 2
    assert "empty" in err


@pytest.mark.thorough
def test_coregister_with_a_model_of_triangles_goes_on_where_it_was(
    workbench: Run, tmp_path: Path
) -> None:
    place, made = tmp_path / "register-some", Path("runs/coregister-some")
    write_registered(place)
    typed = ("coregister", str(place), "--model", "blend-scape", "--edges", "0.01")
    code, out, err = workbench(*typed, "--rounds", "1")
    assert code == 0, err
    assert "--edges changes nothing" in err + out
    costs = [float(x) for pair in re.findall(r"cost (\S+) -> (\S+)", out) for x in pair]
    assert costs == sorted(costs, reverse=True)
    told = json.loads((made / "summary.json").read_text())
    assert told["blocks"] == ["persons", "bends", "registrations"]
    learned = load_body(made / "body.npz")
    assert isinstance(learned, TriangleBody)
    assert learned.n_betas == 1
    people = learned.vertices(betas=[1.0]), learned.vertices(betas=[-1.0])
    assert np.abs(people[0] - people[1]).max() > 0.01  # m
    assert open_folder(made / "registrations", tube().n_vertices, tube().faces).subjects
    whole = load_body(made / "body.npz").template
    code, again, err = workbench(*typed, "--rounds", "1")
    assert code == 0, err
    assert "continuing after the last block" in again
    np.testing.assert_array_equal(load_body(made / "body.npz").template, whole)
    code, _, err = workbench("coregister", str(place), "--rounds", "1")
    assert code == 2
    assert "remove it to start anew" in err
