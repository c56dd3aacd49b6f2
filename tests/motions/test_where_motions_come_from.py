"""What finds a motion hands it over as one: markers, clips and recordings."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import workbench as wb
from tests.motions.made_files import random_motion
from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.fitting import MarkerFit
from workbench.fitting.setup import Moving
from workbench.motions import read_motion
from workbench.plots import caption_motion, plot_motion
from workbench.plots.figure import drawn
from workbench.priors.recorded_motions import recorded_motions

SMALL = wb.load_body("small")
RECORDING = Path(__file__).parents[3] / "shared" / "data" / "mocap" / "cmu_smpl_10fps.npz"


def recording(path: Path, **changed: Any) -> Path:
    poses = np.random.default_rng(0).normal(0, 0.02, (12, 72))
    entries = {
        "poses": poses,
        "trans": poses[:, :3],
        "ok": np.array([1, 1, 1, 0, 1, 1, 1, 0, 1, 0, 1, 1], dtype=bool),
        "clip": np.array([0] * 5 + [1] * 7, np.uint8),
        "clip_name": np.array(["walk", "run"]),
        "joint_names": np.array(SMALL.joint_names),
        "fps": np.array(10.0),
    }
    np.savez(path, **entries | changed)
    return path


def test_a_recording_is_cut_at_clips_and_at_frames_that_are_not_good(tmp_path: Path) -> None:
    path = recording(tmp_path / "mocap.npz")
    found = recorded_motions(path)
    assert [motion.origin for motion in found] == [
        "walk, frames 0 to 2",
        "run, frames 0 to 1",
        "run, frames 5 to 6",
    ]
    with np.load(path) as arrays:
        np.testing.assert_array_equal(found[1].pose.reshape(2, 72), arrays["poses"][5:7])
    assert found[0].fps == 10
    for wrong in ({"fps": np.array(0.0)}, {"poses": np.zeros((12, 71))}):
        with pytest.raises(BadFile, match="is no recording of motions"):
            recorded_motions(recording(tmp_path / "mocap.npz", **wrong))


@pytest.mark.skipif(not RECORDING.exists(), reason="the recording is not part of the project")
def test_people_who_were_recorded_stand_on_their_feet() -> None:
    motions = recorded_motions(RECORDING)
    assert sum(map(len, motions)) > 3000
    motion = max(motions, key=len)
    joints = motion.joints(SMALL)
    feet = [SMALL.joint_names.index(f"{side}_foot") for side in ("left", "right")]
    lowest = joints[:, feet, 1].min(axis=1)
    assert np.median(lowest) == pytest.approx(lowest.min(), abs=0.15)
    assert motion.up[0] == "y"


def test_markers_and_clips_hand_over_a_motion(tmp_path: Path) -> None:
    motion = random_motion(SMALL.n_joints, SMALL.joint_names)
    pose, trans = motion.pose.copy(), motion.trans.copy()
    pose[3], trans[3] = np.nan, np.nan
    nothing = cast(Any, None)
    found = MarkerFit(pose, trans, motion.betas, nothing, nothing, nothing, nothing, nothing)
    filled = found.motion(SMALL, 60.0)
    np.testing.assert_array_equal(filled.pose[4], motion.pose[4])
    assert filled.notes == ("1 of 6 frames were not found, and are interpolated",)
    blocks = (block.name for block in SMALL.blocks())
    values = dict(zip(blocks, (motion.pose, motion.betas, motion.trans), strict=True))
    moved = Moving(SMALL, (), 60.0).motion(values)
    np.testing.assert_array_equal(moved.vertices(SMALL), motion.vertices(SMALL))
    np.savez(  # as `workbench fit` writes it for markers
        tmp_path / "motion.npz",
        poses=pose,
        trans=trans,
        betas=motion.betas,
        fps=60.0,
        joint_names=np.array(SMALL.joint_names),
        up_axis="y",
    )
    np.testing.assert_allclose(read_motion(tmp_path / "motion.npz").pose, filled.pose, atol=1e-12)


def test_a_strip_shows_each_frame_beside_the_one_before() -> None:
    motion = random_motion(SMALL.n_joints, SMALL.joint_names, 20)
    places: Array = motion.joints(SMALL)
    pairs = np.array(list(enumerate(SMALL.parents)))[1:]
    ax = drawn(lambda ax: plot_motion(places, pairs, 10.0, ax=ax), 8, 2).axes[0]
    assert len(ax.collections) == 8
    middles = [np.mean(np.concatenate(c.get_segments())[:, 0]) for c in ax.collections]  # type: ignore[attr-defined]
    assert np.all(np.diff(middles) > 0.5)
    heights = np.concatenate(ax.collections[0].get_segments())[:, 1]  # type: ignore[attr-defined]
    assert heights.max() == pytest.approx(places[0, :, 1].max())
    assert ax.texts[-1].get_text() == "1.90 s"
    assert caption_motion(20, 10.0) == "8 of 20 frames at 10 frames a second, seen from the front."
