"""People to be scanned: who they are depends on the seed and their number alone."""

import numpy as np
import pytest

from workbench import load_body
from workbench.errors import BadArgument
from workbench.geometry.solids import mesh_edges
from workbench.synthetic import people

BODY = load_body("small")
POSES = 0.3 * np.random.default_rng(5).standard_normal((40, 24, 3))


def test_a_person_depends_on_the_seed_and_its_number_alone() -> None:
    few, many, others = (people(BODY, POSES, n, seed) for n, seed in ((2, 0), (5, 0), (2, 1)))
    for one, same, other in zip(few, many[:2], others, strict=True):
        np.testing.assert_array_equal(one.vertices, same.vertices)
        assert not np.allclose(one.vertices, other.vertices, atol=1e-3)
    assert not np.allclose(few[0].vertices, few[1].vertices, atol=1e-3)


def test_people_are_those_of_the_body_and_of_the_poses_that_were_given() -> None:
    for one in people(BODY, POSES, 10, 0):
        np.testing.assert_array_equal(one.vertices, BODY.vertices(**one.values))
        below = one.values["pose"][1:]
        assert any(np.array_equal(below, pose[1:]) for pose in POSES)


def test_people_face_any_way_and_have_shapes_of_variance_one() -> None:
    everyone = people(BODY, POSES[:1], 400, 0)
    pelvis = np.array([one.values["pose"][0] for one in everyone])
    assert (pelvis[:, [0, 2]] == 0).all()  # turned about the vertical alone
    quarters = np.histogram(pelvis[:, 1], np.linspace(-np.pi, np.pi, 5))[0]
    assert quarters.sum() == 400
    assert quarters.min() > 70
    betas = np.array([one.values["betas"] for one in everyone])
    assert betas.std() == pytest.approx(1, abs=0.05)
    some = people(BODY, POSES, 50, 0, turn=0.2)
    assert max(abs(one.values["pose"][0, 1]) for one in some) <= 0.2


def test_an_own_shape_is_as_large_as_asked_and_smooth_and_no_shape_of_the_body() -> None:
    plain, own = people(BODY, POSES, 3, 0), people(BODY, POSES, 3, 0, own_shape=0.005)
    edges = mesh_edges(BODY.faces)
    for one, other in zip(plain, own, strict=True):
        np.testing.assert_array_equal(one.values["pose"], other.values["pose"])
        np.testing.assert_array_equal(one.values["betas"], other.values["betas"])
        moved = other.template - BODY.template
        assert np.sqrt(np.mean((moved**2).sum(axis=1))) == pytest.approx(0.005)
        steps = moved[edges[:, 0]] - moved[edges[:, 1]]
        lengths = np.linalg.norm(np.diff(BODY.template[edges], axis=1)[:, 0], axis=1)
        slope = np.sqrt((steps**2).sum() / (lengths**2).sum())
        assert slope < 1.3 * 0.005 / 0.1  # it varies over a tenth of a metre
        directions = BODY.shapedirs.reshape(-1, BODY.n_betas)
        left = moved.ravel() - directions @ np.linalg.lstsq(directions, moved.ravel())[0]
        assert np.linalg.norm(left) > 0.5 * np.linalg.norm(moved)
        off = np.linalg.norm(one.vertices - other.vertices, axis=1)
        assert 0.002 < np.sqrt(np.mean(off**2)) < 0.01


def test_what_gives_no_people_is_refused() -> None:
    with pytest.raises(
        BadArgument, match=r"are \(P, 24, 3\) rad with at least one, not \(0, 24, 3"
    ):
        people(BODY, POSES[:0], 1, 0)
    with pytest.raises(BadArgument, match=r"not \(40, 22, 3\)"):
        people(BODY, POSES[:, :22], 1, 0)
    with pytest.raises(BadArgument, match="from 0 on, not 1, -1 and 0"):
        people(BODY, POSES, 1, -1)
