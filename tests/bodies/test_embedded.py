"""The bodies that are shipped: the laws of all bodies, and what must be true of their arrays."""

import pickle
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

import workbench
from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_root_turns_everything_about_pelvis,
    some_arguments,
)
from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench.bodies.catalogue import BODIES, Embedded, load_body, load_skinned, read_embedded
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.cli.app import app
from workbench.errors import BadFile

EACH = pytest.mark.parametrize("name", few(BODIES, ("small", "hand", "small-scape")))


def assert_contract(body: SkinnedBody | TriangleBody) -> None:
    assert_bind_pose_leaves_template(body)
    assert_root_turns_everything_about_pelvis(body)
    pose, betas, trans = some_arguments(body)
    posed = body.vertices(pose, betas, trans)
    points = body.points(*(block.symbol for block in body.blocks()))
    numeric = points.source.numeric
    if numeric is not None:
        values = dict(zip(numeric.reads, (pose, betas, trans), strict=True))
        np.testing.assert_allclose(numeric.evaluate(values).points, posed, atol=1e-9)
    copied = pickle.loads(pickle.dumps(body))
    np.testing.assert_array_equal(copied.template, body.template)


@pytest.mark.browser
@EACH
def test_every_body_keeps_the_laws_of_bodies(name: str) -> None:
    assert_contract(load_body(name))


def mine() -> SkinnedBody:
    """As a newcomer would write it, in a module of their own."""
    return random_body(4, n_vertices=30, n_joints=4)


def test_a_function_and_a_line_make_a_body(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadFile, match="no body is called 'mine'"):
        load_body("mine")
    monkeypatch.setitem(BODIES, "mine", mine)
    assert_contract(load_body("mine"))
    assert load_skinned("mine").n_joints == 4
    with pytest.raises(BadFile, match=r"the bodies are default, .*mine"):
        load_body("yours")
    found = CliRunner().invoke(app, ["body", "card", "mine", "--out", str(tmp_path)])
    assert found.exit_code == 0, found.output
    assert (tmp_path / "body-mine").is_dir()


FOLDER = Path(workbench.__file__).parent / "data" / "bodies"
FLIP = np.array([-1.0, 1.0, 1.0])


@cache
def load(name: str) -> SkinnedBody:
    return read_embedded(FOLDER / f"{name}.npz")


@pytest.fixture(params=few(get_args(Embedded), ("default",)))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def body(name: str) -> SkinnedBody:
    return load(name)


def opposites(names: tuple[str, ...]) -> list[int]:
    swapped = [n.replace("left", "L").replace("right", "left").replace("L", "right") for n in names]
    return [names.index(n) for n in swapped]


def test_surface_is_closed_and_faces_outwards(body: SkinnedBody) -> None:
    mesh = trimesh.Trimesh(body.template, body.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert 0.055 < mesh.volume < 0.085  # m^3, positive: outwards


def test_mirror_maps_the_body_to_itself(body: SkinnedBody) -> None:
    mirror, joints = body.mirror, opposites(body.joint_names)
    assert np.array_equal(mirror[mirror], np.arange(len(mirror)))
    assert np.array_equal(body.template[mirror] * FLIP, body.template)
    assert np.array_equal(body.shapedirs[mirror] * FLIP[:, None], body.shapedirs)
    assert np.array_equal(body.weights[mirror][:, joints], body.weights)
    assert np.array_equal(
        _mirrored_rows(body.J_regressor, joints, mirror), body.J_regressor.toarray()
    )
    names, coco = body.landmarks["coco"].names, body.landmarks["coco"].regressor
    assert np.array_equal(_mirrored_rows(coco, opposites(names), mirror), coco.toarray())
    reflected = mirror[body.faces][:, [0, 2, 1]]
    assert _from_the_least_corner(reflected) == _from_the_least_corner(body.faces)


def _mirrored_rows(regressor, rows, columns):  # type: ignore[no-untyped-def]
    return regressor.toarray()[rows][:, columns]


def _from_the_least_corner(faces):  # type: ignore[no-untyped-def]
    return {tuple(np.roll(face, -face.argmin())) for face in faces}


def test_all_bodies_together_are_small() -> None:
    assert sum(path.stat().st_size for path in FOLDER.glob("*.npz")) < 15e6


def test_files_without_a_body_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"there is no file .*nothing\.npz"):
        read_embedded(tmp_path / "nothing.npz")
    np.savez(tmp_path / "other.npz", template=np.zeros((3, 3)))
    with pytest.raises(BadFile, match="joint_names"):
        read_embedded(tmp_path / "other.npz")
    np.savez(tmp_path / "pickled.npz", template=np.array([{}], dtype=object))
    with pytest.raises(BadFile, match="allow_pickle"):
        read_embedded(tmp_path / "pickled.npz")
