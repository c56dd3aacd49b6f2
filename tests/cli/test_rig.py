"""`workbench rig`, as a user types it."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.training.rigging.made_motion import compared, driven
from workbench.geometry.meshes import write_mesh

GIVEN = driven(20, seed=1)


def made_folder(folder: Path) -> None:
    folder.mkdir()
    for i, mesh in enumerate(GIVEN.meshes):
        write_mesh(folder / f"frame_{i}.ply", mesh, GIVEN.body.faces)
    write_mesh(folder.parent / "rest.ply", GIVEN.body.template, GIVEN.body.faces)


def test_a_folder_of_meshes_becomes_a_body_and_a_motion(tmp_path: Path, workbench: Run) -> None:
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
    agreement = compared(body, GIVEN.body)
    assert agreement.edges == 5
    assert agreement.joints < 1e-6
    motion = wb.read_motion(tmp_path / "motion.npz")
    assert motion.fps == 25
    np.testing.assert_allclose(motion.vertices(body)[10], GIVEN.meshes[10], atol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nothing",), "there is no file or folder"),
        (("empty",), "has no meshes"),
        (("stack.npy",), "none of the files has faces"),
        (("stack.npy", "--rest", "default"), "the topology has (1229, 3)"),
        (("stack.npy", "--out", "body.obj"), "--out takes a file that ends in .npz or .pkl"),
        (("stack.npy", "--frames", "1"), "--frames takes 2 or more"),
        (("people",), "of 2 subjects (anna, ben)"),
    ],
)
def test_what_is_wrong_is_a_sentence(
    tmp_path: Path, workbench: Run, arguments: tuple[str, ...], said: str
) -> None:
    np.save(tmp_path / "stack.npy", GIVEN.meshes)
    (tmp_path / "empty").mkdir()
    (tmp_path / "people").mkdir()
    np.save(tmp_path / "people" / "both.npy", GIVEN.meshes)
    table = "file,subject\nboth.npy#0,anna\nboth.npy#1,ben\n"
    (tmp_path / "people" / "registrations.csv").write_text(table)
    code, _, err = workbench("rig", *arguments)
    assert code == 2
    assert said in " ".join(err.split())
