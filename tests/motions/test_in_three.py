"""What others make of a motion as .glb: Khronos's validator finds nothing, three.js shows the body.

Both are packages of npm, which `.ci/run` installs; WORKBENCH_NODE_MODULES names their folder.
"""

import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from benchmarks.clips_made_up import clip
from tests.bodies.model_files import flame, with_fingers, written
from workbench.errors import BadArgument
from workbench.motions import gltf, write_glb

pytestmark = pytest.mark.thorough

MODULES = os.environ.get("WORKBENCH_NODE_MODULES", "")
NEEDS_NODE = pytest.mark.skipif(
    shutil.which("node") is None or not (Path(MODULES or "none") / "three").is_dir(),
    reason="no node on the PATH, or WORKBENCH_NODE_MODULES names no folder with gltf-validator "
    "and three, which `npm install gltf-validator three` makes",
)


def shown(path: Path) -> tuple[dict[str, object], np.ndarray]:
    """What the validator finds, and the vertices (T * N, 3) m that three.js shows."""
    script, out = Path(__file__).with_name("three.mjs"), path.with_suffix(".bin")
    command = ["node", str(script), str(Path(MODULES).absolute()), str(path), str(out)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return json.loads(found.stdout), np.fromfile(out).reshape(-1, 3)


@NEEDS_NODE
@pytest.mark.parametrize(
    ("name", "frames", "correctives", "farthest"),
    [
        ("small", 12, None, 1e-6),
        ("default", 40, 32, 5e-4),
        ("hand", 20, None, 1e-6),
        ("52 joints", 12, None, 1e-6),
    ],
)
def test_validator_and_three_show_the_body(
    tmp_path: Path, name: str, frames: int, correctives: int | None, farthest: float
) -> None:
    known = name != "52 joints"
    body = wb.load_body(name if known else written(with_fingers("small"), tmp_path / "SMPLH.pkl"))
    assert isinstance(body, wb.SkinnedBody)
    motion = clip(body, frames, seed=6)
    seen_by_others(tmp_path / "a.glb", motion, body, correctives, farthest)


@NEEDS_NODE
def test_three_shows_expressions(tmp_path: Path) -> None:
    raw = flame(60)
    raw["shapedirs"] = raw["shapedirs"][:, :, [*range(10), *range(300, 310)]]
    body = wb.load_body(written(raw, tmp_path / "FLAME.pkl"))
    assert isinstance(body, wb.SkinnedBody)
    faces = np.arange(40)[:, None] + [0, 1, 2]  # some of those made up are flat
    weights = np.where(body.weights > np.sort(body.weights)[:, :1], body.weights, 0)  # four of five
    body = replace(body, faces=faces, weights=weights / weights.sum(axis=1, keepdims=True))
    rng = np.random.default_rng(3)
    pose = rng.normal(scale=0.3, size=(8, body.n_joints, 3))
    trans, betas, expression = (rng.normal(size=s) for s in ((8, 3), 6, (8, 10)))
    talking = wb.Motion(pose, trans, 30.0, body.joint_names, betas, expression)
    still = replace(talking, expression=None)
    assert np.abs(talking.vertices(body) - still.vertices(body)).max() > 1e-3
    seen_by_others(tmp_path / "a.glb", talking, body, None, 1e-6)


def seen_by_others(
    path: Path,
    motion: wb.Motion,
    body: wb.SkinnedBody,
    correctives: int | None,
    farthest: float,
) -> None:
    """The validator finds nothing, and three.js shows the body, to within `farthest` in m."""
    write_glb(path, motion, body, correctives=correctives, shapes=10)
    issues, places = shown(path)
    found = [issues[f"num{kind}"] for kind in ("Errors", "Warnings", "Infos", "Hints")]
    assert found == [0, 0, 0, 0], issues["messages"]
    off = np.linalg.norm(places - motion.vertices(body).reshape(-1, 3), axis=1)
    assert off.max() < farthest


def test_glb_that_would_be_too_large_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = wb.load_body("small")
    monkeypatch.setattr(gltf, "LARGEST", 30_000)
    with pytest.raises(
        BadArgument, match="12 morph targets of 369 vertices in 12 frames take 0 MB"
    ):
        write_glb(tmp_path / "a.glb", clip(body, 12), body)
    assert not list(tmp_path.iterdir())
    write_glb(tmp_path / "a.glb", clip(body, 12), body, correctives=2)
