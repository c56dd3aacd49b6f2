"""Simulated people: who they are, and what is refused."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.geometry.solids import mesh_edges
from workbench.motions import splined
from workbench.synthetic import people
from workbench.synthetic.made_up import made_up_motion

SMALL = wb.load_body("small")
POSES = 0.3 * np.random.default_rng(5).standard_normal((40, 24, 3))


def test_person_depends_on_seed_and_number_alone() -> None:
    few, many, others = (people(SMALL, POSES, n, seed) for n, seed in ((2, 0), (5, 0), (2, 1)))
    for one, same, other in zip(few, many[:2], others, strict=True):
        np.testing.assert_array_equal(one.vertices, same.vertices)
        assert not np.allclose(one.vertices, other.vertices, atol=1e-3)
    assert not np.allclose(few[0].vertices, few[1].vertices, atol=1e-3)


def test_people_face_any_way() -> None:
    everyone = people(SMALL, POSES[:1], 400, 0)
    pelvis = np.array([one.values["pose"][0] for one in everyone])
    assert (pelvis[:, [0, 2]] == 0).all()  # turned about the vertical alone
    quarters = np.histogram(pelvis[:, 1], np.linspace(-np.pi, np.pi, 5))[0]
    assert quarters.sum() == 400
    assert quarters.min() > 70
    betas = np.array([one.values["betas"] for one in everyone])
    assert betas.std() == pytest.approx(1, abs=0.05)
    some = people(SMALL, POSES, 50, 0, turn=0.2)
    assert max(abs(one.values["pose"][0, 1]) for one in some) <= 0.2


@pytest.mark.thorough
def test_own_shape_is_smooth_and_as_large_as_asked() -> None:
    plain, own = people(SMALL, POSES, 3, 0), people(SMALL, POSES, 3, 0, own_shape=0.005)
    edges = mesh_edges(SMALL.faces)
    for one, other in zip(plain, own, strict=True):
        np.testing.assert_array_equal(one.values["pose"], other.values["pose"])
        np.testing.assert_array_equal(one.values["betas"], other.values["betas"])
        moved = other.template - SMALL.template
        assert np.sqrt(np.mean((moved**2).sum(axis=1))) == pytest.approx(0.005)
        steps = moved[edges[:, 0]] - moved[edges[:, 1]]
        lengths = np.linalg.norm(np.diff(SMALL.template[edges], axis=1)[:, 0], axis=1)
        slope = np.sqrt((steps**2).sum() / (lengths**2).sum())
        assert slope < 1.3 * 0.005 / 0.1  # it varies over a tenth of a metre
        directions = SMALL.shapedirs.reshape(-1, SMALL.n_betas)
        left = moved.ravel() - directions @ np.linalg.lstsq(directions, moved.ravel())[0]
        assert np.linalg.norm(left) > 0.5 * np.linalg.norm(moved)
        off = np.linalg.norm(one.vertices - other.vertices, axis=1)
        assert 0.002 < np.sqrt(np.mean(off**2)) < 0.01


def test_bad_poses_of_people_are_refused() -> None:
    with pytest.raises(BadArgument, match="at least one"):
        people(SMALL, POSES[:0], 1, 0)
    with pytest.raises(BadArgument, match=r"not \(40, 22, 3\)"):
        people(SMALL, POSES[:, :22], 1, 0)
    with pytest.raises(BadArgument, match="seed of people"):
        people(SMALL, POSES, 1, -1)


def test_splined_motions_pass_through_their_frames() -> None:
    slow = made_up_motion(SMALL, 2.0, fps=10.0)
    fine = splined(slow, 60.0)
    kept = fine[::6]
    R, S = (wb.Motion.joints(m, SMALL) for m in (slow, kept))
    np.testing.assert_allclose(R[: len(S)], S, atol=1e-12)
    true = made_up_motion(SMALL, 2.0)[: len(fine)]
    inner = slice(12, -12)
    way = (fine.joints(SMALL) - true.joints(SMALL))[inner]
    straight = (slow.resampled(60.0).joints(SMALL) - true.joints(SMALL))[inner]
    assert np.abs(way).max() < 0.3 * np.abs(straight).max()
    with pytest.raises(BadArgument, match="a spline needs 4 frames or more"):
        splined(slow[:3], 60.0)
