"""What goes wrong without each term."""

from math import nan

import numpy as np
import pytest

from benchmarks.ablations.study import (
    Ablated,
    Sets,
    ablate,
    turn_errors,
)
from workbench import load_body
from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.estimate import Sigmas
from workbench.training.registrations import InMemory

START = jointed_tube(7, 5)
BODY = random_smpl(START, 2, seed=3, shape=0.005)


@pytest.fixture(scope="module")
def results() -> dict[str, Ablated]:
    poses, _ = draw_registrations(BODY, 3, 8, seed=4)
    shapes, _ = draw_registrations(BODY, 60, 1, seed=6, turn=0.3)
    held_out, _ = draw_registrations(BODY, 3, 2, seed=7)
    sets = Sets(CorruptedRegistrations(poses, seed=1, noise=0.001), shapes, held_out, START)
    found = ablate(sets, Sigmas(posedirs=0.005), rounds=1, n_betas=2)
    return {result.name: result for result in found}


def test_without_e_y_templates_are_less_even(results: dict[str, Ablated]) -> None:
    assert results["no E_Y"].asymmetry > 1.2 * results["all terms"].asymmetry


def test_without_e_p_blend_shapes_grow_and_fit_noise(results: dict[str, Ablated]) -> None:
    whole, without = results["all terms"], results["no E_P"]
    assert without.posedirs_rms > 2 * whole.posedirs_rms
    assert without.training_rms < whole.training_rms
    assert without.held_out_rms > whole.held_out_rms


def test_without_pose_normalisation_shape_is_pose(results: dict[str, Ablated]) -> None:
    raw, normal = results["not pose-normalised"], results["all terms"]
    assert raw.pose_in_shape[0] > 0.5
    assert 1 - normal.pose_in_shape[0] > 5 * (1 - raw.pose_in_shape[0])  # what pose leaves open


def test_pose_share_of_what_is_known() -> None:
    rng = np.random.default_rng(0)
    poses = rng.standard_normal((200, 3, 3))
    own = rng.standard_normal(200)
    pose_made = np.zeros((200, 4, 3))
    pose_made[:, 0, 0] = 3 * poses[:, 1, 2]
    pose_made[:, 1, 1] = 2 * own
    pose_made[:, 2, 2] = 1.0 * (poses[:, 2, 0] + rng.standard_normal(200))
    first, second, third = pose_share(pose_made, poses)
    assert first == pytest.approx(1, abs=0.02)
    assert second == pytest.approx(0, abs=0.1)
    assert third == pytest.approx(0.5, abs=0.12)
    assert all(np.isnan(share) for share in pose_share(pose_made[:5], poses[:5]))
    assert nan not in (first, second, third)


def test_aligned_meshes_lie_on_the_first() -> None:
    data, _ = draw_registrations(BODY, 1, 3, seed=1, turn=0.01)
    moved = InMemory(data.vertices + np.arange(3)[:, None, None], data.subject)
    found = aligned(moved)
    assert np.abs(found - found[0]).max() < 0.02


def test_edges_tell_the_pose_of_somebody_else_better_than_vertices() -> None:
    body = load_body("small")
    poses = np.zeros((6, 24, 3))
    poses[:, 1:] = 0.2 * np.random.default_rng(0).standard_normal((6, 23, 3))
    errors = turn_errors(body, poses, seed=1)
    assert errors["edges"][:, 1:].mean() < 0.7 * errors["vertices"][:, 1:].mean()
