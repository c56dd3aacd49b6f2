"""`workbench rig`, as a user types it."""

import signal
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.training.test_rigging import Driven, compared, driven
from workbench.cli.console import Bars
from workbench.geometry.meshes import write_mesh


@cache
def given() -> Driven:
    return driven(20, seed=1)


def made_folder(folder: Path) -> None:
    folder.mkdir()
    for i, mesh in enumerate(given().meshes):
        write_mesh(folder / f"frame_{i}.ply", mesh, given().body.faces)
    write_mesh(folder.parent / "rest.ply", given().body.template, given().body.faces)


@pytest.mark.thorough
def test_rig_makes_a_body_and_a_motion(tmp_path: Path, workbench: Run) -> None:
    made_folder(tmp_path / "frames")
    options = ("--rest", "rest.ply", "--out", "body.npz", "--motion", "motion.npz", "--fps", "25")
    code, out, err = workbench("rig", "frames", *options)
    assert code == 0, err
    assert "20 meshes of 66 vertices: learning from 16, the last 4 are held out" in out
    assert "6 bones; " in out
    assert "from 4 meshes that were held out (rms)" in out
    assert "note: no motion shows where the joint of root is" in out
    body = wb.load_body(tmp_path / "body.npz")
    assert isinstance(body, wb.SkinnedBody)
    agreement = compared(body, given().body)
    assert agreement.edges == 5
    assert agreement.joints < 1e-6
    motion = wb.read_motion(tmp_path / "motion.npz")
    assert motion.fps == 25
    np.testing.assert_allclose(motion.vertices(body)[10], given().meshes[10], atol=1e-8)


@pytest.mark.thorough
def test_interrupted_rig_writes_the_body_so_far_and_continues(
    tmp_path: Path, workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_folder(tmp_path / "frames")
    shown, rounds = Bars.__call__, []

    def interrupting(bars: Bars, what: str, done: int, of: int) -> None:
        shown(bars, what, done, of)
        rounds.append(what)
        if rounds.count("skeleton") == 2:
            signal.raise_signal(signal.SIGINT)

    with monkeypatch.context() as patched:
        patched.setattr(Bars, "__call__", interrupting)
        code, _, err = workbench("rig", "frames", "--rest", "rest.ply")
    assert code == 130
    assert "rigged.npz is the body so far, with 6 bones" in err
    assert "continues from rigged.checkpoint.npz" in err
    assert "interrupted" in str(wb.load_body("rigged.npz").card)
    assert workbench("rig", "frames", "--rest", "rest.ply")[0] == 0
    assert not Path("rigged.checkpoint.npz").exists()
    assert workbench("rig", "frames", "--rest", "rest.ply", "--out", "whole.npz")[0] == 0
    bodies = [wb.load_body(name) for name in ("rigged.npz", "whole.npz")]
    np.testing.assert_array_equal(*(np.asarray(body.template) for body in bodies))
    np.testing.assert_array_equal(*(body.joints() for body in bodies))


def test_rig_refuses_what_is_no_motion_of_one_person(workbench: Run, tmp_path: Path) -> None:
    np.save(tmp_path / "stack.npy", given().meshes)
    (tmp_path / "empty").mkdir()
    (tmp_path / "people").mkdir()
    np.save(tmp_path / "people" / "both.npy", given().meshes)
    table = "file,subject\nboth.npy#0,anna\nboth.npy#1,ben\n"
    (tmp_path / "people" / "registrations.csv").write_text(table)
    for arguments, said in (
        (("nothing",), "there is no file or folder"),
        (("empty",), "has no meshes"),
        (("stack.npy",), "none of the files has faces"),
        (("stack.npy", "--rest", "default"), "the topology has (1229, 3)"),
        (("stack.npy", "--out", "body.obj"), "--out takes a file that ends in .npz or .pkl"),
        (("stack.npy", "--frames", "1"), "--frames takes 2 or more"),
        (("people",), "of 2 subjects (anna, ben)"),
    ):
        code, _, err = workbench("rig", *arguments)
        assert code == 2
        assert said in " ".join(err.split())
