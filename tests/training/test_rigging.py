"""Rigging finds the body that moved the meshes, and says what their motion leaves open."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, BadFile
from workbench.synthetic.made_up import jointed_tube, random_smpl
from workbench.training.rigging.decomposition import bones_needed, noise_of
from workbench.training.rigging.rig import Rigged, pose_rms, rig
from workbench.training.rigging.steps import RigProgress, RigSteps, silent


@dataclass(frozen=True, eq=False)
class Driven:
    """A body without blend shapes, and meshes (T, N, 3) m that it made."""

    body: SkinnedBody
    meshes: Array


def tube() -> SkinnedBody:
    """66 vertices on six bones, in smooth random weights."""
    made = random_smpl(jointed_tube(11, 6), 1, seed=2)
    plain = {"shapedirs": made.shapedirs[:, :, :0], "posedirs": np.zeros_like(made.posedirs)}
    return replace(made, **plain)


def driven(frames: int, seed: int, turn: float = 0.5, allowed: Array | None = None) -> Driven:
    """Meshes of `tube`; `allowed` (K, 3) says which rotations a joint makes, by default all."""
    body, rng = tube(), np.random.default_rng(seed)
    poses = turn * rng.standard_normal((frames, body.n_joints, 3))
    poses *= 1 if allowed is None else allowed
    trans = rng.standard_normal((frames, 3))
    meshes = [body.vertices(pose, trans=t) for pose, t in zip(poses, trans, strict=True)]
    return Driven(body, np.stack(meshes))


@dataclass(frozen=True, eq=False)
class Compared:
    """What was found, against the body that made the meshes.

    Attributes:
        weights: the largest difference, the bones being matched by their weights.
        joints: the largest distance of a joint, in metres, by edges of the tree; none of the root.
        edges: how many edges of the tree are the true ones.
    """

    weights: float
    joints: float
    edges: int


def compared(body: SkinnedBody, truth: SkinnedBody) -> Compared:
    """Bones of two bodies matched by their weights, and their joints by the bones that they join.

    `body` may have fewer bones than the truth, but then some are matched with none.
    """
    gaps = np.abs(body.weights[:, :, None] - truth.weights[:, None]).max(axis=0)
    own, other = linear_sum_assignment(gaps)
    true = dict(zip(own.tolist(), other.tolist(), strict=True))
    places, away, edges = truth.joints(), [0.0], 0
    for k, place in enumerate(body.joints()):
        a, b = true[k], true[body.parents[k]] if k else -1
        for child, parent in ((a, b), (b, a)):
            if k and truth.parents[child] == parent:
                edges += 1
                away.append(float(np.linalg.norm(place - places[child])))
    return Compared(float(gaps[own, other].max()), max(away), edges)


def test_rank_of_meshes_counts_bones() -> None:
    assert bones_needed(driven(30, seed=3).meshes, 1e-4) == 6
    hinge = np.ones((6, 3))
    hinge[3] = [0, 0, 1]
    assert bones_needed(driven(30, seed=3, allowed=hinge).meshes, 1e-4) == 6
    with pytest.raises(BadArgument, match="at most 64 are looked for"):
        bones_needed(np.random.default_rng(0).random((90, 300, 3)), 1e-3)


@pytest.mark.parametrize("sigma", [2e-4, 3e-3])
def test_singular_values_tell_the_noise(sigma: float) -> None:
    meshes = driven(24, seed=1).meshes
    noisy = meshes + sigma * np.random.default_rng(0).standard_normal(meshes.shape)
    assert noise_of(noisy) == pytest.approx(sigma, rel=0.02)
    assert bones_needed(noisy, 1.05 * np.sqrt(3) * sigma) == 6
    assert bones_needed(noisy, 1e-4) > 10
    assert noise_of(noisy[:9]) is None  # 19 of 27 singular values are motion
    assert noise_of(meshes) is None


def test_tube_is_rigged_and_explains_held_out_meshes() -> None:
    truth = driven(24, seed=1)
    parts: list[str] = []
    result = rig(
        truth.meshes,
        truth.body.faces,
        rest=truth.body.template,
        report=lambda what, done, of: parts.append(what),
    )
    agreement = compared(result.body, truth.body)
    assert agreement.edges == 5
    assert agreement.weights < 1e-6
    assert agreement.joints < 1e-6
    assert result.rms < 1e-8
    assert pose_rms(result.body, driven(3, seed=9).meshes) < 1e-8
    assert {"bones, turn 1", "skeleton"} <= set(parts)
    assert len(result.notes) == 1
    assert "the joint of root" in result.notes[0]
    motion = result.motion(30.0)
    again = result.body.vertices(motion.pose[4], trans=motion.trans[4])
    np.testing.assert_allclose(again, truth.meshes[4], atol=1e-8)


def test_meshes_of_single_precision_keep_their_rest_pose() -> None:
    """As meshes of files are rounded: a template that is free would only explain the rounding."""
    truth = driven(12, seed=3)
    meshes, rest = (x.astype(np.float32).astype(float) for x in (truth.meshes, truth.body.template))
    result = rig(meshes, truth.body.faces, rest=rest)
    agreement = compared(result.body, truth.body)
    assert agreement.edges == 5
    assert agreement.weights < 1e-4
    assert result.rms < 1e-7
    np.testing.assert_allclose(result.body.template, rest, atol=1e-12)


@pytest.mark.thorough
def test_interrupted_rig_continues_and_is_the_same(tmp_path: Path) -> None:
    """A part of the rig as well: it is a body on the true tree, less exact."""
    truth = driven(24, seed=1)
    place, said = tmp_path / "checkpoint.npz", []

    def interrupting(what: str, done: int, of: int) -> None:
        said.append(what)
        if said.count("skeleton") == 2:
            raise KeyboardInterrupt

    def rigged(steps: RigSteps, report: RigProgress = silent, bones: int | None = None) -> Rigged:
        rest, faces = truth.body.template, truth.body.faces
        return rig(truth.meshes, faces, rest=rest, bones=bones, report=report, steps=steps)

    with pytest.raises(KeyboardInterrupt):
        rigged(steps := RigSteps(place), interrupting)
    so_far = rigged(steps.so_far())
    assert so_far.body.n_joints == 6
    assert "the search was interrupted" in so_far.notes[-1]
    with pytest.raises(BadFile, match="another number of bones"):
        rigged(RigSteps(place), bones=7)
    again: list[str] = []
    result = rigged(RigSteps(place), lambda what, done, of: again.append(what))
    assert len(again) < len(said) + 3
    whole = rigged(RigSteps())
    np.testing.assert_array_equal(result.body.weights, whole.body.weights)
    np.testing.assert_array_equal(result.poses, whole.poses)
    assert result.rms == whole.rms < 1e-8


@pytest.mark.thorough
def test_rest_pose_is_found() -> None:
    """From a mesh in another pose: in no bent mesh is the skin where linear blending has it."""
    truth = driven(24, seed=1)
    bent = truth.body.vertices(0.15 * np.random.default_rng(4).standard_normal((6, 3)))
    result = rig(truth.meshes, truth.body.faces, rest=bent)
    assert result.rms < 1e-8
    assert result.body.n_joints == 6
    assert np.abs(result.body.template - bent).max() > 0.005  # m
    assert pose_rms(result.body, driven(3, seed=9).meshes) < 1e-8


@pytest.mark.thorough
def test_hinges_are_named() -> None:
    allowed = np.ones((6, 3))
    allowed[3] = [0, 0, 1]
    truth = driven(24, seed=1, allowed=allowed)
    result = rig(truth.meshes, truth.body.faces, rest=truth.body.template)
    assert result.rms < 1e-8
    assert compared(result.body, truth.body).edges == 5
    (hinge,) = (note for note in result.notes if "one axis" in note)
    assert "may slide along (0.00, 0.00, 1.00) by any distance" in hinge


@pytest.mark.thorough
def test_noise_asks_for_no_further_bones() -> None:
    truth = driven(24, seed=1)
    noise = 0.001 * np.random.default_rng(0).standard_normal(truth.meshes.shape)
    result = rig(truth.meshes + noise, truth.body.faces, rest=truth.body.template)
    agreement = compared(result.body, truth.body)
    assert result.body.n_joints == 6
    assert agreement.edges == 5
    assert agreement.joints < 0.003  # m
    assert 0.8 < result.rms / (0.001 * np.sqrt(3)) < 1


def test_one_bone_is_a_body_without_a_tree() -> None:
    truth = driven(6, seed=1, allowed=np.eye(6)[:, :1] * np.ones((6, 3)))
    result = rig(truth.meshes, truth.body.faces, rest=truth.body.template)
    assert result.body.parents == (-1,)
    assert result.rms < 1e-8
    noise = 0.001 * np.random.default_rng(0).standard_normal(truth.meshes.shape)
    noisy = rig(truth.meshes + noise, truth.body.faces, rest=truth.body.template)
    assert noisy.body.parents == (-1,)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"meshes": np.zeros((1, 66, 3))}, "two frames and four vertices"),
        ({"rest": np.zeros((5, 3))}, "one of the same topology"),
        ({"meshes": np.full((3, 66, 3), np.nan)}, "not finite"),
        ({"bones": 0}, "1 to 16 bones"),
        ({"tolerance": 0.0}, "above 0"),
    ],
)
def test_impossible_rigs_are_refused(wrong: dict[str, object], said: str) -> None:
    body = driven(2, seed=0)
    arguments = {"meshes": body.meshes, "rest": body.body.template} | wrong
    meshes = arguments.pop("meshes")
    with pytest.raises(BadArgument, match=said):
        rig(meshes, body.body.faces, **arguments)  # type: ignore[arg-type]
