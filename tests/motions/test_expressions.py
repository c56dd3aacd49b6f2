"""The expression of a motion moves the face of bodies that have one, wherever they are played."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import workbench as wb
from tests.bodies.model_files import flame, written
from workbench.bodies import shape_space
from workbench.geometry.gltf import document_of, local_motions
from workbench.motions import write_glb

T = 4


@pytest.fixture(scope="module")
def face(tmp_path_factory: pytest.TempPathFactory) -> wb.SkinnedBody:
    """Five joints, ten directions of shape and ten of expression."""
    raw = flame(60)
    raw["shapedirs"] = raw["shapedirs"][:, :, [*range(10), *range(300, 310)]]
    body = wb.load_body(written(raw, tmp_path_factory.mktemp("face") / "FLAME.pkl"))
    assert isinstance(body, wb.SkinnedBody)
    assert len(shape_space(body).expression) == 10
    return body


@pytest.fixture(scope="module")
def talking(face: wb.SkinnedBody) -> wb.Motion:
    """Every joint turns, and three coefficients of the expression change."""
    rng = np.random.default_rng(3)
    pose = rng.normal(scale=0.3, size=(T, face.n_joints, 3))
    trans, betas, expression = (rng.normal(size=s) for s in ((T, 3), 6, (T, 3)))
    return wb.Motion(pose, trans, 30.0, face.joint_names, betas, expression)


def test_expression_moves_surface_and_joints(face: wb.SkinnedBody, talking: wb.Motion) -> None:
    betas = np.zeros((T, 20))
    betas[:, :6], betas[:, 10:13] = talking.betas, talking.expression
    np.testing.assert_allclose(talking.betas_on(face), betas)
    for t in range(T):
        at = talking.pose[t], betas[t], talking.trans[t]
        np.testing.assert_allclose(talking.vertices(face)[t], face.vertices(*at), atol=1e-12)
        np.testing.assert_allclose(talking.joints(face)[t], face.joints(*at), atol=1e-12)
    still = replace(talking, expression=None)
    assert still.betas_on(face).shape == (20,)
    assert np.abs(talking.vertices(face) - still.vertices(face)).max() > 1e-3


def test_bodies_without_a_face_are_noted(face: wb.SkinnedBody, talking: wb.Motion) -> None:
    assert talking.named(face).notes == ()
    long = replace(talking, betas=np.ones(12), expression=np.ones((T, 30))).named(face)
    assert (len(long.betas), long.expression.shape) == (10, (T, 10))  # type: ignore[union-attr]
    assert "of 12 betas, the body has the first 10 as betas of shape" in long.notes
    assert "of 30 coefficients of expression, the body has the first 10" in long.notes
    small = wb.load_body("small")
    named = replace(talking, joint_names=small.joint_names[: face.n_joints]).named(small)
    assert "the expression is kept, but the body has no face that it moves" in named.notes
    assert named.betas_on(small).shape == (10,)


def test_glb_plays_the_expression(face: wb.SkinnedBody, talking: wb.Motion, tmp_path: Path) -> None:
    """The file is played by hand: morph targets, then nodes and inverse bind matrices."""
    write_glb(tmp_path / "a.glb", talking, face, shapes=2)
    played = played_by_hand(tmp_path / "a.glb", talking.pose)
    assert np.abs(played - talking.vertices(face)).max() < 1e-5


def played_by_hand(path: Path, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices (T, N, 3) of our own file at its key frames."""
    document = document_of(path.read_bytes())
    json_ = document.json
    primitive = json_["meshes"][0]["primitives"][0]
    where = primitive["attributes"]
    rest = document.values(where["POSITION"], "VEC3", 3)
    N, K = len(rest), pose.shape[1]
    influences = np.zeros((N, K))
    for s in range(sum(key.startswith("JOINTS") for key in where)):
        joints = document.values(where[f"JOINTS_{s}"], "VEC4", 4).astype(int)
        shares = document.values(where[f"WEIGHTS_{s}"], "VEC4", 4)
        np.add.at(influences, (np.arange(N)[:, None], joints), shares)
    targets = [document.values(t["POSITION"], "VEC3", 3) for t in primitive["targets"]]
    bind = document.values(json_["skins"][0]["inverseBindMatrices"], "MAT4", 16)
    bind = bind.reshape(K, 4, 4).swapaxes(1, 2)
    samplers, motions = json_["animations"][0]["samplers"], []
    parent = {c: k for k, n in enumerate(json_["nodes"]) for c in n.get("children", [])}
    for t in range(len(pose)):
        nodes, weights = [dict(n) for n in json_["nodes"]], np.zeros(len(targets))
        for channel in json_["animations"][0]["channels"]:
            goal, output = channel["target"], samplers[channel["sampler"]]["output"]
            kind, columns = {"rotation": ("VEC4", 4), "translation": ("VEC3", 3)}.get(
                goal["path"], ("SCALAR", 1)
            )
            numbers = document.values(output, kind, columns)
            if goal["path"] == "weights":
                weights = numbers.reshape(len(pose), -1)[t]
            else:
                nodes[goal["node"]][goal["path"]] = numbers[t].tolist()
        world = []
        for k in range(K):
            own = local_motions(nodes[k], {})[0]
            world.append(world[parent[k]] @ own if k in parent else own)
        moved = rest + np.tensordot(weights, np.array(targets), 1)
        blend = np.einsum("nk,kij->nij", influences, np.array(world) @ bind)
        motions.append(np.einsum("nij,nj->ni", blend, np.c_[moved, np.ones(N)])[:, :3])
    return np.array(motions)
