"""The package smplx, given our file, computes what we compute."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bodies.model_files import mano, written
from tests.bodies.model_files import smplx as smplx_file
from tests.bodies.random_bodies import Entries, decorated, entries
from workbench.bodies import mirrored, pose_space, shape_space
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.files.layouts import body_from
from workbench.bodies.files.saving import save_body
from workbench.bodies.skinned import SkinnedBody

pytestmark = pytest.mark.thorough
REASON = "smplx and torch are needed to compare with smplx: pip install '.[bench]'"
smplx = pytest.importorskip("smplx", reason=REASON)
torch = pytest.importorskip("torch", reason=REASON)
BATCH = 4
TRANS = np.tile([0.1, 0.2, 0.3], (BATCH, 1))  # m
THEIR_WARNINGS = pytest.mark.filterwarnings("default")  # of smplx and torch
TOLERANCE = 2e-6  # m: smplx computes in single precision; 4e-7 was seen


def random(N: int) -> SkinnedBody:
    """A body of random numbers over every vertex and joint, about as large as a person."""
    body = decorated(body_from(entries(N=N), "random", "random"))
    return replace(body, template=body.template * 0.3)


def given(**arrays: np.ndarray) -> dict[str, Any]:
    """The arguments of a model of smplx, in single precision."""
    return {key: torch.tensor(array, dtype=torch.float32) for key, array in arrays.items()}


def as_body(raw: Entries, name: str, folder: Path) -> SkinnedBody:
    """A body about as large as its model, out of a file in the layout of that model."""
    suffix = ".pkl" if name == "hand" else ".npz"
    sized = raw | {"v_template": raw["v_template"] * 0.3}
    return load_skinned(written(sized, folder / f"{name}{suffix}"))


def agree(out: Any, body: SkinnedBody, pose: np.ndarray, betas: np.ndarray) -> None:
    vertices, joints = body.vertices(pose, betas, TRANS), body.joints(pose, betas, TRANS)
    away = abs(out.vertices.detach().numpy() - vertices).max()
    away_joints = abs(out.joints.detach().numpy()[:, : body.n_joints] - joints).max()
    print(f"{body.name}: vertices {away:.1e} m, joints {away_joints:.1e} m")
    assert max(away, away_joints) < TOLERANCE


@THEIR_WARNINGS
@pytest.mark.parametrize("which", ["small", "full", 7000])
def test_smpl_is_what_smplx_computes(tmp_path: Path, which: str | int) -> None:
    body = load_skinned(which) if isinstance(which, str) else random(which)
    (tmp_path / "smpl").mkdir()
    save_body(body, tmp_path / "smpl" / "SMPL_NEUTRAL.pkl")
    ids = json.loads((tmp_path / "smpl" / "SMPL_NEUTRAL_vertex_ids.json").read_text())
    theirs = smplx.create(str(tmp_path), model_type="smpl", vertex_ids=ids, batch_size=BATCH)
    rng = np.random.default_rng(0)
    pose, betas = rng.normal(size=(BATCH, 24, 3)) * 0.5, rng.normal(size=(BATCH, 10))
    pose[0] = 0
    with torch.no_grad():
        out = theirs(
            **given(
                betas=betas,
                global_orient=pose[:, 0],
                body_pose=pose[:, 1:].reshape(BATCH, 69),
                transl=TRANS,
            )
        )
    agree(out, body, pose, betas)
    assert out.joints.shape == (BATCH, 45, 3)
    nose = body.vertices(pose, betas, TRANS)[:, ids["nose"]]
    np.testing.assert_allclose(out.joints.numpy()[:, 24], nose, atol=TOLERANCE)


@THEIR_WARNINGS
@pytest.mark.parametrize(
    ("which", "count"), [("mano", 6), ("left of mano", 6), ("hand", 6), ("left of mano", 45)]
)
def test_mano_by_the_coefficients_of_its_pose_space(tmp_path: Path, which: str, count: int) -> None:
    """The mean pose is added once: by smplx to what it is given, and here by the pose space."""
    body = load_skinned("hand") if which == "hand" else as_body(mano(), "hand", tmp_path)
    left = which == "left of mano"
    body = mirrored(body, "left") if left else body
    side = "LEFT" if left else "RIGHT"
    save_body(body, tmp_path / f"MANO_{side}.pkl")
    assert not (tmp_path / f"MANO_{side}_vertex_ids.json").exists()
    theirs = smplx.MANO(
        str(tmp_path),
        is_rhand=not left,
        num_pca_comps=count,
        flat_hand_mean=False,
        batch_size=BATCH,
    )
    space, rng = pose_space(body, count), np.random.default_rng(1)
    z, wrist, betas = (rng.normal(size=(BATCH, n)) * 0.5 for n in (count, 3, 10))
    pose = space.poses(body, z)
    pose[:, 0] = wrist
    # with all 45 components smplx takes rotation vectors, still without the mean
    hand = z if count < 45 else (pose[:, 1:] - space.mean).reshape(BATCH, 45)
    out = theirs(**given(betas=betas, global_orient=wrist, hand_pose=hand, transl=TRANS))
    agree(out, body, pose, betas)


@THEIR_WARNINGS
def test_smplx_of_55_joints_with_shape_and_expression(tmp_path: Path) -> None:
    raw = smplx_file(N=9930)  # smplx shows vertex 9,929
    raw["posedirs"][100:] = 0  # what is random takes long to write
    raw["shapedirs"][100:, :, 10:300] = 0
    body = as_body(raw, "body", tmp_path)
    save_body(body, tmp_path / "SMPLX_NEUTRAL.npz")
    theirs = smplx.SMPLX(
        str(tmp_path), use_pca=False, flat_hand_mean=True, batch_size=BATCH, use_face_contour=True
    )
    rng = np.random.default_rng(3)
    shape, expression = rng.normal(size=(2, BATCH, 10))
    pose = rng.normal(size=(BATCH, 55, 3)) * 0.4
    parts = ("global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose")
    parts += ("left_hand_pose", "right_hand_pose")
    split = np.split(pose, [1, 22, 23, 24, 25, 40], axis=1)
    posed = {key: part.reshape(BATCH, -1) for key, part in zip(parts, split, strict=True)}
    out = theirs(**given(betas=shape, expression=expression, transl=TRANS, **posed))
    agree(out, body, pose, shape_space(body).numbers(shape, expression))
