"""What the examples on skinning and blend shapes claim."""

from importlib import import_module

import numpy as np


def test_every_ablation_is_seen_and_no_fit_makes_up_for_it() -> None:
    example = import_module("examples.20_ablated_smpl")
    assert example.away["no blend weights"].max() > 50  # mm
    assert 1 < example.away["no pose blend shapes"].mean() < 5
    assert example.away["no shape blend shapes"].mean() > 30
    assert all(left > 1 for left in example.residuals_left.values())


def test_blend_shapes_are_of_the_joints_that_turned() -> None:
    example = import_module("examples.21_pose_blends")
    assert example.turned == ["left_elbow", "left_knee", "right_hip", "right_knee", "right_wrist"]
    assert not example.at_rest.any()
    assert 10 < example.largest < 60  # mm
    off = {
        name: np.linalg.norm(v - example.surfaces["SMPL"], axis=1).mean()
        for name, v in example.surfaces.items()
    }
    assert off["dual quaternions alone"] < off["linear blending alone"]


def test_linear_blending_fails_as_the_laws_say() -> None:
    example = import_module("examples.22_linear_blending_fails")
    assert example.off_the_law < 1e-12
    assert example.off_the_integral < 1e-3
    linear, dual, smpl = (example.wrist[name][-1] for name in example.ways)
    assert linear < smpl < 1
    np.testing.assert_allclose(dual, 1, atol=1e-12)
    at_right_angles = example.bends.searchsorted(np.pi / 2 - 1e-9)
    lost = [-example.elbow[name][at_right_angles] for name in example.ways]
    assert max(lost[1:]) < 0.8 * lost[0]


def test_only_rotation_elements_come_back_after_one_turn() -> None:
    example = import_module("examples.23_predicting_blend_shapes")
    grown = example.once_round
    assert abs(grown["LBS + rotation elements (SMPL)"]) < 1e-9  # mm
    assert grown["LBS + theta"] > 1
    assert grown["LBS + quaternions"] > 1
    best, *_, worst = sorted(example.errors, key=example.errors.__getitem__)
    assert (best, worst) == ("LBS + rotation elements (SMPL)", "linear blending (LBS)")


def test_shape_directions_explain_and_joints_go_with_them() -> None:
    example = import_module("examples.24_shape_directions")
    np.testing.assert_allclose(example.own * example.shares.sum(), example.shares, atol=2e-3)
    assert (np.diff(example.left, axis=0) <= 1e-15).all()
    assert example.left[-1].mean() < 0.2 * example.left[0].mean()
    mean = example.gallery["mean"]
    for k in range(5):  # straight lines through the mean
        ends = [example.gallery[f"betas[{k}] {sign}3 sd"] for sign in "+-"]
        assert np.abs(sum(ends) / 2 - mean).max() < 0.01
    assert example.moved.max() > 0.1  # m
    assert example.wrong.max() > 0.03


def test_the_numbers_of_a_body_are_counted() -> None:
    example = import_module("examples.24_shape_directions")
    published = {name: count for name, (count, _) in example.PUBLISHED.items()}
    assert sum(published.values()) == 6_014_970
    released = example.sizes(6890, 24, 10)
    assert released["posedirs"] == 4_278_690 == 3 * 9 * 23 * 6890
    assert released["template"] + released["shapedirs"] == 227_370
    assert sum(released.values()) == 4_836_780
    for name in ("template", "shapedirs", "posedirs"):
        assert published[name] == released[name]
    assert published["weights"] == 3 * 4 * 6890 != released["weights"] == 165_360
    assert published["J_regressor"] == 3 * 6890 * 23 * 3 != 23 * 6890 == 158_470
    for name in ("posedirs", "weights", "J_regressor"):
        assert example.PUBLISHED[name][1]
    body = example.body
    sizes = example.sizes(body.n_vertices, body.n_joints, body.n_betas)
    assert {name: array.size for name, array in example.here.items()} == sizes


def test_parts_come_off_and_the_tree_holds() -> None:
    example = import_module("examples.25_separate_parts")
    assert example.numbers == (144, 75)
    assert example.no_gaps.max() < 1e-11
    assert example.gaps.max() > 0.02
    assert example.errors["a tree"].mean() < example.errors["separate parts"].mean()
