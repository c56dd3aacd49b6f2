"""The package smplx, given our file, computes what we compute."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bodies.random_bodies import decorated, entries
from workbench.bodies.catalogue import load_body
from workbench.bodies.files.saving import save_body
from workbench.bodies.files.smpl_layout import body_from
from workbench.bodies.skinned import SkinnedBody

REASON = "smplx and torch are needed to compare with smplx: pip install '.[bench]'"
smplx = pytest.importorskip("smplx", reason=REASON)
torch = pytest.importorskip("torch", reason=REASON)
BATCH = 4
TOLERANCE = 2e-6  # m: smplx computes in single precision; 4e-7 was seen


def random(N: int) -> SkinnedBody:
    """A body of random numbers over every vertex and joint, about as large as a person."""
    body = decorated(body_from(entries(N=N), "random", "random"))
    return replace(body, template=body.template * 0.3)


@pytest.mark.filterwarnings("default")  # smplx and torch have warnings of their own
@pytest.mark.parametrize("which", ["small", "default", "full", 40, 7000])
def test_smplx_computes_the_same(tmp_path: Path, which: str | int) -> None:
    body = load_body(which) if isinstance(which, str) else random(which)
    (tmp_path / "smpl").mkdir()
    save_body(body, tmp_path / "smpl" / "SMPL_NEUTRAL.pkl")
    ids = json.loads((tmp_path / "smpl" / "SMPL_NEUTRAL_vertex_ids.json").read_text())
    theirs = smplx.create(str(tmp_path), model_type="smpl", vertex_ids=ids, batch_size=BATCH)
    rng = np.random.default_rng(0)
    pose = rng.normal(size=(BATCH, 24, 3)) * 0.5
    pose[0] = 0
    betas, trans = rng.normal(size=(BATCH, 10)), rng.normal(size=(BATCH, 3))
    with torch.no_grad():
        out = theirs(
            betas=torch.tensor(betas, dtype=torch.float32),
            global_orient=torch.tensor(pose[:, 0], dtype=torch.float32),
            body_pose=torch.tensor(pose[:, 1:].reshape(BATCH, 69), dtype=torch.float32),
            transl=torch.tensor(trans, dtype=torch.float32),
        )
    vertices, joints = body.vertices(pose, betas, trans), body.joints(pose, betas, trans)
    away = abs(out.vertices.numpy() - vertices).max()
    away_joints = abs(out.joints.numpy()[:, :24] - joints).max()
    print(f"{body.name}: vertices {away:.1e} m, joints {away_joints:.1e} m")
    assert away < TOLERANCE
    assert away_joints < TOLERANCE
    assert out.joints.shape == (BATCH, 45, 3)
    np.testing.assert_allclose(out.joints.numpy()[:, 24], vertices[:, ids["nose"]], atol=TOLERANCE)
