"""A short sequence is diagnosed as every problem is, and its directions are named by frame."""

import casadi as cs
import numpy as np
import pytest

from workbench import Problem, Values, diagnose, load_body, residuals, sequence
from workbench.diagnostics import Diagnosis
from workbench.residuals import Residual

pytestmark = pytest.mark.thorough

T = 2


def video(free: tuple[str, ...], *, smooth: bool) -> tuple[Problem, Values]:
    """The small body in two frames, all of whose joints are observed."""
    body = load_body("small")
    pose, betas, trans = body.blocks()
    joints = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    seen = Residual("joints", cs.vec(joints.symbol), 0.01, "m", points=(joints,))
    between = [residuals.smooth("pose", sigma=0.1)] if smooth else []
    whole = sequence([Problem([seen], free)] * T, shared=("betas",), between=between)
    rng = np.random.default_rng(0)
    blocks = {b.name: b.base for b in (*whole.free.blocks, *whole.fixed.blocks)}
    return whole, {name: rng.normal(scale=0.3, size=b.shape) for name, b in blocks.items()}


@pytest.mark.parametrize("smooth", [False, True])
def test_short_sequences_are_diagnosed_whole(smooth: bool) -> None:
    found = diagnose(*video(("pose", "trans", "betas"), smooth=smooth))
    assert isinstance(found, Diagnosis)
    # 15 numbers of leaves in each frame, and 17 turns about bones without smoothness
    assert found.shape[1] - found.rank == (15 if smooth else T * 32)
    names = [direction.name for direction in found.null_directions]
    if not smooth:
        assert "a turn of pose[1, left_wrist] alone" in names
        assert "pose[1, left_hand, y]" in names
    assert "NULL DIRECTIONS" in found.report()


def test_rank_law_is_not_for_several_frames() -> None:
    assert diagnose(*video(("pose",), smooth=False)).rank_law is None
