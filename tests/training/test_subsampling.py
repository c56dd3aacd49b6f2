"""Training on some of the vertices first: subsampled meshes, masked systems, collapsed edges."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.sparse import csr_array, eye_array

import workbench as wb
from builder.base_mesh import Topology
from builder.collapsing import collapsed
from workbench.errors import BadArgument
from workbench.geometry.mirror import find_mirror
from workbench.geometry.solids import mesh_edges
from workbench.training.blocks import QUICK, Plan, Stage
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.pose_training import train_coarse_first
from workbench.training.registrations import InMemory
from workbench.training.subsampling import subsample

BODY = wb.load_body("small")
BALL = trimesh.creation.icosphere(3)  # 642 vertices


def test_subsampled_ball_is_a_ball() -> None:
    """Evenly spread, closed, and no vertex of the ball is far from those that were kept."""
    points, faces = np.asarray(BALL.vertices), np.asarray(BALL.faces)
    few = subsample(points, faces, 120)
    kept = points[few.vertices]
    assert len(few.vertices) == 120
    assert np.linalg.norm(points[:, None] - kept, axis=2).min(axis=1).max() < 0.3
    apart = np.linalg.norm(kept[:, None] - kept, axis=2) + 9 * np.eye(120)
    assert apart.min() > 0.15
    assert len(few.faces) == 2 * 120 - 4  # Euler: closed, without handles
    assert len(mesh_edges(few.faces)) == 3 * 120 - 6


def test_subsampled_body_moves_as_the_body() -> None:
    """Its joints too, though the vertices that they were means of are gone."""
    few = subsample(BODY.template, BODY.faces, 90)
    rng = np.random.default_rng(0)
    pose, betas = 0.4 * rng.normal(size=(24, 3)), rng.normal(size=10)
    whole, sparse = BODY.vertices(pose, betas), few.body(BODY).vertices(pose, betas)
    assert abs(sparse[:90] - whole[few.vertices]).max() < 1e-14


def _posed() -> tuple[Estimate, Objective]:
    rng = np.random.default_rng(1)
    poses, subject = 0.3 * rng.normal(size=(4, 24, 3)), np.array([0, 0, 1, 1])
    templates = BODY.template + 0.01 * rng.normal(size=(2, 1, 1)) * BODY.template
    joints = np.stack([BODY.J_regressor @ T for T in templates])
    truth = Estimate(templates, joints, BODY.posedirs, BODY.weights, poses, BODY.parents)
    data = InMemory(SkinningPass.of(truth, slice(0, 4), subject).points, subject)
    sigmas = Sigmas(rings=np.inf)
    return truth, Objective(data, BODY.J_regressor, BODY.weights, None, sigmas, BODY.template)


def test_short_edges_collapse_symmetrically() -> None:
    every = Topology(csr_array(eye_array(BODY.n_vertices)), BODY.faces, BODY.mirror)
    fewer = collapsed(every, BODY.template, 301)
    points = fewer.follows @ BODY.template
    mesh = trimesh.Trimesh(points, fewer.faces, process=False)
    assert points.shape == (301, 3)
    assert len(fewer.faces) == 2 * 301 - 4
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(trimesh.Trimesh(BODY.template, BODY.faces).volume, rel=0.1)
    assert np.array_equal(find_mirror(points, fewer.faces), fewer.mirror)
    with pytest.raises(BadArgument, match="does not come down to 300"):
        collapsed(every, BODY.template, 300)
    for count in (0, 370):
        with pytest.raises(BadArgument, match="369 vertices"):
            collapsed(every, BODY.template, count)


@pytest.mark.thorough
def test_large_mesh_is_trained_coarse_first(tmp_path: Path) -> None:
    """Every vertex is found in the end, alike on both sides, and again from what is on disk."""
    truth, objective = _posed()
    data, start = objective.registrations, Start.of(BODY)
    quick = Plan((Stage(Sigmas(), ("rest", "poses", "surfaces"), 1, QUICK),), 2)
    train = partial(train_coarse_first, data, start, quick, folder=tmp_path, coarse=300)
    model = train()
    assert [entry.block for entry in model.log][:3] == ["rest", "poses", "surfaces"]
    assert len(model.log) > 6
    assert model.estimate.templates.shape == truth.templates.shape
    assert model.objective.rms(model.estimate) < 0.002
    near = model.objective.locality
    assert near is not None
    assert 0.05 < near.mean() < 0.5
    assert not model.estimate.posedirs[~near[:, None] & np.ones((1, 3, 1), bool)].any()
    again = train()
    for name, array in model.estimate.arrays().items():
        assert np.array_equal(array, again.estimate.arrays()[name])


def test_subsampled_mesh_keeps_its_sides() -> None:
    mirror = Start.of(BODY).mirror()
    assert mirror is not None
    few = subsample(BODY.template, BODY.faces, 101, mirror.vertices)
    own = few.mirror(mirror)
    assert np.array_equal(own.vertices[own.vertices], np.arange(len(few.vertices)))
    reflected = own.points(BODY.template[few.vertices])
    assert reflected == pytest.approx(BODY.template[few.vertices], abs=1e-12)
