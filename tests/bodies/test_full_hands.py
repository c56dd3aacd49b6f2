"""The body with hands: where its parts meet, what it takes from each, and who can open it."""

import json
import pickle
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

from builder.full_hands import sewn_mesh
from tests.bodies.paper import smpl
from workbench.bodies import pose_space
from workbench.bodies.catalogue import embedded, embedded_hand, load_skinned, sewing_of
from workbench.bodies.files.saving import save_body
from workbench.bodies.sewn_hands import with_hands
from workbench.geometry.mirror import AXIAL, REFLECTION, opposite

pytestmark = pytest.mark.thorough

FULL, HAND, BODY = embedded("full"), embedded_hand(), load_skinned("full-hands")
MESH = sewing_of("full")
RIGHT, LEFT = slice(37, 52), slice(22, 37)


def in_both(fingers: np.ndarray) -> np.ndarray:
    """A pose (52, 3) whose right fingers are in the hand's pose (16, 3), and its left mirrored."""
    pose = np.zeros((52, 3))
    pose[RIGHT], pose[LEFT] = fingers[1:], fingers[1:] * AXIAL
    return pose


@cache
def someone(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A pose whose fingers are of the pose space, betas and a place."""
    rng = np.random.default_rng(seed)
    space = pose_space(BODY)
    pose = space.poses(BODY, space.deviations * rng.standard_normal(space.n_components))
    pose[:22] = 0.3 * rng.standard_normal((22, 3))
    return pose, rng.standard_normal(10), rng.standard_normal(3)


def test_sewn_mesh_is_closed_and_symmetric() -> None:
    made = sewn_mesh(FULL, HAND.faces, MESH.origin[MESH.hands["right"]])
    for name, array in made.items():
        np.testing.assert_array_equal(getattr(MESH, name, MESH.hands.get(name)), array)
    mesh = trimesh.Trimesh(BODY.template, BODY.faces, process=False)
    assert (BODY.n_vertices, len(BODY.faces)) == (10_490, 20_976)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume == pytest.approx(0.0718, abs=0.001)
    assert BODY.mirror is not None
    np.testing.assert_array_equal(BODY.template[BODY.mirror] * REFLECTION, BODY.template)
    flipped = BODY.shapedirs[BODY.mirror] * REFLECTION[:, None]
    np.testing.assert_array_equal(flipped, BODY.shapedirs)
    pose, betas, trans = someone(0)
    sides = [k for name in BODY.joint_names for k in [BODY.joint_names.index(opposite(name))]]
    there = BODY.vertices(pose[sides] * AXIAL, betas, trans * REFLECTION)
    here = BODY.vertices(pose, betas, trans)
    np.testing.assert_allclose(there[BODY.mirror] * REFLECTION, here, atol=1e-12)


@pytest.mark.parametrize("name", ["full", "full-female", "full-male"])
def test_body_with_held_fingers_is_the_body_at_rest(name: str) -> None:
    """For all betas, joints down to the wrists included, which lie within half a millimetre."""
    body, sewing = embedded(name), sewing_of(name)
    sewn = BODY if name == "full" else with_hands(body, HAND, sewing, name)
    held = in_both(sewing.held)
    for betas in (np.zeros(10), np.random.default_rng(0).standard_normal(10)):
        was = body.vertices(betas=betas)[MESH.origin]
        np.testing.assert_allclose(sewn.vertices(held, betas), was, atol=1e-12)
        moved = sewn.joints(held, betas)[:22] - body.joints(betas=betas)[:22]
        assert np.linalg.norm(moved, axis=1).max() < 6e-4
    fingers = sewn.weights[:, 22:].any(axis=1)
    apart = abs(sewn.template - body.template[MESH.origin])[~fingers]
    assert apart.max() < 1.5e-4  # what the blend shapes of fingers do beyond them


def degrees(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arcsin(np.linalg.norm(u - v, axis=1).clip(0, 2) / 2))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "smplh"
    folder.mkdir()
    save_body(BODY, folder / "SMPLH_NEUTRAL.pkl")
    return folder / "SMPLH_NEUTRAL.pkl"


def test_saved_file_is_smpl_h_and_comes_back(written: Path) -> None:
    arrays = pickle.loads(written.read_bytes())
    assert arrays["posedirs"].shape == (10_490, 3, 459)
    for side in "lr":  # what the loader of SMPL-H asks for beside SMPL's keys
        assert arrays[f"hands_components{side}"].shape == (45, 45)
        assert arrays[f"hands_mean{side}"].shape == (45,)
    pose, betas, trans = someone(1)
    assert len(arrays["card"].item()) < 9000  # letters; of 10,000 it could not be read back
    back = load_skinned(written)
    expected, _ = smpl(back, pose, betas, trans)
    np.testing.assert_allclose(BODY.vertices(pose, betas, trans), expected, atol=1e-12)
    assert (back.name, back.joint_names) == (BODY.name, BODY.joint_names)
    assert back.landmark_names("coco_with_hands") == BODY.landmark_names("coco_with_hands")
    np.testing.assert_array_equal(back.extras["hands_meanl"], BODY.extras["hands_meanl"])
    np.testing.assert_array_equal(back.vertices(pose, betas), BODY.vertices(pose, betas))
    ids = json.loads(written.with_name("SMPLH_NEUTRAL_vertex_ids.json").read_text())
    rows = BODY.landmarks["tips"].regressor.toarray().argmax(axis=1)
    tips = dict(zip(BODY.landmark_names("tips"), rows.tolist(), strict=True))
    assert ids["lthumb"] == tips["left_thumb_tip"]
    assert ids["rpinky"] == tips["right_pinky_tip"]
