"""Smoothness: differences of neighbouring frames, whatever they are of."""

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.differences import assert_jacobian
from workbench.errors import BadArgument, BadResidual, NotNumbers, UnknownName
from workbench.residuals import gaussian, huber, landmarks, smooth

BODY = random_body(1, n_vertices=5, n_joints=3, n_betas=2)
POSE, BETAS, TRANS = BODY.blocks()
JOINTS = BODY.joint_points(POSE.symbol, BETAS.symbol, TRANS.symbol)
FRAME = wb.Problem(
    (
        landmarks(JOINTS, np.zeros((3, 3)), sigma=0.1, name="joints"),
        gaussian(POSE.symbol, unit="rad", name="pose prior"),
    ),
    ("pose", "betas", "trans"),
)
RNG = np.random.default_rng(0)
T = 5
VALUES = {
    "pose": RNG.normal(scale=0.4, size=(T, 3, 3)),
    "betas": RNG.normal(size=2),
    "trans": RNG.normal(size=(T, 3)),
}


def rows(*between: object, count: int = T) -> dict[str, np.ndarray]:
    """The whitened rows of each residual between the frames, by name."""
    whole = wb.sequence([FRAME] * count, shared="betas", between=between)  # type: ignore[arg-type]
    given = {n: v if n == "betas" else v[:count] for n, v in VALUES.items()}
    r = whole.residual(*whole.split(given))
    return {n: r[at] for n, at in whole.rows.items() if n not in FRAME.rows}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ["pose", "trans"])
def test_they_are_the_differences_of_a_block(name: str, order: int) -> None:
    (found,) = rows(smooth(name, sigma=0.2, order=order)).values()
    np.testing.assert_allclose(
        found, np.diff(VALUES[name], order, axis=0).ravel() / 0.2, atol=1e-12
    )


@pytest.mark.parametrize("order", [1, 2])
def test_they_are_the_differences_of_points(order: int) -> None:
    (found,) = rows(smooth(JOINTS, sigma=0.2, order=order)).values()
    joints = [
        BODY.joints(p, VALUES["betas"], t)
        for p, t in zip(VALUES["pose"], VALUES["trans"], strict=True)
    ]
    np.testing.assert_allclose(found, np.diff(joints, order, axis=0).ravel() / 0.2, atol=1e-12)


def test_a_sigma_for_each_entry_of_a_frame() -> None:
    sigma = RNG.uniform(0.1, 1, (3, 3))
    (found,) = rows(smooth("pose", sigma=sigma)).values()
    np.testing.assert_allclose(found, (np.diff(VALUES["pose"], axis=0) / sigma).ravel(), atol=1e-12)
    across = np.array([0.1, 0.2, 0.4])
    (found,) = rows(smooth("trans", sigma=across, order=2)).values()
    expected = np.diff(VALUES["trans"], 2, axis=0) / across
    np.testing.assert_allclose(found, expected.ravel(), atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("what", ["trans", JOINTS], ids=["block", "points"])
def test_derivatives_are_exact(what: str | wb.Points, order: int) -> None:
    between = [smooth(what, sigma=0.2, order=order, kernel=huber(0.5))]
    whole = wb.sequence([FRAME] * T, shared="betas", between=between)
    assert_jacobian(whole, *whole.split(VALUES), 1e-9)


def test_what_does_not_change_costs_nothing_and_a_shift_of_all_frames_changes_nothing() -> None:
    between = [
        smooth("pose", sigma=0.1),
        smooth(JOINTS, sigma=0.1, order=2),
        smooth("trans", sigma=1.0),
    ]
    whole = wb.sequence([FRAME] * T, shared="betas", between=between)
    of = np.concatenate(
        [np.arange(at.start, at.stop) for n, at in whole.rows.items() if n not in FRAME.rows]
    )
    still = {n: v if n == "betas" else np.repeat(v[:1], T, axis=0) for n, v in VALUES.items()}
    np.testing.assert_allclose(whole.residual(*whole.split(still))[of], 0, atol=1e-12)
    moved = VALUES | {"trans": VALUES["trans"] + 1.0}
    one, other = (whole.residual(*whole.split(v))[of] for v in (VALUES, moved))
    np.testing.assert_allclose(one, other, atol=1e-11)


def test_constant_speed_costs_nothing_in_second_differences() -> None:
    whole = wb.sequence([FRAME] * T, shared="betas", between=[smooth("trans", sigma=0.1, order=2)])
    steady = VALUES | {"trans": np.arange(T)[:, None] * np.array([0.1, 0.2, -0.3])}
    at = whole.rows["smooth(trans, order 2)"]
    np.testing.assert_allclose(whole.residual(*whole.split(steady))[at], 0, atol=1e-12)


def test_frames_backwards_cost_the_same() -> None:
    between = [smooth("pose", sigma=0.1), smooth(JOINTS, sigma=0.1, order=2)]
    whole = wb.sequence([FRAME] * T, shared="betas", between=between)
    backwards = {n: v if n == "betas" else v[::-1] for n, v in VALUES.items()}
    assert whole.linearize(backwards).cost == pytest.approx(whole.linearize(VALUES).cost, rel=1e-13)


def test_names_labels_and_units() -> None:
    between = [
        smooth("pose", sigma=0.1),
        smooth(JOINTS, sigma=0.1, order=2),
        smooth("trans", sigma=0.1, name="slow"),
    ]
    whole = wb.sequence([FRAME] * 3, shared="betas", between=between)
    found = {r.name: r for r in whole.residuals}
    assert list(found)[-3:] == ["smooth(pose)", "smooth(joints, order 2)", "slow"]
    assert [found[n].unit for n in list(found)[-3:]] == ["rad", "m", "m"]
    assert found["smooth(pose)"].label(0) == "smooth(pose)[0 to 1, joint0, x]"
    assert found["smooth(pose)"].label(17) == "smooth(pose)[1 to 2, joint2, z]"
    assert found["smooth(joints, order 2)"].label(4) == "smooth(joints, order 2)[0 to 2, joint1, y]"
    assert found["slow"].label(5) == "slow[1 to 2, z]"


def test_a_single_number_of_each_frame_is_smooth_too() -> None:
    scale = wb.Block("scale")
    one = wb.Problem((gaussian(scale.symbol, name="near"),), ("scale",), blocks=(scale,))
    whole = wb.sequence([one] * 3, between=[smooth("scale", sigma=0.5)])
    r = whole.residual(*whole.split({"scale": np.array([1.0, 2.0, 4.0])}))
    np.testing.assert_allclose(r, [1, 2, 4, 2, 4])
    assert whole.row_label(3) == "smooth(scale)[0 to 1]"
    assert whole.free.label(2) == "scale[2]"


def test_what_cannot_be_smooth_is_said() -> None:
    with pytest.raises(BadArgument, match="order 1 or 2, not 3"):
        smooth("pose", sigma=0.1, order=3)
    with pytest.raises(BadArgument, match=r"name of a block.*or Points.*not something of type MX"):
        smooth(POSE.symbol, sigma=0.1)  # type: ignore[arg-type]
    with pytest.raises(BadResidual, match="all frames share the block 'betas'"):
        rows(smooth("betas", sigma=0.1))
    with pytest.raises(UnknownName, match="no block is called 'poze'"):
        rows(smooth("poze", sigma=0.1))
    with pytest.raises(BadResidual, match="order 1 take 2 frames, and there are 1"):
        rows(smooth("pose", sigma=0.1), count=1)
    with pytest.raises(BadResidual, match="order 2 take 3 frames, and there are 2"):
        rows(smooth("pose", sigma=0.1, order=2), count=2)
    with pytest.raises(BadResidual, match="sigma above zero"):
        rows(smooth("pose", sigma=0.0))
    with pytest.raises(BadResidual, match="one for each of the 3 entries of a frame"):
        rows(smooth("trans", sigma=[0.1, 0.2]))
    with pytest.raises(NotNumbers, match="sigma of residual"):
        rows(smooth("trans", sigma="small"))  # type: ignore[arg-type]
    other = random_body(1, n_vertices=5, n_joints=4, n_betas=2)
    strange = other.joint_points(
        *(wb.Block(f"other {b.name}", b.shape).symbol for b in other.blocks())
    )
    with pytest.raises(UnknownName, match="other pose"):
        rows(smooth(strange, sigma=0.1))
