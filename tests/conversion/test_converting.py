"""A motion of one body as that of another."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from benchmarks.clips_made_up import clip
from tests.bodies.model_files import with_fingers, written
from workbench.bodies.body import Body
from workbench.conversion import conversion_errors, convert, correspond
from workbench.conversion.converting import turned_on
from workbench.conversion.parts import vertex_parts
from workbench.errors import BadArgument
from workbench.geometry.rotation import matrix_from_vector
from workbench.motions import bones_of, read_bvh, write_bvh

SMALL, DEFAULT, HAND = (wb.load_body(name) for name in ("small", "default", "hand"))


@pytest.fixture(scope="module")
def fingers(tmp_path_factory: pytest.TempPathFactory) -> Body:
    """The body `small` with 52 joints."""
    return wb.load_body(written(with_fingers("small"), tmp_path_factory.mktemp("h") / "SMPLH.pkl"))


def test_a_body_becomes_itself_with_its_shape() -> None:
    motion = clip(SMALL, 4)
    told: list[tuple[str, int, int]] = []
    found = convert(motion, SMALL, SMALL, progress=lambda *step: told.append(step))
    assert 1e3 * found.mean() < 0.1
    np.testing.assert_allclose(found.motion.betas, motion.betas, atol=0.05)
    np.testing.assert_allclose(found.motion.trans, motion.trans, atol=1e-3)
    assert found.motion.origin == "converted from body 'small': made up"
    assert told[-1] == ("poses", 4, 4)


@pytest.mark.parametrize("back", [False, True])
def test_24_joints_become_52_and_back(fingers: Body, back: bool) -> None:
    source, target = (fingers, SMALL) if back else (SMALL, fingers)
    assert sorted((source.n_joints, target.n_joints)) == [24, 52]
    motion = clip(source, 5, seed=2)
    found = convert(motion, source, target)
    assert found.mean() < 5e-3
    assert found.mean(hands=False) < 1e-3
    assert found.motion.joint_names == target.joint_names


def test_another_mesh_follows_within_millimetres() -> None:
    motion = clip(DEFAULT, 5, seed=1)
    kept = correspond(DEFAULT, SMALL)
    found = convert(motion, DEFAULT, SMALL, correspondence=kept)
    assert found.correspondence is kept
    copied = conversion_errors(motion.named(SMALL), SMALL, motion, DEFAULT, kept)
    assert found.mean() < 3e-3
    assert found.mean() < 0.3 * np.nanmean(copied)
    places = kept.of(motion.vertices(DEFAULT))
    off = np.linalg.norm(found.motion.vertices(SMALL) - places, axis=2)
    np.testing.assert_allclose(found.errors[:, kept.matched], off[:, kept.matched], atol=1e-12)
    assert np.isnan(found.errors[:, ~kept.matched]).all()
    means = [mean for mean, _ in found.by_part.values()]
    assert means == sorted(means, reverse=True)
    assert {"left_forearm", "head", "right_fingers"} <= {*found.by_part}


def test_a_frame_that_jumps_is_found_again() -> None:
    """From one frame to the next the person turns round, with other limbs bent."""
    first, second = clip(SMALL, 1, seed=3), clip(SMALL, 1, seed=4)
    pose = np.concatenate([first.pose, second.pose])
    pose[1, 0] = [0.0, 3.0, 0.0]
    trans = np.array([[0.0, 0.9, 0.0], [2.0, 0.9, -1.0]])
    motion = wb.Motion(pose, trans, 30, SMALL.joint_names, first.betas)
    assert 1e3 * convert(motion, SMALL, SMALL).errors.max() < 1.0


def test_a_start_is_turned_as_the_source_was() -> None:
    motion = clip(DEFAULT, 2, seed=5)
    before = {"pose": motion.pose[0], "trans": motion.trans[0] + 1.0, "betas": motion.betas}
    found = turned_on(DEFAULT, before, motion, 1)
    np.testing.assert_allclose(
        *(matrix_from_vector(p) for p in (found["pose"], motion.pose[1])), atol=1e-12
    )
    np.testing.assert_allclose(found["trans"], motion.trans[1] + 1.0)


def test_parts_have_the_names_of_the_body(fingers: Body) -> None:
    names = {*vertex_parts(fingers)}
    assert {"left_hand", "left_fingers", "right_thigh", "head"} <= names
    assert "left_index1" not in names
    assert {"wrist", "index3"} <= {*vertex_parts(HAND)}


def test_a_correspondence_of_other_bodies_is_refused() -> None:
    kept = correspond(SMALL, SMALL)
    with pytest.raises(BadArgument, match="takes 369 vertices to 369, but bodies 'default'"):
        convert(clip(DEFAULT, 2), DEFAULT, SMALL, correspondence=kept)


@pytest.mark.parametrize("back", [False, True])
def test_triangle_bodies_take_part(back: bool) -> None:
    """Their surface solves a linear system, whose places and shapes are fitted all the same."""
    triangles = wb.load_body("small-scape")
    motion = clip(SMALL, 2, seed=8)
    source, target = (triangles, SMALL) if back else (SMALL, triangles)
    assert convert(motion, source, target).mean() < 5e-3


def test_triangle_bodies_are_written_with_their_bones_at_rest(tmp_path: Path) -> None:
    triangles, motion = wb.load_body("small-scape"), clip(SMALL, 2)
    write_bvh(tmp_path / "a.bvh", motion, triangles)
    found, bones = read_bvh(tmp_path / "a.bvh"), bones_of(triangles, motion.betas)
    order = [found.joint_names.index(name) for name in triangles.joint_names]
    # Those of the surface are elsewhere, because its bones stretch; a .bvh has bones of one length.
    own = bones.joints(motion.pose, motion.trans)
    np.testing.assert_allclose(found.joints()[:, order], own, atol=1e-5)
